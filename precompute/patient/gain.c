/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The gain from scans in other postures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <lapacke.h>

#include "precompute/patient/gain.h"

#include "precompute/patient/matching.h"
#include "sh/base/vec3.h"

static const double gain_most = 2.0;
static const double at_bound = 0.01;     /* distance to a bound at which a gain is undetermined */
static const double same_posture = 0.05; /* distance of unit vectors of one posture: 3 degrees */
static const double matched_least = 0.3; /* least share of a surface's vertices that must match */
static const double settled = 1e-4;      /* change of a scale between rounds at which they end */
enum { SEARCH_STEPS = 40, GRID = 20, ROUNDS = 20, VERTICES_MAX = 2000, UNKNOWNS = 4, PARTS = 6 };

/* What is known of one point of a state: axis . (s now / then u + t) = value. */
typedef struct point {
  double u[3];         /* displacement from full inflation to rest in the fitted posture, mm */
  double parts[PARTS]; /* spread forces 1, X, Y, Z and both heights here */
  double axis[3], value, weight;
  size_t block;
} point;

typedef struct state {
  supine_patient_other *other;
  supine_patient_matching matching; /* of a state given as a surface */
  size_t count;
  point *points;
} state;

typedef struct problem {
  const supine_patient_record *record;
  bool moved;
  double gains[2][3]; /* share of the way of the fuller and the emptier state, by axis */
  state *states;
  size_t state_count;
  size_t without_state, without_block; /* left out of the sums; SIZE_MAX: none */
} problem;

/* Scale a displacement between the two states to that from full inflation to rest. */
static void lengthen(const problem *p, double u[3]) {
  for (size_t k = 0; k < 3; ++k) {
    u[k] /= p->gains[1][k] - p->gains[0][k];
  }
}

static double ratio_at(const point *p, const supine_force_law *law) {
  double fixed = law->base * p->parts[0];
  for (size_t k = 0; k < 3; ++k) {
    fixed += law->box[k] * p->parts[1 + k];
  }
  const double then = fixed + law->gain * p->parts[4]; /* (18) */
  return then != 0.0 ? (fixed + law->gain * p->parts[5]) / then : 0.0;
}

/* Find the squared residual of a state at a gain, mm^2, with its best other unknowns. */
static double squares_of(const problem *problem_, size_t which, double gain, double *unknowns,
                         double *weight) {
  const state *s = &problem_->states[which];
  const supine_force_law law =
      supine_patient_force(&problem_->record->patient, gain, problem_->record->state[1].gravity);
  const size_t n = problem_->moved ? UNKNOWNS : 1;
  double matrix[UNKNOWNS * UNKNOWNS] = {0.0};
  double right[UNKNOWNS] = {0.0};
  double squares = 0.0;
  *weight = 0.0;
  for (size_t i = 0; i < s->count; ++i) {
    const point *p = &s->points[i];
    const double along = supine_dot(p->axis, p->u);
    const double row[UNKNOWNS] = {ratio_at(p, &law) * along, p->axis[0], p->axis[1], p->axis[2]};
    double value = p->value;
    for (size_t a = 0; a < 3; ++a) {
      value += problem_->gains[0][a] * p->axis[a] * p->u[a];
    }
    if (which == problem_->without_state && p->block == problem_->without_block) {
      continue;
    }
    for (size_t a = 0; a < n; ++a) {
      for (size_t b = 0; b < n; ++b) {
        matrix[a * n + b] += p->weight * row[a] * row[b];
      }
      right[a] += p->weight * row[a] * value;
    }
    squares += p->weight * value * value;
    *weight += p->weight;
  }
  double solved[UNKNOWNS];
  memcpy(solved, right, sizeof solved);
  memset(unknowns, 0, UNKNOWNS * sizeof *unknowns);
  const lapack_int size = (lapack_int)n;
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', size, 1, matrix, size, solved, size) == 0) {
    memcpy(unknowns, solved, n * sizeof *unknowns);
    for (size_t a = 0; a < n; ++a) {
      squares -= solved[a] * right[a];
    }
  }
  return fmax(0.0, squares);
}

static double squares_at(const problem *p, double gain) {
  double squares = 0.0;
  for (size_t k = 0; k < p->state_count; ++k) {
    double unknowns[UNKNOWNS];
    double weight;
    squares += squares_of(p, k, gain, unknowns, &weight);
  }
  return squares;
}

