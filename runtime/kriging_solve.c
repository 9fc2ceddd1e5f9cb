/* SPDX-License-Identifier: MIT */
/* Factor and solve the linear systems of kriging. */
#include <math.h>

#include "runtime/kriging.h"

enum { ONE = 0, VOLUME = 1, PLACE = 4 };

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

void supine_kriging_forward(size_t count, const double *factor, double *x) {
  for (size_t i = 0; i < count; ++i) {
    double sum = x[i];
    for (size_t k = 0; k < i; ++k) {
      sum -= factor[i * count + k] * x[k];
    }
    x[i] = sum / factor[i * count + i];
  }
}

void supine_kriging_backward(size_t count, const double *factor, double *x) {
  for (size_t i = count; i-- > 0;) {
    x[i] /= factor[i * count + i];
    for (size_t k = 0; k < i; ++k) {
      x[k] -= factor[i * count + k] * x[i];
    }
  }
}

int supine_kriging_column(size_t term, size_t axis, double *sign) {
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
