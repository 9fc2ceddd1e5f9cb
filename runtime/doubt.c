/* SPDX-License-Identifier: MIT */
/* Prepare the random field of the expected error, and compute its covariance. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "runtime/doubt.h"
#include "runtime/internal.h"
#include "runtime/lung.h"

enum { STATES = SUPINE_DOUBT_STATES_MAX, SWEEPS = 40 };

/* Ratio of the deviation of each axis to the expected error: 4/9 of its square. */
static const double axis_share = 2.0 / 3.0;

size_t supine_doubt_space(const supine_basis *basis, size_t state_count) {
  const size_t n = basis->landmark_count;
  const size_t seen = supine_space_doubles(sizeof(supine_kriging)) +
                      supine_space_doubles(n * sizeof(supine_kriging_point)) +
                      supine_kriging_space(n);
  return supine_space_doubles(sizeof(supine_doubt) + state_count * sizeof(supine_expected_model)) +
         (n > 0 ? seen : 0);
}

/* Return the sum of the mean squares of the terms displacement and turn from one state to another,
 * mm^2. */
static supine_status mean_square(const supine_basis *basis, const supine_state *state,
                                 const supine_state *from, double *square, supine_error *error) {
  supine_expected_part parts[SUPINE_EXPECTED_TERMS];
  const supine_status status = supine_expected_parts(basis, state, from, parts, error);
  *square = 0;
  if (status == SUPINE_OK) {
    *square =
        pow(parts[SUPINE_EXPECTED_DISPLACEMENT].rms, 2) + pow(parts[SUPINE_EXPECTED_TURN].rms, 2);
  }
  return status;
}

/* Rotate rows and columns p and q of a symmetric matrix so that element (p, q) becomes 0, and the
 * columns of `vectors` likewise. */
static void rotate_pair(size_t n, double (*a)[STATES], double (*vectors)[STATES], size_t p,
                        size_t q) {
  const double angle = 0.5 * atan2(2 * a[p][q], a[q][q] - a[p][p]);
  const double c = cos(angle);
  const double s = sin(angle);
  for (size_t k = 0; k < n; ++k) {
    const double left = a[k][p];
    a[k][p] = c * left - s * a[k][q];
    a[k][q] = s * left + c * a[k][q];
  }
  for (size_t k = 0; k < n; ++k) {
    const double upper = a[p][k];
    const double left = vectors[k][p];
    a[p][k] = c * upper - s * a[q][k];
    a[q][k] = s * upper + c * a[q][k];
    vectors[k][p] = c * left - s * vectors[k][q];
    vectors[k][q] = s * left + c * vectors[k][q];
  }
}

/* Replace a symmetric matrix by a root of it (matrix = root root'), after its negative eigenvalues
 * have been set to 0 and its diagonal to 1, by Jacobi's method. */
static void take_root(size_t n, double (*matrix)[STATES]) {
  double vectors[STATES][STATES] = {{0}};
  for (size_t k = 0; k < n; ++k) {
    vectors[k][k] = 1;
  }
  for (int sweep = 0; sweep < SWEEPS; ++sweep) {
    for (size_t p = 0; p < n; ++p) {
      for (size_t q = p + 1; q < n; ++q) {
        rotate_pair(n, matrix, vectors, p, q);
      }
    }
  }
  double value[STATES];
  for (size_t k = 0; k < n; ++k) {
    value[k] = sqrt(fmax(0, matrix[k][k]));
  }
  for (size_t s = 0; s < n; ++s) {
    double square = 0;
    for (size_t k = 0; k < n; ++k) {
      matrix[s][k] = vectors[s][k] * value[k];
      square += matrix[s][k] * matrix[s][k];
    }
    for (size_t k = 0; k < n; ++k) {
      matrix[s][k] = square > 0 ? matrix[s][k] / sqrt(square) : (double)(s == k);
    }
  }
}

/* Compute the correlations of all states, and their root. */
static supine_status correlate(const supine_doubt_task *task, const supine_state *from,
                               supine_doubt *d, supine_error *error) {
  double own[STATES];
  supine_status status = SUPINE_OK;
  for (size_t s = 0; s < task->state_count && status == SUPINE_OK; ++s) {
    status = mean_square(task->basis, &task->states[s], from, &own[s], error);
    d->root[s][s] = 1;
    for (size_t t = 0; t < s && status == SUPINE_OK; ++t) {
      double between = 0;
      status = mean_square(task->basis, &task->states[s], &task->states[t], &between, error);
      const double scale = 2 * sqrt(own[s] * own[t]);
      const double c = scale > 0 ? (own[s] + own[t] - between) / scale : 0;
      d->root[s][t] = d->root[t][s] = fmax(-1, fmin(1, c));
    }
  }
  if (status == SUPINE_OK) {
    take_root(task->state_count, d->root);
  }
  return status;
}

