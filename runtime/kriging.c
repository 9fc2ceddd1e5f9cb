/* SPDX-License-Identifier: MIT */
/* Fit translation, volume, rotation and a random field to the residuals of observed points. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "runtime/kriging.h"

enum { ONE = 0, VOLUME = 1, PLACE = 4, VALUE = 7, TERMS = SUPINE_KRIGING_TERMS };

const supine_kriging_model supine_kriging_default = {
    .sill = 6.0, .length = 90.0, .across = 1.0 / 3.0, .least = 2.0};

size_t supine_kriging_space(size_t count) {
  return count * (2 * count + SUPINE_KRIGING_COLUMNS + 3 + TERMS + 2);
}

/* Compute the mean position of the points. Fill in supine_kriging.whitened: regressors and
 * residuals, multiplied by the inverse Cholesky factor of the covariance matrix of the points. */
static void whiten(supine_kriging *fit) {
  const size_t n = fit->count;
  memset(fit->centre, 0, sizeof fit->centre);
  for (size_t j = 0; j < n; ++j) {
    for (size_t i = 0; i < 3; ++i) {
      fit->centre[i] += fit->points[j].position[i] / (double)n;
    }
  }
  for (size_t j = 0; j < n; ++j) {
    const supine_kriging_point *p = &fit->points[j];
    fit->whitened[ONE * n + j] = 1;
    for (size_t i = 0; i < 3; ++i) {
      fit->whitened[(VOLUME + i) * n + j] = p->volume[i];
      fit->whitened[(PLACE + i) * n + j] = p->position[i] - fit->centre[i];
      fit->whitened[(VALUE + i) * n + j] = p->residual[i];
    }
  }
  for (size_t c = 0; c < SUPINE_KRIGING_COLUMNS; ++c) {
    supine_kriging_forward(n, fit->factor, fit->whitened + c * n);
  }
}

static bool is_known(const supine_kriging_options *options, size_t term) {
  return options->field_only || (term == 3 ? !options->volume : term > 3 && !options->rotation);
}

/* Return the inverse of the prior variance of a term, or 0 if it has no prior. Write its prior
 * mean.
 */
static double prior_of(const supine_kriging_options *options, size_t term, double *mean) {
  const double deviation = term > 3 && options->rotation ? options->rotation_deviation : 0;
  *mean = 0;
  if (term == 3) {
    *mean = options->volume_mean;
  } else if (term > 3) {
    *mean = options->rotation_mean[term - 4];
  }
  if (term == 3 && options->volume) {
    return 1;
  }
  return deviation > 0 ? 1 / (deviation * deviation) : 0;
}

/* Add the prior of the translation along an axis to the normal equations. */
static void add_axis(const supine_kriging_options *options, double a[TERMS * TERMS],
                     double right[TERMS]) {
  const double deviation = options->axis_deviation;
  if (deviation > 0) {
    for (size_t k = 0; k < 3; ++k) {
      const double precise = options->axis[k] / (deviation * deviation);
      right[k] += precise * options->axis_mean;
      for (size_t l = 0; l <= k; ++l) {
        a[k * TERMS + l] += precise * options->axis[l];
      }
    }
  }
}

/* Compute A and the right side of the normal equations for the fitted terms: translation, volume
 * and rotation.
 *
 *     A = X' K^-1 X + P        right = X' K^-1 y + P m
 *
 *     X  what each term, if it is 1, adds to each coordinate of each point
 *     K  covariance matrix of the coordinates of the points
 *     y  residuals: observed minus predicted coordinates of the points
 *     P  inverse covariance of the prior of the terms (prior_of, add_axis)
 *     m  mean of the prior
 *
 * Positions along the lines of points, if there are any, are eliminated (supine_kriging.along). If
 * a term is not fitted, its row of A is a row of the identity. */