/* Minimise over a grid of gains, then by golden section between the best one's neighbours. */
static double search(const problem *p) {
  static const double golden = 0.6180339887498949;
  double best = 0.0;
  double least = INFINITY;
  for (int i = 0; i <= GRID; ++i) {
    const double gain = gain_most * i / GRID;
    const double squares = squares_at(p, gain);
    if (squares < least) {
      least = squares;
      best = gain;
    }
  }
  double low = fmax(0.0, best - gain_most / GRID);
  double high = fmin(gain_most, best + gain_most / GRID);
  for (int i = 0; i < SEARCH_STEPS; ++i) {
    const double a = high - golden * (high - low);
    const double b = low + golden * (high - low);
    const bool left = squares_at(p, a) < squares_at(p, b);
    *(left ? &high : &low) = left ? b : a;
  }
  return 0.5 * (low + high);
}

/* Find the range of heights along gravity over the corners of the frame. */
static double frame_height(const supine_patient_frame *frame, const double gravity[3],
                           const supine_patient_place *place) {
  double reach = 0.0;
  double height = 0.5;
  for (int k = 0; k < 3; ++k) {
    reach += fabs(gravity[k]) * (frame->maximum[k] - frame->minimum[k]);
  }
  for (int k = 0; k < 3; ++k) {
    height += gravity[k] * place->arm[k] / reach;
  }
  return height;
}

/* Make three points of each pair, with forces that do not spread. */
static supine_status take_pairs(const problem *p, state *s, supine_error *error) {
  const supine_patient_pairs *pairs = s->other->pairs;
  const supine_patient_frame *frame = &p->record->patient.frame;
  supine_patient_row *rows = malloc(3 * pairs->count * sizeof *rows);
  s->count = 3 * pairs->count;
  s->points = calloc(s->count, sizeof *s->points);
  if (rows == NULL || s->points == NULL) {
    free(rows);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu landmarks",
                            pairs->count);
  }
  supine_patient_rows_of_pairs(frame, pairs, rows);
  (void)supine_patient_rows_block(frame, rows, s->count, 1);
  for (size_t i = 0; i < s->count; ++i) {
    const supine_patient_place *place = &rows[i].place;
    point *to = &s->points[i];
    *to = (point){.value = rows[i].value, .weight = rows[i].weight, .block = rows[i].block};
    memcpy(to->axis, rows[i].axis, sizeof to->axis);
    to->parts[0] = 1.0;
    for (size_t k = 0; k < 3; ++k) {
      to->parts[1 + k] = fmin(1.0, fmax(0.0, place->box[k]));
    }
    to->parts[4] = frame_height(frame, p->record->state[1].gravity, place);
    to->parts[5] = frame_height(frame, s->other->gravity, place);
    supine_patient_displacement(&p->record->patient, pairs->from + 3 * (i / 3), place->side, to->u);
    lengthen(p, to->u);
  }
  free(rows);
  return SUPINE_OK;
}

