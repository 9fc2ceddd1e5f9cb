/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit the gain to scans in other postures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "precompute/patient/matching.h"
#include "sh/base/vec3.h"

static const double gain_most = 2.0;     /* largest gain of the search */
static const double at_bound = 0.01;     /* distance to a bound at which a gain is undetermined */
static const double same_posture = 0.05; /* distance of unit vectors of one posture: 3 degrees */
static const double matched_least = 0.3; /* least share of a surface's vertices that must match */
static const double settled = 1e-4;      /* change of a scale between rounds at which they end */
enum { SEARCH_STEPS = 40, ROUNDS = 20, VERTICES_MAX = 2000, UNKNOWNS = 4, EIGHTHS = 8 };

/* A further state as rows, axis . (s (now / then) u + t) = value, with now / then of ratio_at. */
typedef struct state {
  supine_patient_told *told;
  supine_patient_matching matching; /* of a state given as a surface */
  size_t count;
  supine_patient_row *rows; /* [count]; block: the eighth of the lungs */
  double *u;                /* [count, 3] from full inflation to rest in the fitted posture, mm */
  double *heights; /* [count, 2] spread heights, 0 to 1, in the fitted posture and this one */
  double unknowns[UNKNOWNS]; /* s, t */
  double weight;             /* sum over the rows */
} state;

typedef struct problem {
  supine_patient_record *record;
  bool moved;
  double gains[2][3]; /* part of the way from full inflation to rest of the fuller and the
                         emptier state, by axis */
  state states[SUPINE_PATIENT_OTHERS_MAX];
  size_t state_count;
  size_t without; /* the eighth that is left out; EIGHTHS: none */
} problem;

/* Compute now / then: the force (18) in this posture over that in the fitted one. */
static double ratio_at(const state *s, size_t i, const supine_force_law *law) {
  const double *columns = s->rows[i].place.force;
  double fixed = law->base * columns[0];
  for (size_t k = 0; k < 3; ++k) {
    fixed += law->box[k] * (columns[1 + k] + 0.5 * columns[0]);
  }
  const double then = fixed + law->gain * s->heights[2 * i];
  return then != 0.0 ? (fixed + law->gain * s->heights[2 * i + 1]) / then : 0.0;
}

/* Fit the other unknowns of a state at a gain; return its squared residual, mm^2. */
static double fit_state(const problem *p, state *s, double gain) {
  const supine_force_law law =
      supine_patient_force(&p->record->patient.power, gain, p->record->state[1].gravity);
  const lapack_int n = p->moved ? UNKNOWNS : 1;
  double matrix[UNKNOWNS * UNKNOWNS] = {0.0};
  double right[UNKNOWNS] = {0.0};
  double squares = 0.0;
  s->weight = 0.0;
  for (size_t i = 0; i < s->count; ++i) {
    const double *axis = s->rows[i].axis;
    const double *u = s->u + 3 * i;
    const double row[UNKNOWNS] = {ratio_at(s, i, &law) * supine_dot(axis, u), axis[0], axis[1],
                                  axis[2]};
    const double w = s->rows[i].block == p->without ? 0.0 : s->rows[i].weight;
    double value = s->rows[i].value; /* from full inflation */
    for (size_t a = 0; a < 3; ++a) {
      value += p->gains[0][a] * axis[a] * u[a];
    }
    cblas_dsyr(CblasColMajor, CblasUpper, n, w, row, 1, matrix, n);
    cblas_daxpy(n, w * value, row, 1, right, 1);
    squares += w * value * value;
    s->weight += w;
  }
  memset(s->unknowns, 0, sizeof s->unknowns);
  cblas_dcopy(n, right, 1, s->unknowns, 1);
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', n, 1, matrix, n, s->unknowns, n) != 0) {
    memset(s->unknowns, 0, sizeof s->unknowns);
  }
  return fmax(0.0, squares - cblas_ddot(n, s->unknowns, 1, right, 1));
}

static double squares_at(problem *p, double gain) {
  double squares = 0.0;
  for (size_t k = 0; k < p->state_count; ++k) {
    squares += fit_state(p, &p->states[k], gain);
  }
  return squares;
}

/* Minimise over the gain by golden section: `now / then` is all but linear in it. */
static double search(problem *p) {
  static const double golden = 0.6180339887498949;
  double low = 0.0;
  double high = gain_most;
  for (int i = 0; i < SEARCH_STEPS; ++i) {
    const double a = high - golden * (high - low);
    const double b = low + golden * (high - low);
    const bool left = squares_at(p, a) < squares_at(p, b);
    *(left ? &high : &low) = left ? b : a;
  }
  return 0.5 * (low + high);
}

