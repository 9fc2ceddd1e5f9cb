/* SPDX-License-Identifier: MIT */
/* Prepare the random field of the expected error, and compute its covariance. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "runtime/doubt.h"
#include "runtime/internal.h"

enum { STATES = SUPINE_DOUBT_STATES_MAX, SWEEPS = 40 };

/* Ratio of the deviation of each axis to the expected error: 4/9 of its square. */
static const double axis_share = 2.0 / 3.0;

size_t supine_doubt_space(size_t state_count) {
  const size_t bytes = sizeof(supine_doubt) + state_count * sizeof(supine_expected_model);
  return (bytes + sizeof(double) - 1) / sizeof(double);
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
  *d = (supine_doubt){
      .basis = task->basis, .state_count = task->state_count, .another_day = task->another_day};
  supine_status status = SUPINE_OK;
  for (size_t s = 0; s < task->state_count && status == SUPINE_OK; ++s) {
    supine_pose pose;
    double unit[2][3] = {{0}};
    status = supine_basis_pose(task->basis, &task->states[s], &pose, error); /* refuses volumes */
    if (status == SUPINE_OK) {
      status =
          supine_expected_prepare(task->basis, &task->states[s], from, 0, 0, &d->model[s], error);
    }
    if (status == SUPINE_OK) { /* both gravities were accepted */
      (void)supine_normalise(task->states[s].gravity, unit[0]);
      (void)supine_normalise(from->gravity, unit[1]);
      supine_subtract(unit[0], unit[1], d->turn[s]);
    }
  }
  if (status == SUPINE_OK) {
    status = correlate(task, from, d, error);
  }
  if (status == SUPINE_OK) {
    *doubt = d;
  }
  return status;
}

void supine_doubt_evaluate(const supine_doubt *d, size_t state, size_t begin, size_t end,
                           supine_doubt_features *features) {
  const supine_expected_model *m = &d->model[state];
  const float *vertices = supine_basis_vertices(d->basis);
  const supine_basis_info *info = supine_basis_get_info(d->basis);
  supine_expected_block block;
  size_t lung = 0;
  supine_expected_evaluate(m, begin, end, &block);
  for (size_t i = 0; i < end - begin; ++i) {
    supine_doubt_features *f = &features[i];
    const double *square = block.square[i];
    while (begin + i >= info->lung_begin[lung + 1]) {
      ++lung;
    }
    memset(f, 0, sizeof *f);
    f->state = state;
    f->lung = lung;
    f->deviation =
        axis_share * sqrt(square[SUPINE_EXPECTED_DISPLACEMENT] + square[SUPINE_EXPECTED_TURN]);
    for (size_t k = 0; k < 3; ++k) {
      const size_t at = 3 * i + k;
      const double reference = (double)vertices[3 * begin + at];
      const double moved[2] = {(double)block.x[EXPECTED_AT][at],
                               (double)block.x[EXPECTED_FROM][at]};
      f->at[k] = reference + moved[0];
      f->place[k] = reference + moved[1];
      if (m->per_step > 0) {
        f->vector[0][k] = m->per_step * ((double)block.x[EXPECTED_FULLER][at] - moved[0] -
                                         (double)block.x[EXPECTED_FULLER_FROM][at] + moved[1]);
      }
      if (k < 2 && m->across > 0) { /* the root of the term is its length across the body */
        f->vector[1][k] = sqrt(square[SUPINE_EXPECTED_HEART]) * d->turn[state][k] / m->across;
      }
    }
    f->vector[2][0] = EXPECTED_SLIDING * d->turn[state][0];
    memcpy(f->vector[3], block.collapse[i], sizeof f->vector[3]);
  }
}

void supine_doubt_evaluate_one(const supine_doubt *doubt, const supine_doubt_point *point,
                               supine_doubt_features *features) {
  supine_doubt_evaluate(doubt, point->state, point->vertex, point->vertex + 1, features);
}

double supine_doubt_kernel(const supine_doubt_features *a, const supine_doubt_features *b) {
  supine_kriging_model unit = supine_kriging_default;
  unit.sill = 3; /* so that a size of 1 has the variance 1 on each axis */
  unit.least = 0;
  return supine_kriging_covariance(&unit, a->place, 1, b->place, 1, a->lung == b->lung);
}

double supine_doubt_day_square(const supine_doubt *d) {
  const double day = axis_share * (d->another_day ? SUPINE_ANOTHER_DAY_MM : 0);
  return day * day;
}

double supine_doubt_isotropic(const supine_doubt *d, const supine_doubt_features *a,
                              const supine_doubt_features *b) {
  double correlation = 0;
  for (size_t k = 0; k < d->state_count; ++k) {
    correlation += d->root[a->state][k] * d->root[b->state][k];
  }
  return (a->deviation * b->deviation * correlation + supine_doubt_day_square(d)) *
         supine_doubt_kernel(a, b);
}

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
  for (size_t i = 0; i < count; ++i) {
    supine_doubt_features a;
    supine_doubt_evaluate_one(doubt, &points[i], &a);
    if (mean != NULL) {
      memcpy(mean + 3 * i, a.at, sizeof a.at);
    }
    for (size_t j = 0; j <= i; ++j) {
      supine_doubt_features b;
      supine_doubt_evaluate_one(doubt, &points[j], &b);
      const double isotropic = supine_doubt_isotropic(doubt, &a, &b);
      for (size_t e = 0; e < 9; ++e) {
        const size_t k = e / 3;
        const size_t l = e % 3;
        double sum = k == l ? isotropic : 0;
        for (size_t v = 0; v < DOUBT_VECTORS; ++v) {
          sum += a.vector[v][k] * b.vector[v][l];
        }
        covariance[(3 * i + k) * 3 * count + 3 * j + l] = sum;
        covariance[(3 * j + l) * 3 * count + 3 * i + k] = sum;
      }
    }
  }
  return SUPINE_OK;
}