/* Spread the heights along both gravities: their values at every vertex, [N, 2]. */
static supine_status solve_heights(const problem *p, const state *s, const double *stiffness,
                                   double *caught, supine_error *error) {
  const supine_lungs *rest = s->matching.rest;
  const size_t n = rest->mesh.vertex_count;
  double *heights = malloc(2 * n * sizeof *heights);
  const double *g[2] = {p->record->state[1].gravity, s->other->gravity};
  if (heights == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  for (size_t c = 0; c < 2; ++c) {
    double low;
    double high;
    if (supine_physics_height_range(rest, false, 1, g[c], &low, &high) != SUPINE_OK) {
      free(heights);
      return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for heights");
    }
    for (size_t i = 0; i < n; ++i) {
      const double *at = rest->mesh.vertices + 3 * i;
      heights[2 * i + c] =
          (g[c][0] * at[0] + g[c][1] * at[1] + g[c][2] * at[2] - low) / (high - low);
    }
  }
  supine_status status =
      supine_physics_equilibrium_set_stiffness(s->matching.equilibrium, stiffness, error);
  if (status == SUPINE_OK) {
    status =
        supine_physics_equilibrium_solve(s->matching.equilibrium, 2, heights, caught, NULL, error);
  }
  free(heights);
  return status;
}

/* Gather the vertices that take part and their spread forces. */
static supine_status take_surface(const problem *p, state *s, const supine_lungs *rest,
                                  double reach, supine_error *error) {
  const supine_patient_record *record = p->record;
  const size_t n = rest->mesh.vertex_count;
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  double *stiffness = malloc(n * sizeof *stiffness);
  double *caught = malloc(2 * n * sizeof *caught);
  supine_status status = SUPINE_ERROR_MEMORY;
  model.reach = reach;
  if (stiffness == NULL || caught == NULL) {
    (void)supine_error_set(error, status, "no memory for %zu vertices", n);
  } else {
    supine_patient_stiffness_of(&record->stiffness, rest, stiffness);
    model.stiffness = stiffness;
    status = supine_patient_matching_create(rest, s->other->surface, &model, VERTICES_MAX, 0,
                                            &s->matching, error);
  }
  if (status == SUPINE_OK) {
    status = solve_heights(p, s, stiffness, caught, error);
  }
  s->count = s->matching.count;
  s->points = calloc(s->count + 1, sizeof *s->points);
  if (status == SUPINE_OK && s->points == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", s->count);
  }
  for (size_t i = 0; i < s->count && status == SUPINE_OK; ++i) {
    point *to = &s->points[i];
    const size_t v = s->matching.vertex[i];
    const double *columns = s->matching.rows[i].force; /* of 1, X - 1/2, ... */
    to->parts[0] = columns[0];
    for (size_t k = 0; k < 3; ++k) {
      to->parts[1 + k] = columns[1 + k] + 0.5 * columns[0];
    }
    to->parts[4] = caught[2 * v];
    to->parts[5] = caught[2 * v + 1];
    if (record->from_surface) {
      supine_patient_row_displacement(&record->patient, &s->matching.rows[i], to->u);
    } else { /* the box of the landmarks is wider than the surface's */
      supine_patient_displacement(&record->patient, rest->mesh.vertices + 3 * v,
                                  s->matching.rows[i].place.side, to->u);
    }
    lengthen(p, to->u);
  }
  free(stiffness);
  free(caught);
  return status;
}

/* Find the nearest points, with vertices moved at a gain, a scale and a translation. */
static supine_status match_surface(const problem *p, state *s, double gain, const double *unknowns,
                                   supine_error *error) {
  supine_patient_matching *m = &s->matching;
  const supine_force_law law =
      supine_patient_force(&p->record->patient, gain, p->record->state[1].gravity);
  double rms;
  for (size_t i = 0; i < m->count; ++i) {
    const double ratio = ratio_at(&s->points[i], &law);
    for (size_t k = 0; k < 3; ++k) {
      m->moved[3 * i + k] = m->rest->mesh.vertices[3 * m->vertex[i] + k] +
                            (unknowns[0] * ratio - p->gains[0][k]) * s->points[i].u[k] +
                            unknowns[1 + k];
    }
  }
  supine_patient_matching_find(m);
  const double matched = supine_patient_matching_weigh(m, 0.0, &rms);
  if (matched < matched_least) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "only %.0f %% of the vertices find a further state's surface facing "
                            "the same way: other axes, another person, or triangles inwards",
                            100.0 * matched);
  }
  (void)supine_patient_rows_block(&m->frame, m->rows, m->count, 1);
  for (size_t i = 0; i < m->count; ++i) {
    memcpy(s->points[i].axis, m->rows[i].axis, sizeof s->points[i].axis);
    s->points[i].value = m->rows[i].value;
    s->points[i].weight = m->rows[i].weight;
    s->points[i].block = m->rows[i].block;
  }
  return SUPINE_OK;
}

void supine_patient_refer(const supine_patient *patient, size_t count, double *points) {
  enum { STEPS = 30 };
  for (size_t i = 0; i < count; ++i) {
    double at[3];
    double u[3];
    double motion[3];
    memcpy(at, points + 3 * i, sizeof at);
    for (int step = 0; step < STEPS; ++step) {
      supine_patient_displacement(patient, at, 0.0, u);
      supine_patient_motion(patient, at, motion);
      for (size_t k = 0; k < 3; ++k) {
        at[k] = points[3 * i + k] - u[k] - motion[k];
      }
    }
    memcpy(points + 3 * i, at, sizeof at);
  }
}

