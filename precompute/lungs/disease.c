/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the stiffness factors of lesions, and shrink collapsed lungs ([Santhanam2008] VI). */
#include <math.h>
#include <string.h>

#include "base/vec3.h"

#include "precompute/lungs/disease.h"

/* Compute the exponent w of a lesion's factor (disease.h) at a distance from its centre. */
static double lesion_weight(double distance, double radius) {
  if (distance >= radius) {
    return 0.0;
  }
  const double q = fmin(1.0, 2.0 * (1.0 - distance / radius));
  return q * q * (3.0 - 2.0 * q);
}

static bool positive(double value) {
  return value > 0.0 && isfinite(value);
}

supine_status supine_lungs_add_lesion(const supine_lungs *lungs, const supine_lesion *lesion,
                                      double *factors, size_t *reached, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const double *c = lesion->centre;
  SUPINE_REFUSE_IF(!isfinite(c[0]) || !isfinite(c[1]) || !isfinite(c[2]) ||
                       !positive(lesion->radius) || !positive(lesion->factor),
                   error, SUPINE_ERROR_ARGUMENT,
                   "lesion at %g,%g,%g, radius %g, factor %g: give finite numbers, and a positive "
                   "radius and factor",
                   c[0], c[1], c[2], lesion->radius, lesion->factor);
  *reached = 0;
  for (size_t i = 0; i < n; ++i) {
    const double *p = lungs->mesh.vertices + 3 * i;
    const double w = lesion_weight(supine_distance(p, c), lesion->radius);
    if (w > 0.0) {
      factors[i] *= pow(lesion->factor, w);
      ++*reached;
    }
  }
  return SUPINE_OK;
}

bool supine_lungs_is_hilar(const double *p, const double low[3], const double high[3], bool left) {
  double at[3]; /* 0 to 1: from the midline, from the front, from the base */
  for (size_t k = 0; k < 3; ++k) {
    at[k] = (p[k] - low[k]) / (high[k] - low[k]);
  }
  return (left ? at[0] : 1.0 - at[0]) < 0.35 && fabs(at[1] - 0.5) < 0.2 && fabs(at[2] - 0.5) < 0.2;
}

void supine_lungs_hilum_mean(const supine_lungs *lungs, size_t lung, const double *values,
                             double mean[3]) {
  const double *p = lungs->scanned != NULL ? lungs->scanned : lungs->mesh.vertices;
  const size_t begin = lungs->lung_begin[lung];
  const size_t end = lungs->lung_begin[lung + 1];
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  double count = 0.0;
  for (size_t i = 3 * begin; i < 3 * end; ++i) {
    low[i % 3] = fmin(low[i % 3], p[i]);
    high[i % 3] = fmax(high[i % 3], p[i]);
  }
  mean[0] = mean[1] = mean[2] = 0.0;
  for (size_t i = begin; i < end; ++i) {
    if (supine_lungs_is_hilar(p + 3 * i, low, high, lungs->side[lung] > 0)) {
      count += 1.0;
      for (size_t k = 0; k < 3; ++k) {
        mean[k] += values[3 * i + k];
      }
    }
  }
  for (size_t k = 0; k < 3; ++k) {
    mean[k] = count > 0.0 ? mean[k] / count : values[3 * begin + k];
  }
}

void supine_lungs_collapse(const supine_lungs *lungs, const double share[2], const double *values,
                           double *collapsed) {
  memmove(collapsed, values, 3 * lungs->mesh.vertex_count * sizeof *collapsed);
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    if (share[lung] == 1.0) {
      continue;
    }
    const double length = cbrt(share[lung]);
    double hilum[3];
    supine_lungs_hilum_mean(lungs, lung, collapsed, hilum);
    for (size_t i = 3 * lungs->lung_begin[lung]; i < 3 * lungs->lung_begin[lung + 1]; ++i) {
      collapsed[i] = hilum[i % 3] + length * (collapsed[i] - hilum[i % 3]);
    }
  }
}