static void normal_equations(const supine_kriging *fit, const supine_kriging_options *options,
                             double a[TERMS * TERMS], double right[TERMS]) {
  const size_t n = fit->count;
  memset(a, 0, TERMS * TERMS * sizeof *a);
  for (size_t k = 0; k < TERMS; ++k) {
    double mean = 0;
    const double precision = prior_of(options, k, &mean);
    right[k] = precision * mean;
    if (is_known(options, k)) {
      a[k * TERMS + k] = 1;
      continue;
    }
    a[k * TERMS + k] = precision;
    for (size_t axis = 0; axis < 3; ++axis) {
      double sign = 0;
      const double *x = fit->whitened + (size_t)supine_kriging_column(k, axis, &sign) * n;
      right[k] += sign * supine_dot_n(n, x, fit->whitened + (VALUE + axis) * n);
      for (size_t l = 0; l <= k; ++l) {
        double other = 0;
        const double *z = fit->whitened + (size_t)supine_kriging_column(l, axis, &other) * n;
        a[k * TERMS + l] += is_known(options, l) ? 0 : sign * other * supine_dot_n(n, x, z);
      }
    }
    if (fit->lines != NULL) {
      const double *seen = fit->along + k * n;
      right[k] -= supine_dot_n(n, seen, fit->along + TERMS * n);
      for (size_t l = 0; l <= k; ++l) {
        a[k * TERMS + l] -= is_known(options, l) ? 0 : supine_dot_n(n, seen, fit->along + l * n);
      }
    }
  }
  add_axis(options, a, right);
}

/* Return whether the points determine all fitted terms. They do if each pivot of `factor`, the
 * Cholesky factor of `a`, exceeds the rounding error of this pivot. */
static bool determined(const double a[TERMS * TERMS], const double factor[TERMS * TERMS]) {
  for (size_t k = 0; k < TERMS; ++k) {
    const double pivot = factor[k * TERMS + k];
    if (!(pivot * pivot > 1e-9 * a[k * TERMS + k])) {
      return false;
    }
  }
  return true;
}

/* Solve the normal equations for supine_kriging.terms. Compute their covariance, and
 * supine_kriging.spread, the same covariance for the columns of supine_kriging.whitened. */
static void solve_terms(supine_kriging *fit, const supine_kriging_options *options,
                        const double factor[TERMS * TERMS], const double right[TERMS]) {
  double inverse[TERMS][TERMS];
  for (size_t k = 0; k < TERMS; ++k) {
    memset(inverse[k], 0, sizeof inverse[k]);
    inverse[k][k] = 1;
    supine_kriging_forward(TERMS, factor, inverse[k]);
  }
  memset(fit->terms, 0, sizeof fit->terms);
  memset(fit->spread, 0, sizeof fit->spread);
  for (size_t k = 0; k < TERMS; ++k) {
    for (size_t l = 0; l < TERMS; ++l) {
      const double c = is_known(options, k) || is_known(options, l)
                           ? 0
                           : supine_dot_n(TERMS, inverse[k], inverse[l]);
      fit->covariance[k][l] = c;
      fit->terms[k] += c * right[l];
      for (size_t axis = 0; axis < 3; ++axis) {
        double one = 0;
        double other = 0;
        const int from = supine_kriging_column(k, axis, &one);
        const int to = supine_kriging_column(l, axis, &other);
        fit->spread[from][to] += one * other * c;
      }
    }
  }
}

static supine_status refuse_covariance(supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                          "the points' covariance is not positive definite: give each point "
                          "a noise above 0");
}

static bool has_lines(const supine_kriging *fit) {
  for (size_t j = 0; j < fit->count; ++j) {
    if (fit->points[j].on_line) {
      return true;
    }
  }
  return false;
}