/* Compute the height of a row along gravity from the spread columns of the force: coordinates are
 * linear in box coordinates. */
static double height_at(const supine_patient_frame *frame, const supine_patient_place *place,
                        const double gravity[3], const double range[2]) {
  const double outer = place->side > 0.0 ? frame->maximum[0] : frame->minimum[0];
  double height = -range[0] * place->force[0];
  for (int k = 0; k < 3; ++k) {
    const double from = k == 0 ? frame->midline : frame->maximum[k];
    const double size = (k == 0 ? outer : frame->minimum[k]) - from;
    height += gravity[k] * ((from + 0.5 * size) * place->force[0] + size * place->force[1 + k]);
  }
  return height / (range[1] - range[0]);
}

/* Find the range of heights along gravity, mm: of the lungs, or of the box of landmarks. */
static supine_status find_range(const problem *p, const state *s, const double gravity[3],
                                double range[2], supine_error *error) {
  const supine_patient_frame *frame = &p->record->patient.frame;
  if (s->told->surface != NULL) {
    return supine_physics_height_range(s->matching.rest, false, 1, gravity, range, range + 1) ==
                   SUPINE_OK
               ? SUPINE_OK
               : supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for heights");
  }
  range[0] = range[1] = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double ends[2] = {gravity[k] * frame->minimum[k], gravity[k] * frame->maximum[k]};
    range[0] += fmin(ends[0], ends[1]);
    range[1] += fmax(ends[0], ends[1]);
  }
  return SUPINE_OK;
}

/* Make the rows of a state: three for each pair, whose force is not spread, or one for each vertex
 * of `rest` that takes part. */
static supine_status take_rows(const problem *p, state *s, const supine_lungs *rest,
                               supine_error *error) {
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  const supine_patient_pairs *pairs = s->told->pairs;
  double *stiffness = NULL;
  supine_status status = SUPINE_OK;
  model.reach = p->record->reach;
  if (pairs != NULL) {
    s->count = 3 * pairs->count;
    s->rows = malloc(s->count * sizeof *s->rows);
  } else {
    stiffness = malloc(rest->mesh.vertex_count * sizeof *stiffness);
    if (stiffness != NULL) {
      supine_patient_stiffness_of(&p->record->stiffness, rest, stiffness);
      model.stiffness = stiffness;
      status = supine_patient_matching_create(rest, s->told->surface, &model, VERTICES_MAX, 0,
                                              &s->matching, error);
    }
    s->count = s->matching.count;
    s->rows = s->matching.rows;
  }
  s->u = malloc(3 * s->count * sizeof *s->u);
  s->heights = malloc(2 * s->count * sizeof *s->heights);
  if (status == SUPINE_OK && (s->rows == NULL || s->u == NULL || s->heights == NULL)) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for a further state");
  } else if (status == SUPINE_OK && pairs != NULL) {
    supine_patient_rows_of_pairs(&p->record->patient.frame, pairs, s->rows);
  }
  free(stiffness);
  return status;
}

/* Set up a state: rows, fitted displacements and heights. */
static supine_status begin(const problem *p, state *s, const supine_lungs *rest,
                           supine_error *error) {
  const supine_patient *patient = &p->record->patient;
  const double *g[2] = {p->record->state[1].gravity, s->told->state.gravity};
  double range[2][2];
  supine_status status = take_rows(p, s, rest, error);
  for (int c = 0; c < 2 && status == SUPINE_OK; ++c) {
    status = find_range(p, s, g[c], range[c], error);
  }
  for (size_t i = 0; i < s->count && status == SUPINE_OK; ++i) {
    supine_patient_place place = s->rows[i].place;
    const supine_patient_frame *frame =
        s->told->surface != NULL ? &s->matching.frame : &patient->frame;
    for (size_t c = 0; c < 2; ++c) {
      s->heights[2 * i + c] = height_at(frame, &place, g[c], range[c]);
    }
    s->rows[i].block = (place.side > 0.0 ? 4U : 0U) + (place.box[1] > 0.5 ? 2U : 0U) +
                       (place.box[2] > 0.5 ? 1U : 0U);
    if (s->told->surface != NULL && !p->record->from_surface) {
      /* the box of the landmarks is wider than the surface's */
      place = supine_patient_find(&patient->frame, rest->mesh.vertices + 3 * s->matching.vertex[i],
                                  place.side);
    }
    supine_patient_displacement(patient, &place, 1.0, s->u + 3 * i);
    for (size_t k = 0; k < 3; ++k) { /* scale to the way from full inflation to rest */
      s->u[3 * i + k] /= p->gains[1][k] - p->gains[0][k];
    }
  }
  return status;
}

