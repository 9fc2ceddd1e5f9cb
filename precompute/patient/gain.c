/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit the gain, the increase of the force from the top to the bottom of the lungs, to scans in
 * other postures. */
#include <math.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "precompute/patient/matching.h"

/* A fitted gain (increase of the force from top to bottom) outside this range is ignored. */
static const double gain_least = 0.01, gain_most = 2.0;
static const double same_posture = 0.05; /* directions of gravity closer than this are equal */
/* The fit ends if the changes of its factors and gain in a round, summed, are below `converged`. It
 * fails if the last sum is above `not_converged`. */
static const double converged = 1e-4, not_converged = 1e-2;
static const double force_least = 0.2; /* before a division, smaller forces are replaced by this */
enum { ROUNDS = 100, VERTICES_MAX = 2000, BLOCKS = 8, GAIN = 5, UNKNOWNS = 6 };

/* Of a point, in the model of supine_patient_gain_fit_landmarks. */
typedef struct point_motion {
  double u[3];         /* displacement from full inflation to rest, mm */
  double force_change; /* (h' - h) / f: relative change of the force if the gain is 1 */
} point_motion;

/* What shows the displacement to the third scan. */
typedef enum observed_kind { LANDMARKS, SURFACE } observed_kind;

typedef struct work {
  const supine_patient_record *record;
  observed_kind observed;
  bool fits_translation;
  /* [state, axis] displacement from full inflation to the fuller [0] or emptier [1] of the states
   * to which the displacement law was fitted, divided by the displacement to rest */
  double state_share[2][3];
  supine_patient_matching matching;
  point_motion *motion; /* [matching.count] motion of each measured point */
  double x[UNKNOWNS];   /* factors s of the left and right lung, translation t [3], mm, and gain */
} work;

/* Fit the unknowns w->x by least squares. The model contains the product of the factor s and the
 * gain; to keep it linear, use the previous s there. Return the RMS residual, mm.
 * @param without  index of the block of measurements to leave out, or BLOCKS to use all */
static double fit(work *w, bool fits_gain, size_t without) {
  double matrix[UNKNOWNS * UNKNOWNS] = {0.0};
  double right[UNKNOWNS] = {0.0};
  const double scale[2] = {w->x[0], w->x[1]};
  double squares = 0.0;
  double weights = 0.0;
  for (size_t i = 0; i < w->matching.count; ++i) {
    const supine_patient_row *row = &w->matching.rows[i];
    const double weight = row->block == without ? 0.0 : row->weight;
    const double along = supine_dot(row->axis, w->motion[i].u);
    const size_t lung = row->place.side > 0 ? 0U : 1U;
    double x[UNKNOWNS] = {0.0};
    x[lung] = along;
    x[GAIN] = fits_gain ? scale[lung] * w->motion[i].force_change * along : 0.0;
    double value = row->value;
    for (size_t a = 0; a < 3; ++a) {
      x[2 + a] = w->fits_translation ? row->axis[a] : 0.0;
      value += w->state_share[0][a] * row->axis[a] * w->motion[i].u[a];
    }
    cblas_dsyr(CblasColMajor, CblasUpper, UNKNOWNS, weight, x, 1, matrix, UNKNOWNS);
    cblas_daxpy(UNKNOWNS, weight * value, x, 1, right, 1);
    squares += weight * value * value;
    weights += weight;
  }
  memcpy(w->x, right, sizeof right);
  /* Replace zeros on the diagonal by 1, so that unknowns that are not fitted become 0. */
  for (size_t t = 0; t < UNKNOWNS; ++t) {
    matrix[t * UNKNOWNS + t] += matrix[t * UNKNOWNS + t] == 0.0 ? 1.0 : 0.0;
  }
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', UNKNOWNS, 1, matrix, UNKNOWNS, w->x, UNKNOWNS) != 0) {
    memset(w->x, 0, sizeof w->x);
  }
  squares = fmax(0.0, squares - cblas_ddot(UNKNOWNS, w->x, 1, right, 1));
  return sqrt(squares * (w->observed == LANDMARKS ? 3.0 : 1.0) / weights);
}

