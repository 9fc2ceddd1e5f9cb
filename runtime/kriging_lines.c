/* SPDX-License-Identifier: MIT */
/* Kriging with points that were seen along lines: eliminate their positions along the lines. */
#include <string.h>

#include "runtime/kriging.h"

enum { TERMS = SUPINE_KRIGING_TERMS, VALUE = 7 };

/* Compute G, the factor of D' K^-1 D: the products of two directions times elements of K^-1. */
static bool factor_lines(supine_kriging *fit, double *scratch) {
  const size_t n = fit->count;
  memset(fit->lines, 0, n * n * sizeof *fit->lines);
  for (size_t i = 0; i < n; ++i) {
    const supine_kriging_point *p = &fit->points[i];
    double *row = fit->lines + i * n;
    if (!p->on_line) {
      row[i] = 1;
      continue;
    }
    memset(scratch, 0, n * sizeof *scratch);
    scratch[i] = 1;
    supine_kriging_forward(n, fit->factor, scratch);
    supine_kriging_backward(n, fit->factor, scratch);
    for (size_t j = 0; j <= i; ++j) {
      const double *other = fit->points[j].direction;
      const double cosine =
          p->direction[0] * other[0] + p->direction[1] * other[1] + p->direction[2] * other[2];
      row[j] = fit->points[j].on_line ? cosine * scratch[j] : 0;
    }
  }
  return supine_kriging_factor(n, fit->lines);
}

/* Add D' of the coordinates `value` [count] on one axis, times a factor, to `sum` [count]. */
static void gather(const supine_kriging *fit, size_t axis, double factor, const double *value,
                   double *sum) {
  for (size_t j = 0; j < fit->count; ++j) {
    if (fit->points[j].on_line) {
      sum[j] += factor * fit->points[j].direction[axis] * value[j];
    }
  }
}

bool supine_kriging_add_lines(supine_kriging *fit, double *scratch) {
  const size_t n = fit->count;
  if (!factor_lines(fit, scratch)) {
    return false;
  }
  memset(fit->along, 0, (TERMS + 1) * n * sizeof *fit->along);
  for (size_t c = 0; c < SUPINE_KRIGING_COLUMNS; ++c) {
    memcpy(scratch, fit->whitened + c * n, n * sizeof *scratch);
    supine_kriging_backward(n, fit->factor, scratch);
    if (c >= VALUE) {
      gather(fit, c - VALUE, 1, scratch, fit->along + TERMS * n);
      continue;
    }
    for (size_t k = 0; k < TERMS; ++k) {
      for (size_t axis = 0; axis < 3; ++axis) {
        double sign = 0;
        if (supine_kriging_column(k, axis, &sign) == (int)c && sign != 0) {
          gather(fit, axis, sign, scratch, fit->along + k * n);
        }
      }
    }
  }
  for (size_t k = 0; k <= TERMS; ++k) {
    supine_kriging_forward(n, fit->lines, fit->along + k * n);
  }
  return true;
}

void supine_kriging_see_lines(const supine_kriging *fit, const double *whitened, double *seen) {
  const size_t n = fit->count;
  double value[SUPINE_KRIGING_POINTS_MAX];
  memset(seen, 0, n * sizeof *seen);
  for (size_t axis = 0; axis < 3; ++axis) {
    memcpy(value, whitened + axis * n, n * sizeof *value);
    supine_kriging_backward(n, fit->factor, value);
    gather(fit, axis, 1, value, seen);
  }
  supine_kriging_forward(n, fit->lines, seen);
}

void supine_kriging_subtract_terms(const supine_kriging *fit,
                                   const double terms[SUPINE_KRIGING_TERMS], double *seen,
                                   double *weights) {
  const size_t n = fit->count;
  double along[SUPINE_KRIGING_POINTS_MAX];
  for (size_t e = 0; e < 3 * TERMS; ++e) {
    double sign = 0;
    const size_t column = (size_t)supine_kriging_column(e % TERMS, e / TERMS, &sign);
    for (size_t j = 0; j < n; ++j) {
      weights[e / TERMS * n + j] -= sign * terms[e % TERMS] * fit->whitened[column * n + j];
    }
  }
  if (fit->lines == NULL) {
    return;
  }
  for (size_t e = 0; e < TERMS * n; ++e) {
    seen[e % n] -= terms[e / n] * fit->along[e];
  }
  supine_kriging_backward(n, fit->lines, seen);
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t j = 0; j < n; ++j) {
      along[j] = fit->points[j].on_line ? fit->points[j].direction[axis] * seen[j] : 0;
    }
    supine_kriging_forward(n, fit->factor, along);
    for (size_t j = 0; j < n; ++j) {
      weights[axis * n + j] -= along[j];
    }
  }
}

void supine_kriging_project_lines(const supine_kriging *fit, const double *weights, double *seen) {
  const size_t n = fit->count;
  memset(seen, 0, 3 * n * sizeof *seen);
  for (size_t axis = 0; axis < 3; ++axis) {
    gather(fit, axis, 1, weights, seen + axis * n);
    supine_kriging_forward(n, fit->lines, seen + axis * n);
  }
}

double supine_kriging_line_variance(const supine_kriging *fit, const double *row, double *w) {
  const size_t n = fit->count;
  double seen[3 * SUPINE_KRIGING_POINTS_MAX];
  double variance = 0;
  supine_kriging_backward(n, fit->factor, w);
  supine_kriging_project_lines(fit, w, seen);
  for (size_t axis = 0; axis < 3; ++axis) {
    const double *own = seen + axis * n;
    double m[TERMS];
    for (size_t j = 0; j < n; ++j) {
      variance += own[j] * own[j];
    }
    for (size_t k = 0; k < TERMS; ++k) {
      double sign = 0;
      const int column = supine_kriging_column(k, axis, &sign);
      m[k] = sign * row[column];
      for (size_t j = 0; j < n; ++j) {
        m[k] += fit->along[k * n + j] * own[j];
      }
    }
    for (size_t k = 0; k < TERMS * TERMS; ++k) {
      variance += m[k / TERMS] * fit->covariance[k / TERMS][k % TERMS] * m[k % TERMS];
    }
  }
  return variance;
}