/* Find the nearest points, with vertices moved at a gain, a scale and a translation. */
static supine_status match_surface(const problem *p, state *s, double gain, supine_error *error) {
  supine_patient_matching *m = &s->matching;
  const supine_force_law law =
      supine_patient_force(&p->record->patient.power, gain, p->record->state[1].gravity);
  double rms;
  for (size_t i = 0; i < m->count; ++i) {
    const double ratio = ratio_at(s, i, &law);
    for (size_t k = 0; k < 3; ++k) {
      m->moved[3 * i + k] = m->rest->mesh.vertices[3 * m->vertex[i] + k] +
                            (s->unknowns[0] * ratio - p->gains[0][k]) * s->u[3 * i + k] +
                            s->unknowns[1 + k];
    }
  }
  supine_patient_matching_find(m);
  const double matched = supine_patient_matching_weigh(m, 0.0, &rms);
  return matched >= matched_least
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_MESH,
                                "only %.0f %% of the vertices find a further state's surface "
                                "facing the same way: check that axes and person are the same, "
                                "and that no triangles face inwards",
                                100.0 * matched);
}

void supine_patient_refer(const supine_patient *patient, size_t count, double *points) {
  for (size_t i = 0; i < count; ++i) {
    double u[3];
    const double point[3] = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
    supine_patient_settle(patient, point, 0.0, 1.0, points + 3 * i, u);
  }
}

/* Alternate between fitting gain and scales, and finding the nearest points. */
static supine_status settle(problem *p, double *gain, supine_error *error) {
  supine_status status = SUPINE_OK;
  double change = INFINITY;
  for (size_t round = 0; round < ROUNDS && status == SUPINE_OK && change >= settled; ++round) {
    double before[SUPINE_PATIENT_OTHERS_MAX];
    change = 0.0;
    for (size_t k = 0; k < p->state_count && status == SUPINE_OK; ++k) {
      before[k] = p->states[k].unknowns[0];
      status = p->states[k].told->surface == NULL ? SUPINE_OK
                                                  : match_surface(p, &p->states[k], *gain, error);
    }
    *gain = p->record->gain_told ? search(p) : *gain;
    (void)squares_at(p, *gain);
    for (size_t k = 0; k < p->state_count && status == SUPINE_OK; ++k) {
      change = fmax(change, fabs(p->states[k].unknowns[0] - before[k]));
    }
  }
  return status;
}

static void conclude(problem *p, double gain) {
  double sum = 0.0;
  double square = 0.0;
  for (size_t k = 0; k < p->state_count; ++k) {
    state *s = &p->states[k];
    const double components = s->told->surface == NULL ? 3.0 : 1.0;
    s->told->left_without = sqrt(fit_state(p, s, 0.0) * components / s->weight);
    s->told->left = sqrt(fit_state(p, s, gain) * components / s->weight);
    s->told->scale = s->unknowns[0];
  }
  for (p->without = 0; p->without < EIGHTHS && p->record->gain_told; ++p->without) {
    const double other = search(p);
    sum += other;
    square += other * other;
  }
  p->record->gain_error =
      sqrt(fmax(0.0, (EIGHTHS - 1.0) / EIGHTHS * (square - sum * sum / EIGHTHS)));
}

supine_status supine_patient_gain_fit(supine_patient_record *record, const supine_lungs *rest,
                                      bool moved, supine_error *error) {
  problem p = {.record = record, .moved = moved, .without = EIGHTHS};
  const double *g = record->state[1].gravity;
  double gain = record->force.gain;
  supine_status status = SUPINE_OK;
  supine_patient_path(record, p.gains);
  record->gain_told = false;
  for (size_t k = 0; k < record->told_count && status == SUPINE_OK; ++k) {
    state *s = &p.states[p.state_count++];
    s->told = &record->told[k];
    record->gain_told =
        record->gain_told || supine_distance(s->told->state.gravity, g) >= same_posture;
    status = begin(&p, s, rest, error);
  }
  if (status == SUPINE_OK) {
    status = settle(&p, &gain, error);
  }
  if (status == SUPINE_OK) {
    conclude(&p, gain);
    record->gain_open = record->gain_told && (gain < at_bound || gain > gain_most - at_bound);
    if (!record->gain_open) {
      record->force = supine_patient_force(&record->patient.power, gain, g);
    }
  }
  for (size_t k = 0; k < p.state_count; ++k) {
    if (p.states[k].told->surface == NULL) {
      free(p.states[k].rows);
    }
    supine_patient_matching_free(&p.states[k].matching);
    free(p.states[k].u);
    free(p.states[k].heights);
  }
  return status;
}