/* Compute the depth along gravity: 0 at the top of the lungs' bounding box, 1 at its bottom. */
static double depth_at(const supine_patient_frame *frame, const supine_patient_place *place,
                       const double gravity[3]) {
  const double outer = place->side > 0 ? frame->maximum[0] : frame->minimum[0];
  double depth = 0.0;
  double range = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double from = k == 0 ? frame->midline : frame->maximum[k];
    const double size = (k == 0 ? outer : frame->minimum[k]) - from;
    const double ends[2] = {gravity[k] * frame->minimum[k], gravity[k] * frame->maximum[k]};
    depth += gravity[k] * ((from + 0.5 * size) * place->force[0] + size * place->force[1 + k]) -
             fmin(ends[0], ends[1]) * place->force[0];
    range += fabs(ends[1] - ends[0]);
  }
  return depth / range;
}

/* Make three measurements for each pair of points. */
static supine_status make_rows_of_pairs(work *w, const supine_patient_pairs *pairs,
                                        supine_error *error) {
  supine_patient_matching *m = &w->matching;
  m->count = 3 * pairs->count;
  m->rows = supine_arena_take(&m->arena, m->count, sizeof *m->rows);
  SUPINE_TRY(supine_arena_check(&m->arena, error, "the fit to a further state"));
  supine_patient_rows_of_pairs(&w->record->patient.frame, pairs, m->rows);
  return SUPINE_OK;
}

/* Make a measurement for each vertex of `lungs`, for at most VERTICES_MAX vertices. */
static supine_status make_rows_of_surface(work *w, const supine_lungs *lungs,
                                          const supine_mesh *surface, supine_error *error) {
  supine_patient_matching *m = &w->matching;
  SUPINE_TRY(supine_patient_matching_create(lungs, surface, VERTICES_MAX, 0, m, error));
  return supine_patient_matching_set_tissue(m, &w->record->patient.power, &w->record->stiffness,
                                            error);
}

/* Compute w->motion, the displacement and change of force of each measured point. Assign the points
 * of each lung to four jackknife blocks. */
static void find_motion(work *w, const double gravity[3]) {
  supine_patient_matching *m = &w->matching;
  const supine_patient *patient = &w->record->patient;
  const double *g = w->record->state[1].gravity;
  const supine_patient_frame *frame = w->observed == SURFACE ? &m->frame : &patient->frame;
  for (size_t i = 0; i < m->count; ++i) {
    supine_patient_place place = m->rows[i].place;
    const double *columns = place.force;
    const double fitted_depth = 0.5 * columns[0] - g[1] * columns[2] - g[2] * columns[3];
    w->motion[i].force_change = (depth_at(frame, &place, gravity) - fitted_depth) /
                                fmax(force_least, supine_patient_force_at(&patient->power, &place));
    m->rows[i].block = (place.side > 0 ? 4U : 0U) + (place.box[1] > 0.5 ? 2U : 0U) +
                       (place.box[2] > 0.5 ? 1U : 0U);
    if (w->observed == SURFACE && !w->record->from_surface) {
      /* Use the bounding box of the landmarks, because the displacement law was fitted in it. */
      place = supine_patient_find(&patient->frame,
                                  m->fuller->mesh.vertices + 3 * m->match[i].vertex, place.side);
    }
    supine_patient_displacement(patient, &place, 1.0, w->motion[i].u);
    for (size_t k = 0; k < 3; ++k) {
      w->motion[i].u[k] += m->tissue != NULL ? m->tissue[3 * m->match[i].vertex + k] : 0.0;
      w->motion[i].u[k] /= w->state_share[1][k] - w->state_share[0][k];
    }
  }
}

/* Displace the vertices by the model. Match them to the surface of w->matching. */
static supine_status match_surface(work *w, supine_error *error) {
  supine_patient_matching *m = &w->matching;
  for (size_t i = 0; i < m->count; ++i) {
    const double scale =
        w->x[m->rows[i].place.side > 0 ? 0U : 1U] * (1.0 + w->x[GAIN] * w->motion[i].force_change);
    for (size_t k = 0; k < 3; ++k) {
      m->match[i].position[k] = m->fuller->mesh.vertices[3 * m->match[i].vertex + k] +
                                (scale - w->state_share[0][k]) * w->motion[i].u[k] + w->x[2 + k];
    }
  }
  supine_patient_matching_find(m);
  return supine_patient_matching_weigh(m, 0.0, error);
}

/* Match the surfaces and fit w->x (factors, translation and gain) in turn until w->x converges.
 * Then estimate the gain's standard error by the jackknife over 8 blocks of measurements. */