/* Compute the restricted log likelihood of the residuals from the solved normal equations. */
static double find_likelihood(const supine_kriging *fit, const supine_kriging_options *options,
                              const double factor[TERMS * TERMS], const double right[TERMS]) {
  const size_t n = fit->count;
  const double shift = options->axis_deviation;
  double sum = -supine_dot_n(TERMS, fit->terms, right);
  for (size_t i = 0; i < n; ++i) {
    sum += 6 * log(fit->factor[i * n + i]);
  }
  for (size_t k = 0; k < TERMS; ++k) {
    double mean = 0;
    const double precision = prior_of(options, k, &mean);
    sum += 2 * log(factor[k * TERMS + k]) + precision * mean * mean -
           (precision > 0 ? log(precision) : 0);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    const double *y = fit->whitened + (VALUE + axis) * n;
    sum += supine_dot_n(n, y, y);
  }
  if (fit->lines != NULL) {
    const double *y = fit->along + TERMS * n;
    sum -= supine_dot_n(n, y, y);
    for (size_t i = 0; i < n; ++i) {
      sum += 2 * log(fit->lines[i * n + i]);
    }
  }
  if (shift > 0) {
    sum += pow(options->axis_mean / shift, 2) + 2 * log(shift);
  }
  return -0.5 * sum;
}

supine_status supine_kriging_fit(const supine_kriging_options *options, size_t count,
                                 const supine_kriging_point *points, double *space,
                                 supine_kriging *fit, supine_error *error) {
  *fit = (supine_kriging){.model = options->model,
                          .points = points,
                          .count = count,
                          .has_terms = !options->field_only,
                          .factor = space};
  fit->whitened = space + count * count;
  fit->weights = fit->whitened + SUPINE_KRIGING_COLUMNS * count;
  fit->lines = fit->weights + 3 * count;
  fit->along = fit->lines + count * count;
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      const supine_kriging_point *p = &points[i];
      const supine_kriging_point *q = &points[j];
      fit->factor[i * count + j] = supine_kriging_covariance(
          &options->model, p->position, p->size, q->position, q->size, p->lung == q->lung);
    }
    fit->factor[i * count + i] += points[i].noise * points[i].noise;
  }
  if (!supine_kriging_factor(count, fit->factor)) {
    return refuse_covariance(error);
  }
  whiten(fit);
  double *scratch = fit->along + (TERMS + 1) * count;
  if (!has_lines(fit)) {
    fit->lines = fit->along = NULL;
  } else if (!supine_kriging_add_lines(fit, scratch)) {
    return refuse_covariance(error);
  }
  double a[TERMS * TERMS];
  double factor[TERMS * TERMS];
  double right[TERMS];
  normal_equations(fit, options, a, right);
  memcpy(factor, a, sizeof a);
  if (!supine_kriging_factor(TERMS, factor) || !determined(a, factor)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a rotation needs three points that are not on one line: add points, "
                            "or fit only a translation");
  }
  solve_terms(fit, options, factor, right);
  memcpy(fit->weights, fit->whitened + VALUE * count, 3 * count * sizeof *fit->weights);
  if (fit->lines != NULL) {
    memcpy(scratch, fit->along + TERMS * count, count * sizeof *scratch);
  }
  supine_kriging_subtract_terms(fit, fit->terms, scratch, fit->weights);
  fit->log_likelihood = find_likelihood(fit, options, factor, right);
  return SUPINE_OK;
}

enum { LEFT_MAX = 3 * SUPINE_KRIGING_LEFT_MAX }; /* coordinates that are left out together */

/* Compute the inverse covariance of the errors of predicting points from all others: their block of
 * W - W X C X' W. X holds the regressors of the fitted terms, C is the covariance of these terms. W
 * is K^-1, with the covariance matrix K of the coordinates of all points, less what is unknown of
 * the positions along lines: W = K^-1 - K^-1 D (D' K^-1 D)^-1 D' K^-1.
 * @param rows   [left, count] columns of L^-1 for these points, where K = L L' on each axis
 * @param seen   [left, 3, count] work space
 * @param block  [3 left, 3 left] written */