/* Prepare the errors of each state. */
static supine_status prepare_states(const supine_doubt_task *task, const supine_state *from,
                                    supine_doubt *d, supine_error *error) {
  for (size_t s = 0; s < task->state_count; ++s) {
    supine_pose pose;
    double unit[2][3] = {{0}};
    SUPINE_TRY(supine_basis_pose(task->basis, &task->states[s], &pose, error)); /* judges volumes */
    SUPINE_TRY(
        supine_expected_prepare(task->basis, &task->states[s], from, 0, 0, &d->model[s], error));
    (void)supine_normalise(task->states[s].gravity, unit[0]); /* both were accepted */
    (void)supine_normalise(from->gravity, unit[1]);
    supine_subtract(unit[0], unit[1], d->turn[s]);
  }
  return correlate(task, from, d, error);
}

/* Prepare the errors of located lungs. */
static supine_status prepare_location(const supine_location *found, const supine_state *scan,
                                      supine_doubt *d, supine_error *error) {
  double unit[2][3] = {{0}};
  (void)supine_normalise(found->info.state.gravity, unit[0]);
  (void)supine_normalise(scan->gravity, unit[1]);
  supine_subtract(unit[0], unit[1], d->turn[0]);
  d->root[0][0] = 1;
  d->seen = &found->kriging;
  return supine_expected_prepare(d->basis, &found->info.state, scan, found->deviation,
                                 found->options.model.least, d->model, error);
}

supine_status supine_doubt_prepare(const supine_doubt_task *task, double *space,
                                   const supine_doubt **doubt, supine_error *error) {
  const supine_state scan = supine_basis_scan(task->basis);
  const supine_state *from = task->from != NULL ? task->from : &scan;
  supine_doubt *d = (supine_doubt *)space;
  *doubt = NULL;
  if (task->state_count == 0 || task->state_count > STATES) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "%zu states: give 1 to %d",
                            task->state_count, (int)STATES);
  }
  if (task->location != NULL &&
      (task->state_count > 1 || task->from != NULL || task->another_day)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "located lungs have one state, which counts from the scan, on the day "
                            "of the observations");
  }
  *d = (supine_doubt){.basis = task->basis,
                      .state_count = task->state_count,
                      .another_day = task->another_day,
                      .location = task->location};
  if (task->location != NULL) {
    SUPINE_TRY(prepare_location(task->location, &scan, d, error));
  } else {
    SUPINE_TRY(prepare_states(task, from, d, error));
    const size_t n = task->basis->landmark_count;
    if (n > 0) {
      space += supine_space_doubles(sizeof *d + task->state_count * sizeof *d->model);
      supine_kriging *seen = (supine_kriging *)space;
      space += supine_space_doubles(sizeof *seen);
      supine_kriging_point *points = (supine_kriging_point *)space;
      space += supine_space_doubles(n * sizeof *points);
      SUPINE_TRY(supine_expected_fit_landmarks(task->basis, points, space, seen, error));
      d->seen = seen;
    }
  }
  *doubt = d;
  return SUPINE_OK;
}

/* Divide the error of a vertex into the part of which landmarks show some, and the rest. */
static void share_landmarks(const supine_doubt *d, size_t vertex, const float *reference,
                            const double square[SUPINE_EXPECTED_TERMS], supine_doubt_features *f) {
  const double place[3] = {(double)reference[0], (double)reference[1], (double)reference[2]};
  const double share = d->basis->held_out * (double)d->basis->error_share[vertex];
  f->seen = supine_kriging_landmark(place, f->lung);
  f->deviation = axis_share * sqrt(square[SUPINE_EXPECTED_TURN]);
  f->seen_factor = share > 0 ? axis_share * sqrt(square[SUPINE_EXPECTED_DISPLACEMENT] / share) : 0;
}

/* Fill in what a vertex of located lungs has otherwise. Errors are multiplied as locate states. */
static void follow_location(const supine_location *found, const supine_location_block *block,
                            size_t i, supine_doubt_features *f) {
  const double variance = (double)block->variance[i];
  const double bounded = supine_location_square(found, block, i);
  f->deviation = 0;
  f->seen_factor = variance > 0 ? found->factor * sqrt(bounded / variance) : 0;
  f->seen = (supine_kriging_point){.lung = f->lung, .size = (double)block->size[i]};
  memset(f->vector[0], 0, sizeof f->vector[0]);
  for (size_t k = 0; k < 3; ++k) {
    const size_t at = 3 * i + k;
    f->seen.position[k] = (double)block->scan[at];
    f->seen.volume[k] = found->options.volume ? (double)block->volume[at] : 0;
    f->at[k] += (double)block->shift[at];
    for (size_t v = 1; v < DOUBT_VECTORS; ++v) {
      f->vector[v][k] *= found->factor;
    }
  }
}