static supine_status iterate(work *w, supine_patient_further *further, supine_error *error) {
  double change = INFINITY;
  double sum = 0.0;
  double square = 0.0;
  for (size_t round = 0; round < ROUNDS && change >= converged; ++round) {
    const double before[UNKNOWNS] = {w->x[0], w->x[1], [GAIN] = w->x[GAIN]};
    if (w->observed == SURFACE) {
      SUPINE_TRY(match_surface(w, error));
    }
    further->residual = fit(w, further->fits_gain, BLOCKS);
    change =
        fabs(w->x[0] - before[0]) + fabs(w->x[1] - before[1]) + fabs(w->x[GAIN] - before[GAIN]);
  }
  SUPINE_REFUSE_IF(
      change >= not_converged, error, SUPINE_ERROR_NUMERICAL,
      "the fit to a scan in another state does not converge (after %d rounds, scales and gain "
      "still change by %.2g): check that all scans have the same axes and show the same person",
      ROUNDS, change);
  memcpy(further->scale, w->x, sizeof further->scale);
  further->gain = w->x[GAIN];
  if (further->fits_gain) {
    for (size_t without = 0; without < BLOCKS; ++without) {
      memcpy(w->x, further->scale, sizeof further->scale);
      (void)fit(w, true, without);
      const double change_of_gain = w->x[GAIN] - further->gain;
      sum += change_of_gain;
      square += change_of_gain * change_of_gain;
    }
  }
  further->residual_without_gain = fit(w, false, BLOCKS);
  further->gain_error = sqrt(fmax(0.0, (BLOCKS - 1.0) / BLOCKS * (square - sum * sum / BLOCKS)));
  return SUPINE_OK;
}

static work begin(observed_kind kind, const supine_patient_record *record, bool scans_moved,
                  supine_patient_further *further) {
  work w = {.record = record, .observed = kind, .fits_translation = scans_moved, .x = {1.0, 1.0}};
  further->fits_gain =
      supine_distance(further->state.gravity, record->state[1].gravity) >= same_posture;
  supine_patient_path(record, w.state_share);
  return w;
}

/* Fit the measurements that were made. */
static supine_status fit_rows(work *w, supine_patient_further *further, supine_error *error) {
  supine_arena *arena = &w->matching.arena;
  w->motion = supine_arena_take(arena, w->matching.count, sizeof *w->motion);
  SUPINE_TRY(supine_arena_check(arena, error, "the fit to a further state"));
  find_motion(w, further->state.gravity);
  return iterate(w, further, error);
}

supine_status supine_patient_gain_fit_landmarks(const supine_patient_record *record,
                                                const supine_patient_pairs *pairs, bool scans_moved,
                                                supine_patient_further *further,
                                                supine_error *error) {
  work w = begin(LANDMARKS, record, scans_moved, further);
  supine_status status = make_rows_of_pairs(&w, pairs, error);
  if (status == SUPINE_OK) {
    status = fit_rows(&w, further, error);
  }
  supine_patient_matching_free(&w.matching);
  return status;
}

supine_status supine_patient_gain_fit_surface(const supine_patient_record *record,
                                              const supine_lungs *fuller,
                                              const supine_mesh *surface, bool scans_moved,
                                              supine_patient_further *further,
                                              supine_error *error) {
  work w = begin(SURFACE, record, scans_moved, further);
  supine_status status = make_rows_of_surface(&w, fuller, surface, error);
  if (status == SUPINE_OK) {
    status = fit_rows(&w, further, error);
  }
  supine_patient_matching_free(&w.matching);
  return status;
}

void supine_patient_gain_set(supine_patient_record *record) {
  double gain = 0.0;
  double precision = 0.0;
  for (size_t k = 0; k < record->further_count; ++k) {
    const supine_patient_further *further = &record->further[k];
    const double weight = further->fits_gain ? pow(fmax(1e-6, further->gain_error), -2.0) : 0.0;
    gain += weight * further->gain;
    precision += weight;
  }
  record->gain_fitted = precision > 0.0;
  if (record->gain_fitted) {
    gain /= precision;
    record->gain_error = pow(precision, -0.5);
    record->gain_undetermined = gain < gain_least || gain > gain_most;
  }
  if (record->gain_fitted && !record->gain_undetermined) {
    record->force = supine_patient_force(&record->patient.power, gain, record->state[1].gravity);
  }
}
