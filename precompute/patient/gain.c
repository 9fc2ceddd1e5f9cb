/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit the gain to scans in other postures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "precompute/patient/matching.h"
#include "sh/base/vec3.h"

static const double gain_least = 0.01, gain_most = 2.0; /* other gains count as undetermined */
static const double same_posture = 0.05; /* distance of unit vectors of one posture: 3 degrees */
static const double settled = 1e-4;    /* change of the scales and the gain that ends the rounds */
static const double unsettled = 1e-2;  /* change in the last round that is an error */
static const double force_least = 0.2; /* least fitted force, relative to its mean of 1 */
enum { ROUNDS = 100, VERTICES_MAX = 2000, EIGHTHS = 8, GAIN = 5, UNKNOWNS = 6 };

/* The fitted displacement at a row. */
typedef struct field {
  double u[3];   /* from full inflation to rest in the fitted posture, mm */
  double turned; /* relative change of the force by the further state's posture, at a gain of 1 */
} field;

/* A further state as rows, axis . (s (1 + gain turned) u + t) = value, with a scale s for each
 * lung, as each has its own volume in the further posture. */
typedef struct work {
  const supine_patient_record *record;
  const supine_mesh *surface;       /* NULL: the state is points */
  bool moved;                       /* whether t is fitted */
  double gains[2][3];               /* part of the way from full inflation to rest of the fuller and
                                     * the emptier state, by axis */
  supine_patient_matching matching; /* rows, whose blocks are eighths of the lungs; matches */
  field *field;                     /* [rows] */
  double x[UNKNOWNS];               /* s of the left and the right lung, t, gain */
} work;

/* Fit the unknowns by linear least squares about the present scales without one eighth of the lungs
 * (EIGHTHS: with all); return the RMS residual, mm. */
static double fit(work *w, bool fits_gain, size_t without) {
  double matrix[UNKNOWNS * UNKNOWNS] = {0.0};
  double right[UNKNOWNS] = {0.0};
  const double scale[2] = {w->x[0], w->x[1]};
  double squares = 0.0;
  double weights = 0.0;
  for (size_t i = 0; i < w->matching.count; ++i) {
    const supine_patient_row *row = &w->matching.rows[i];
    const double weight = row->block == without ? 0.0 : row->weight;
    const double along = supine_dot(row->axis, w->field[i].u);
    const size_t lung = row->place.side > 0.0 ? 0U : 1U;
    double x[UNKNOWNS] = {0.0};
    x[lung] = along;
    x[GAIN] = fits_gain ? scale[lung] * w->field[i].turned * along : 0.0;
    double value = row->value; /* displacement from full inflation, mm */
    for (size_t a = 0; a < 3; ++a) {
      x[2 + a] = w->moved ? row->axis[a] : 0.0;
      value += w->gains[0][a] * row->axis[a] * w->field[i].u[a];
    }
    cblas_dsyr(CblasColMajor, CblasUpper, UNKNOWNS, weight, x, 1, matrix, UNKNOWNS);
    cblas_daxpy(UNKNOWNS, weight * value, x, 1, right, 1);
    squares += weight * value * value;
    weights += weight;
  }
  memcpy(w->x, right, sizeof right);
  for (size_t t = 0; t < UNKNOWNS; ++t) { /* an unknown that is not fitted is 0 */
    matrix[t * UNKNOWNS + t] += matrix[t * UNKNOWNS + t] == 0.0 ? 1.0 : 0.0;
  }
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', UNKNOWNS, 1, matrix, UNKNOWNS, w->x, UNKNOWNS) != 0) {
    memset(w->x, 0, sizeof w->x);
  }
  squares = fmax(0.0, squares - cblas_ddot(UNKNOWNS, w->x, 1, right, 1));
  return sqrt(squares * (w->surface == NULL ? 3.0 : 1.0) / weights);
}

/* Compute the height of a row along gravity over the box, 0 to 1, from the spread columns of the
 * force: coordinates are linear in box coordinates. */
static double height_at(const supine_patient_frame *frame, const supine_patient_place *place,
                        const double gravity[3]) {
  const double outer = place->side > 0.0 ? frame->maximum[0] : frame->minimum[0];
  double height = 0.0;
  double range = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double from = k == 0 ? frame->midline : frame->maximum[k];
    const double size = (k == 0 ? outer : frame->minimum[k]) - from;
    const double ends[2] = {gravity[k] * frame->minimum[k], gravity[k] * frame->maximum[k]};
    height += gravity[k] * ((from + 0.5 * size) * place->force[0] + size * place->force[1 + k]) -
              fmin(ends[0], ends[1]) * place->force[0];
    range += fabs(ends[1] - ends[0]);
  }
  return height / range;
}

/* Make the rows: three for each pair, whose force is not spread, or one for each vertex of `rest`
 * that takes part. */
static supine_status take_rows(work *w, const supine_lungs *rest, const supine_patient_pairs *pairs,
                               supine_error *error) {
  supine_status status = SUPINE_OK;
  if (pairs != NULL) {
    w->matching.count = 3 * pairs->count;
    w->matching.rows = malloc(w->matching.count * sizeof *w->matching.rows);
  } else {
    status = supine_patient_matching_create(rest, w->surface, &w->record->stiffness, VERTICES_MAX,
                                            0, &w->matching, error);
  }
  w->field = malloc(w->matching.count * sizeof *w->field);
  if (status == SUPINE_OK && (w->matching.rows == NULL || w->field == NULL)) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for a further state");
  } else if (status == SUPINE_OK && pairs != NULL) {
    supine_patient_rows_of_pairs(&w->record->patient.frame, pairs, w->matching.rows);
  }
  return status;
}

