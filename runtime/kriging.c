/* SPDX-License-Identifier: MIT */
/* Fit translation, volume, rotation and a random field to the residuals of observed points. */
#include <math.h>
#include <string.h>

#include "runtime/kriging.h"

enum { ONE = 0, VOLUME = 1, PLACE = 4, VALUE = 7, TERMS = SUPINE_KRIGING_TERMS };

const supine_kriging_model supine_kriging_default = {
    .sill = 6.0, .length = 90.0, .across = 1.0 / 3.0, .least = 2.0};

bool supine_kriging_factor(size_t count, double *matrix) {
  for (size_t i = 0; i < count; ++i) {
    double *row = matrix + i * count;
    for (size_t j = 0; j <= i; ++j) {
      const double *other = matrix + j * count;
      double sum = row[j];
      for (size_t k = 0; k < j; ++k) {
        sum -= row[k] * other[k];
      }
      if (i == j && !(sum > 0 && isfinite(sum))) {
        return false;
      }
      row[j] = i == j ? sqrt(sum) : sum / other[j];
    }
  }
  return true;
}

/* Solve L x = b for the lower triangle L [count, count] in `factor`. Replace b in `x` by the
 * solution. */
static void forward(size_t count, const double *factor, double *x) {
  for (size_t i = 0; i < count; ++i) {
    double sum = x[i];
    for (size_t k = 0; k < i; ++k) {
      sum -= factor[i * count + k] * x[k];
    }
    x[i] = sum / factor[i * count + i];
  }
}

size_t supine_kriging_space(size_t count) {
  return count * (count + SUPINE_KRIGING_COLUMNS + 3);
}

/* Return the column of supine_kriging.whitened that `term` (0 to 2: translation, 3: volume, 4 to 6:
 * rotation) multiplies in the residual along `axis`. Write the sign of the product, or 0 if the
 * term does not change this coordinate. */
static int column_of(size_t term, size_t axis, double *sign) {
  *sign = 1;
  if (term < 3) {
    *sign = term == axis ? 1 : 0;
    return ONE;
  }
  if (term == 3) {
    return VOLUME + (int)axis;
  }
  const size_t about = term - 4;
  *sign = 0;
  if (axis == (about + 1) % 3) {
    *sign = -1;
  } else if (axis == (about + 2) % 3) {
    *sign = 1;
  }
  return PLACE + (int)((6 - about - axis) % 3);
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
    forward(n, fit->factor, fit->whitened + c * n);
  }
}

static double dot(size_t count, const double *a, const double *b) {
  double sum = 0;
  for (size_t i = 0; i < count; ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

static bool is_known(const supine_kriging_options *options, size_t term) {
  return term == 3 ? !options->volume : term > 3 && !options->rotation;
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

/* Compute A and the right side of the normal equations for the fitted terms: translation, volume
 * and rotation.
 *
 *     A = X' K^-1 X + P        right = X' K^-1 y + P m
 *
 *     X  what each term, if it is 1, adds to each coordinate of each point
 *     K  covariance matrix of the coordinates of the points
 *     y  residuals: observed minus predicted coordinates of the points
 *     P  inverse covariance of the prior of the terms (prior_of)
 *     m  mean of the prior
 *
 * If a term is not fitted, its row of A is a row of the identity. */
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
      const double *x = fit->whitened + (size_t)column_of(k, axis, &sign) * n;
      right[k] += sign * dot(n, x, fit->whitened + (VALUE + axis) * n);
      for (size_t l = 0; l <= k; ++l) {
        double other = 0;
        const double *z = fit->whitened + (size_t)column_of(l, axis, &other) * n;
        a[k * TERMS + l] += is_known(options, l) ? 0 : sign * other * dot(n, x, z);
      }
    }
  }
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
    forward(TERMS, factor, inverse[k]);
  }
  memset(fit->terms, 0, sizeof fit->terms);
  memset(fit->spread, 0, sizeof fit->spread);
  for (size_t k = 0; k < TERMS; ++k) {
    for (size_t l = 0; l < TERMS; ++l) {
      const double c =
          is_known(options, k) || is_known(options, l) ? 0 : dot(TERMS, inverse[k], inverse[l]);
      fit->covariance[k][l] = c;
      fit->terms[k] += c * right[l];
      for (size_t axis = 0; axis < 3; ++axis) {
        double one = 0;
        double other = 0;
        const int from = column_of(k, axis, &one);
        const int to = column_of(l, axis, &other);
        fit->spread[from][to] += one * other * c;
      }
    }
  }
}