/* Compute the features of vertex `begin` + i from the evaluated formula of the expected error. */
static void find_features(const supine_doubt *d, size_t begin, size_t i, const float *reference,
                          const supine_expected_block *block, supine_doubt_features *f) {
  const supine_expected_model *m = &d->model[f->state];
  const double *square = block->square[i];
  f->deviation =
      axis_share * sqrt(square[SUPINE_EXPECTED_DISPLACEMENT] + square[SUPINE_EXPECTED_TURN]);
  for (size_t k = 0; k < 3; ++k) {
    const size_t at = 3 * i + k;
    const double moved[2] = {(double)block->x[EXPECTED_AT][at],
                             (double)block->x[EXPECTED_FROM][at]};
    f->at[k] = (double)reference[k] + moved[0];
    f->place[k] = (double)reference[k] + moved[1];
    if (m->per_step > 0) {
      f->vector[0][k] = m->per_step * ((double)block->x[EXPECTED_FULLER][at] - moved[0] -
                                       (double)block->x[EXPECTED_FULLER_FROM][at] + moved[1]);
    }
    if (k < 2 && m->across > 0) { /* the root of the term is its length across the body */
      f->vector[1][k] = sqrt(square[SUPINE_EXPECTED_HEART]) * d->turn[f->state][k] / m->across;
    }
  }
  f->vector[2][0] = EXPECTED_SLIDING * d->turn[f->state][0];
  memcpy(f->vector[3], block->collapse[i], sizeof f->vector[3]);
  if (d->seen != NULL && d->location == NULL) {
    share_landmarks(d, begin + i, reference, square, f);
  }
}

/* Evaluate vertices begin <= i < end, at most DOUBT_BLOCK, and of one lung for located lungs. */
static void evaluate(const supine_doubt *d, size_t state, size_t begin, size_t end,
                     supine_doubt_features *features) {
  const float *vertices = supine_basis_vertices(d->basis) + 3 * begin;
  const supine_basis_info *info = supine_basis_get_info(d->basis);
  supine_location_block block;
  if (d->location != NULL) {
    supine_location_evaluate(d->location, d->model, supine_basis_lung_of(info, begin), begin, end,
                             &block);
  } else {
    supine_expected_evaluate(&d->model[state], begin, end, &block.formula);
  }
  for (size_t i = 0; i < end - begin; ++i) {
    supine_doubt_features *f = &features[i];
    *f = (supine_doubt_features){.state = state, .lung = supine_basis_lung_of(info, begin + i)};
    find_features(d, begin, i, vertices + 3 * i, &block.formula, f);
    if (d->location != NULL) {
      follow_location(d->location, &block, i, f);
    }
  }
}

void supine_doubt_evaluate_one(const supine_doubt *doubt, const supine_doubt_point *point,
                               supine_doubt_features *features) {
  evaluate(doubt, point->state, point->vertex, point->vertex + 1, features);
}

const supine_doubt_features *supine_doubt_at(supine_doubt_walk *walk, size_t vertex) {
  if (vertex >= walk->last) {
    walk->first = vertex;
    walk->last = walk->end - vertex < DOUBT_BLOCK ? walk->end : vertex + DOUBT_BLOCK;
    evaluate(walk->doubt, walk->state, walk->first, walk->last, walk->features);
  }
  return &walk->features[vertex - walk->first];
}

double supine_doubt_kernel(const double a[3], size_t a_lung, const double b[3], size_t b_lung) {
  supine_kriging_model unit = supine_kriging_default;
  unit.sill = 3; /* so that a size of 1 has the variance 1 on each axis */
  unit.least = 0;
  return supine_kriging_covariance(&unit, a, 1, b, 1, a_lung == b_lung);
}

double supine_doubt_common_square(const supine_doubt *d) {
  const double day = axis_share * (d->another_day ? SUPINE_ANOTHER_DAY_MM : 0);
  return d->location != NULL ? d->location->excess / 3 : day * day;
}

void supine_doubt_whiten(const supine_doubt *doubt, const supine_doubt_features *features,
                         double white[SUPINE_KRIGING_LANDMARKS_MAX]) {
  if (doubt->seen != NULL) {
    supine_kriging_whiten(doubt->seen, &features->seen, white);
  }
}