/* Find the fitted displacement of each row, and the change of the force. */
static void find_motion(work *w, const supine_lungs *rest, const double gravity[3]) {
  const supine_patient *patient = &w->record->patient;
  const double *g = w->record->state[1].gravity;
  const supine_patient_frame *frame = w->surface != NULL ? &w->matching.frame : &patient->frame;
  for (size_t i = 0; i < w->matching.count; ++i) {
    supine_patient_place place = w->matching.rows[i].place;
    const double *columns = place.force;
    const double then = 0.5 * columns[0] - g[1] * columns[2] - g[2] * columns[3];
    w->field[i].turned = (height_at(frame, &place, gravity) - then) /
                         fmax(force_least, supine_patient_force_at(&patient->power, &place));
    w->matching.rows[i].block = (place.side > 0.0 ? 4U : 0U) + (place.box[1] > 0.5 ? 2U : 0U) +
                                (place.box[2] > 0.5 ? 1U : 0U);
    if (w->surface != NULL && !w->record->from_surface) {
      /* the landmarks' box is wider than the surface's */
      place = supine_patient_find(
          &patient->frame, rest->mesh.vertices + 3 * w->matching.match[i].vertex, place.side);
    }
    supine_patient_displacement(patient, &place, 1.0, w->field[i].u);
    for (size_t k = 0; k < 3; ++k) { /* scale to the way from full inflation to rest */
      w->field[i].u[k] /= w->gains[1][k] - w->gains[0][k];
    }
  }
}

/* Find the nearest points of the surface, with vertices moved by the unknowns. */
static supine_status match_surface(work *w, supine_error *error) {
  supine_patient_matching *m = &w->matching;
  for (size_t i = 0; i < m->count; ++i) {
    const double scale =
        w->x[m->rows[i].place.side > 0.0 ? 0U : 1U] * (1.0 + w->x[GAIN] * w->field[i].turned);
    for (size_t k = 0; k < 3; ++k) {
      m->match[i].moved[k] = m->rest->mesh.vertices[3 * m->match[i].vertex + k] +
                             (scale - w->gains[0][k]) * w->field[i].u[k] + w->x[2 + k];
    }
  }
  supine_patient_matching_find(m);
  return supine_patient_matching_weigh(m, 0.0, error);
}

/* Alternate between finding the nearest points and the fit, then measure the gain's error. */
static supine_status settle(work *w, supine_patient_further *further, supine_error *error) {
  supine_status status = SUPINE_OK;
  double change = INFINITY;
  double sum = 0.0;
  double square = 0.0;
  for (size_t round = 0; round < ROUNDS && status == SUPINE_OK && change >= settled; ++round) {
    const double before[UNKNOWNS] = {w->x[0], w->x[1], [GAIN] = w->x[GAIN]};
    status = w->surface == NULL ? SUPINE_OK : match_surface(w, error);
    further->residual = fit(w, further->fits_gain, EIGHTHS);
    change =
        fabs(w->x[0] - before[0]) + fabs(w->x[1] - before[1]) + fabs(w->x[GAIN] - before[GAIN]);
  }
  if (status == SUPINE_OK && change >= unsettled) {
    status = supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                              "a further state does not settle: after %d rounds its gain still "
                              "changes by %.2g. Check that axes and person are the same",
                              ROUNDS, change);
  }
  memcpy(further->scale, w->x, sizeof further->scale);
  further->gain = w->x[GAIN];
  for (size_t without = 0; without < EIGHTHS && further->fits_gain; ++without) {
    (void)fit(w, true, without);
    const double change_of_gain = w->x[GAIN] - further->gain;
    sum += change_of_gain;
    square += change_of_gain * change_of_gain;
  }
  further->residual_without_gain = fit(w, false, EIGHTHS);
  further->gain_error = sqrt(fmax(0.0, (EIGHTHS - 1.0) / EIGHTHS * (square - sum * sum / EIGHTHS)));
  return status;
}

supine_status supine_patient_gain_fit(const supine_patient_record *record, const supine_lungs *rest,
                                      const supine_patient_pairs *pairs, const supine_mesh *surface,
                                      bool moved, supine_patient_further *further,
                                      supine_error *error) {
  work w = {.record = record, .surface = surface, .moved = moved, .x = {1.0, 1.0}};
  further->fits_gain =
      supine_distance(further->state.gravity, record->state[1].gravity) >= same_posture;
  supine_patient_path(record, w.gains);
  supine_status status = take_rows(&w, rest, pairs, error);
  if (status == SUPINE_OK) {
    find_motion(&w, rest, further->state.gravity);
    status = settle(&w, further, error);
  }
  supine_patient_matching_free(&w.matching);
  free(w.field);
  return status;
}

void supine_patient_gain_take(supine_patient_record *record) {
  double gain = 0.0;
  double precision = 0.0;
  for (size_t k = 0; k < record->further_count; ++k) {
    const supine_patient_further *further = &record->further[k];
    const double weight = further->fits_gain ? pow(fmax(1e-6, further->gain_error), -2.0) : 0.0;
    gain += weight * further->gain;
    precision += weight;
  }
  if (precision > 0.0) {
    gain /= precision;
    record->gain_error = pow(precision, -0.5);
    record->gain_open = gain < gain_least || gain > gain_most;
  }
  if (precision > 0.0 && !record->gain_open) {
    record->force = supine_patient_force(&record->patient.power, gain, record->state[1].gravity);
  }
}