/* Alternate between fitting gain and scales, and finding the nearest points. */
static supine_status settle(problem *p, supine_patient_gain *found, supine_error *error) {
  double unknowns[SUPINE_PATIENT_OTHERS_MAX][UNKNOWNS] = {{0.0}};
  supine_status status = SUPINE_OK;
  for (size_t round = 0; round < ROUNDS && status == SUPINE_OK; ++round) {
    double change = 0.0;
    bool surfaces = false;
    for (size_t k = 0; k < p->state_count && status == SUPINE_OK; ++k) {
      if (p->states[k].other->surface != NULL) {
        surfaces = true;
        status = match_surface(p, &p->states[k], found->gain, unknowns[k], error);
      }
    }
    found->gain = found->told ? search(p) : found->gain;
    for (size_t k = 0; k < p->state_count && status == SUPINE_OK; ++k) {
      const double before = unknowns[k][0];
      double weight;
      (void)squares_of(p, k, found->gain, unknowns[k], &weight);
      change = fmax(change, fabs(unknowns[k][0] - before));
    }
    if (!surfaces || change < settled) {
      break;
    }
  }
  return status;
}

/* Find the RMS residual; a landmark has three components. */
static double root_mean(const problem *p, size_t which, double gain) {
  double unknowns[UNKNOWNS];
  double weight;
  const double squares = squares_of(p, which, gain, unknowns, &weight);
  return sqrt(squares * (p->states[which].other->surface == NULL ? 3.0 : 1.0) / weight);
}

static void conclude(problem *p, supine_patient_gain *found) {
  double sum = 0.0;
  double square = 0.0;
  double blocks = 0.0;
  for (size_t k = 0; k < p->state_count; ++k) {
    supine_patient_other *other = p->states[k].other;
    double unknowns[UNKNOWNS];
    double weight;
    (void)squares_of(p, k, found->gain, unknowns, &weight);
    other->scale = unknowns[0];
    other->left = root_mean(p, k, found->gain);
    other->left_without = root_mean(p, k, 0.0);
  }
  for (p->without_state = 0; p->without_state < p->state_count && found->told; ++p->without_state) {
    const state *s = &p->states[p->without_state];
    size_t count = 0;
    for (size_t i = 0; i < s->count; ++i) {
      count = s->points[i].block >= count ? s->points[i].block + 1 : count;
    }
    for (p->without_block = 0; p->without_block < count; ++p->without_block) {
      const double gain = search(p);
      sum += gain;
      square += gain * gain;
      blocks += 1.0;
    }
  }
  found->error =
      blocks > 0.0 ? sqrt(fmax(0.0, (blocks - 1.0) / blocks * (square - sum * sum / blocks))) : 0.0;
}

/* The parameters are the inputs of one person: law, surfaces and landmarks. */
supine_status supine_patient_gain_fit(const supine_patient_record *record, const supine_lungs *rest,
                                      double reach, bool moved, supine_patient_other *others,
                                      size_t count, supine_patient_gain *found,
                                      supine_error *error) {
  state states[SUPINE_PATIENT_OTHERS_MAX] = {{0}};
  problem p = {.record = record,
               .moved = moved,
               .states = states,
               .state_count = count,
               .without_state = SIZE_MAX,
               .without_block = SIZE_MAX};
  supine_status status = SUPINE_OK;

  supine_patient_path(record, p.gains);
  *found = (supine_patient_gain){.gain = record->force.gain};
  for (size_t k = 0; k < count && status == SUPINE_OK; ++k) {
    double apart = 0.0;
    for (int a = 0; a < 3; ++a) {
      apart += pow(others[k].gravity[a] - record->state[1].gravity[a], 2.0);
    }
    found->told = found->told || sqrt(apart) >= same_posture;
    states[k].other = &others[k];
    status = others[k].pairs != NULL ? take_pairs(&p, &states[k], error)
                                     : take_surface(&p, &states[k], rest, reach, error);
  }
  if (status == SUPINE_OK) {
    status = settle(&p, found, error);
  }
  if (status == SUPINE_OK) {
    conclude(&p, found);
    found->open = found->told && (found->gain < at_bound || found->gain > gain_most - at_bound);
    found->gain = found->open ? record->force.gain : found->gain;
  }
  for (size_t k = 0; k < count; ++k) {
    supine_patient_matching_free(&states[k].matching);
    free(states[k].points);
  }
  return status;
}