static void leave_out_block(const supine_kriging *fit, size_t left, const double *rows,
                            double *seen, double *block) {
  const size_t n = fit->count;
  double terms[LEFT_MAX][TERMS]; /* rows of X' W for the coordinates of the points */
  for (size_t i = 0; i < 3 * left; ++i) {
    const double *row = rows + i / 3 * n;
    if (fit->lines != NULL && i % 3 == 0) {
      double weights[SUPINE_KRIGING_POINTS_MAX];
      memcpy(weights, row, n * sizeof *row);
      supine_kriging_backward(n, fit->factor, weights);
      supine_kriging_project_lines(fit, weights, seen + i * n);
    }
    for (size_t k = 0; k < TERMS; ++k) {
      double sign = 0;
      const double *column = fit->whitened + (size_t)supine_kriging_column(k, i % 3, &sign) * n;
      terms[i][k] = sign * supine_dot_n(n, row, column);
      terms[i][k] -= fit->lines != NULL ? supine_dot_n(n, fit->along + k * n, seen + i * n) : 0;
    }
  }
  for (size_t i = 0; i < 3 * left; ++i) {
    for (size_t j = 0; j < 3 * left; ++j) {
      double sum = i % 3 == j % 3 ? supine_dot_n(n, rows + i / 3 * n, rows + j / 3 * n) : 0;
      sum -= fit->lines != NULL ? supine_dot_n(n, seen + i * n, seen + j * n) : 0;
      for (size_t k = 0; k < TERMS; ++k) {
        sum -= terms[i][k] * supine_dot_n(TERMS, fit->covariance[k], terms[j]);
      }
      block[i * 3 * left + j] = sum;
    }
  }
}

size_t supine_kriging_scratch(size_t count) {
  return 4 * (size_t)SUPINE_KRIGING_LEFT_MAX * count;
}

double supine_kriging_leave_out(const supine_kriging *fit, size_t left, const size_t *points,
                                double residual[3], double *scratch) {
  const size_t n = fit->count;
  const size_t size = 3 * left;
  const supine_kriging_point *first = &fit->points[points[0]];
  double block[LEFT_MAX * LEFT_MAX];
  double solved[LEFT_MAX];
  double least[LEFT_MAX];
  memset(scratch, 0, left * n * sizeof *scratch);
  memset(residual, 0, 3 * sizeof *residual);
  for (size_t i = 0; i < left; ++i) {
    scratch[i * n + points[i]] = 1;
    supine_kriging_forward(n, fit->factor, scratch + i * n);
  }
  leave_out_block(fit, left, scratch, scratch + left * n, block);
  for (size_t i = 0; i < size; ++i) {
    const supine_kriging_point *p = &fit->points[points[i / 3]];
    const double *row = scratch + i / 3 * n;
    const double scale = supine_dot_n(n, row, row);
    least[i] = 1e-9 * scale;
    solved[i] = supine_dot_n(n, row, fit->weights + i % 3 * n);
    for (size_t k = 0; k < 3; ++k) { /* along a line, the block is 0 */
      block[i * size + i / 3 * 3 + k] += scale * p->direction[i % 3] * p->direction[k];
    }
  }
  bool alone = !supine_kriging_factor(size, block);
  for (size_t i = 0; i < size; ++i) {
    alone = alone || block[i * size + i] * block[i * size + i] < least[i];
  }
  if (alone) {
    return 0;
  }
  double trace = first->on_line ? -1e-9 / least[0] : 0;
  supine_kriging_forward(size, block, solved);
  for (size_t k = 0; k < 3; ++k) {
    double unit[LEFT_MAX] = {0};
    unit[k] = 1;
    supine_kriging_forward(size, block, unit);
    trace += supine_dot_n(size, unit, unit);
    residual[k] = supine_dot_n(size, unit, solved);
  }
  return sqrt(fmax(0, trace));
}