static void find_weights(supine_kriging *fit) {
  const size_t n = fit->count;
  for (size_t axis = 0; axis < 3; ++axis) {
    double *weights = fit->weights + axis * n;
    memcpy(weights, fit->whitened + (VALUE + axis) * n, n * sizeof *weights);
    for (size_t k = 0; k < TERMS; ++k) {
      double sign = 0;
      const double *x = fit->whitened + (size_t)column_of(k, axis, &sign) * n;
      for (size_t j = 0; j < n; ++j) {
        weights[j] -= sign * fit->terms[k] * x[j];
      }
    }
  }
}

supine_status supine_kriging_fit(const supine_kriging_options *options, size_t count,
                                 const supine_kriging_point *points, double *space,
                                 supine_kriging *fit, supine_error *error) {
  *fit =
      (supine_kriging){.model = options->model, .points = points, .count = count, .factor = space};
  fit->whitened = space + count * count;
  fit->weights = fit->whitened + SUPINE_KRIGING_COLUMNS * count;
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
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "the points' covariance is not positive definite: give each point "
                            "a noise above 0");
  }
  whiten(fit);
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
  find_weights(fit);
  double sum = -dot(TERMS, fit->terms, right);
  for (size_t i = 0; i < count; ++i) {
    sum += 6 * log(fit->factor[i * count + i]);
  }
  for (size_t k = 0; k < TERMS; ++k) {
    double mean = 0;
    const double precision = prior_of(options, k, &mean);
    sum += 2 * log(factor[k * TERMS + k]) + precision * mean * mean -
           (precision > 0 ? log(precision) : 0);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    const double *y = fit->whitened + (VALUE + axis) * count;
    sum += dot(count, y, y);
  }
  fit->log_likelihood = -0.5 * sum;
  return SUPINE_OK;
}

/* Compute the inverse covariance [3, 3] of the error of predicting one point from all others. It is
 * the block of this point in K^-1 - K^-1 X C X' K^-1. K is the covariance matrix of the coordinates
 * of all points, X holds the regressors of the fitted terms, and C is the covariance of these
 * terms.
 * @param row  [count] column of L^-1 for this point, where K = L L' on each axis */
static void leave_out_block(const supine_kriging *fit, const double *row, double block[9]) {
  const size_t n = fit->count;
  double column[VALUE];
  for (size_t c = 0; c < VALUE; ++c) {
    column[c] = dot(n, row, fit->whitened + c * n);
  }
  for (size_t a = 0; a < 3; ++a) {
    for (size_t b = 0; b < 3; ++b) {
      double sum = a == b ? dot(n, row, row) : 0;
      for (size_t k = 0; k < TERMS; ++k) {
        for (size_t l = 0; l < TERMS; ++l) {
          double one = 0;
          double other = 0;
          const double x = column[column_of(k, a, &one)];
          const double z = column[column_of(l, b, &other)];
          sum -= one * other * x * z * fit->covariance[k][l];
        }
      }
      block[3 * a + b] = sum;
    }
  }
}

double supine_kriging_leave_out(const supine_kriging *fit, size_t point, double residual[3],
                                double *scratch) {
  const size_t n = fit->count;
  double block[9];
  memset(scratch, 0, n * sizeof *scratch);
  scratch[point] = 1;
  forward(n, fit->factor, scratch);
  leave_out_block(fit, scratch, block);
  const double least = 1e-9 * dot(n, scratch, scratch);
  bool alone = !supine_kriging_factor(3, block);
  for (size_t a = 0; a < 3; ++a) {
    alone = alone || block[4 * a] * block[4 * a] < least;
    residual[a] = dot(n, scratch, fit->weights + a * n);
  }
  if (alone) {
    memset(residual, 0, 3 * sizeof *residual);
    return 0;
  }
  double trace = 0;
  double solved[3];
  forward(3, block, residual);
  for (size_t k = 0; k < 3; ++k) {
    double unit[3] = {k == 0, k == 1, k == 2};
    forward(3, block, unit);
    trace += dot(3, unit, unit);
    solved[k] = dot(3, unit, residual);
  }
  memcpy(residual, solved, sizeof solved);
  return sqrt(trace);
}