void supine_doubt_covary(const supine_doubt *d, const supine_doubt_features *a,
                         const double *a_white, const supine_doubt_features *b,
                         const double *b_white, double covariance[9]) {
  double correlation = 0;
  for (size_t k = 0; k < d->state_count; ++k) {
    correlation += d->root[a->state][k] * d->root[b->state][k];
  }
  const double plain = (a->deviation * b->deviation * correlation + supine_doubt_common_square(d)) *
                       supine_doubt_kernel(a->place, a->lung, b->place, b->lung);
  memset(covariance, 0, 9 * sizeof *covariance);
  if (d->seen != NULL) {
    supine_kriging_covary(d->seen, &a->seen, a_white, &b->seen, b_white, covariance);
  }
  for (size_t e = 0; e < 9; ++e) {
    covariance[e] =
        a->seen_factor * b->seen_factor * correlation * covariance[e] + (e % 4 == 0 ? plain : 0);
  }
}

/* What the covariances of a point need. */
typedef struct prepared {
  supine_doubt_features features;
  double *white; /* [observed points] of supine_doubt_whiten */
} prepared;

static void prepare_point(const supine_doubt *d, const supine_doubt_point *point, prepared *p) {
  supine_doubt_evaluate_one(d, point, &p->features);
  supine_doubt_whiten(d, &p->features, p->white);
}

/* Compute the covariance of two points: that of supine_doubt_covary, and the products of their
 * vectors; in the frame of the observations for located lungs. */
static void covary(const supine_doubt *d, const prepared *a, const prepared *b,
                   double covariance[9]) {
  static const double same[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const double *r = d->location != NULL ? d->location->info.rotation : same;
  double body[9];
  supine_doubt_covary(d, &a->features, a->white, &b->features, b->white, body);
  for (size_t e = 0; e < 9 * (size_t)DOUBT_VECTORS; ++e) {
    body[e % 9] += a->features.vector[e / 9][e % 9 / 3] * b->features.vector[e / 9][e % 3];
  }
  memset(covariance, 0, 9 * sizeof *covariance);
  for (size_t e = 0; e < 9 * 9; ++e) { /* R body R' */
    covariance[e / 9] += r[e / 27 * 3 + e % 9 / 3] * body[e % 9] * r[e / 9 % 3 * 3 + e % 3];
  }
}

/* Write the predicted position of a point, in the frame of the observations for located lungs. */
static void predict(const supine_doubt *d, const supine_doubt_features *f, double mean[3]) {
  memcpy(mean, f->at, sizeof f->at);
  if (d->location != NULL) {
    supine_location_move(d->location, f->at, mean);
  }
}

/* Points whose rows are computed together, so that the point of a column is prepared once for all,
 * and the numbers that all their `white` may have: both bound the stack. */
enum { ROWS = 32, WHITES = 4 * SUPINE_KRIGING_LANDMARKS_MAX };

supine_status supine_doubt_covariance(const supine_doubt *doubt, size_t count,
                                      const supine_doubt_point *points, double *mean,
                                      double *covariance, supine_error *error) {
  const size_t n = supine_basis_get_info(doubt->basis)->vertex_count;
  for (size_t i = 0; i < count; ++i) {
    if (points[i].vertex >= n || points[i].state >= doubt->state_count) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "point %zu is vertex %zu in state %zu: give vertices below %zu and "
                              "states below %zu",
                              i + 1, points[i].vertex, points[i].state, n, doubt->state_count);
    }
  }
  prepared row[ROWS];
  double whites[WHITES];
  double white[SUPINE_KRIGING_LANDMARKS_MAX];
  prepared column = {.white = white};
  const size_t seen = doubt->seen != NULL ? doubt->seen->count : 0;
  const size_t rows = ROWS * seen > WHITES ? WHITES / seen : ROWS;
  for (size_t begin = 0; begin < count; begin += rows) {
    const size_t end = count - begin < rows ? count : begin + rows;
    for (size_t i = begin; i < end; ++i) {
      prepared *p = &row[i - begin];
      p->white = whites + (i - begin) * seen;
      prepare_point(doubt, &points[i], p);
      if (mean != NULL) {
        predict(doubt, &p->features, mean + 3 * i);
      }
    }
    for (size_t j = 0; j < end; ++j) {
      prepare_point(doubt, &points[j], &column);
      for (size_t i = j > begin ? j : begin; i < end; ++i) {
        double block[9];
        covary(doubt, &row[i - begin], &column, block);
        for (size_t e = 0; e < 9; ++e) {
          covariance[(3 * i + e / 3) * 3 * count + 3 * j + e % 3] = block[e];
          covariance[(3 * j + e % 3) * 3 * count + 3 * i + e / 3] = block[e];
        }
      }
    }
  }
  return SUPINE_OK;
}
