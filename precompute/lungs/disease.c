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

void supine_lungs_find_hilum(const supine_lungs *lungs, size_t lung, double hilum[3]) {
  const double *p = lungs->mesh.vertices;
  double low = INFINITY;
  double high = -INFINITY;
  for (size_t i = lungs->lung_begin[lung]; i < lungs->lung_begin[lung + 1]; ++i) {
    low = fmin(low, p[3 * i]);
    high = fmax(high, p[3 * i]);
  }
  if (lungs->side[lung] > 0) {
    high = low + 0.25 * (high - low);
  } else {
    low = high - 0.25 * (high - low);
  }
  double sum[3] = {0.0, 0.0, 0.0};
  double count = 0.0;
  for (size_t i = lungs->lung_begin[lung]; i < lungs->lung_begin[lung + 1]; ++i) {
    if (p[3 * i] >= low && p[3 * i] <= high) {
      count += 1.0;
      for (size_t k = 0; k < 3; ++k) {
        sum[k] += p[3 * i + k];
      }
    }
  }
  for (size_t k = 0; k < 3; ++k) {
    hilum[k] = sum[k] / count;
  }
}

void supine_lungs_collapse(const supine_lungs *lungs, const double share[2], double *vertices) {
  memcpy(vertices, lungs->mesh.vertices, 3 * lungs->mesh.vertex_count * sizeof *vertices);
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    if (share[lung] == 1.0) {
      continue;
    }
    const double length = cbrt(share[lung]);
    double hilum[3];
    supine_lungs_find_hilum(lungs, lung, hilum);
    for (size_t i = lungs->lung_begin[lung]; i < lungs->lung_begin[lung + 1]; ++i) {
      for (size_t k = 0; k < 3; ++k) {
        vertices[3 * i + k] = hilum[k] + length * (vertices[3 * i + k] - hilum[k]);
      }
    }
  }
}

void supine_lungs_collapse_directions(const supine_lungs *lungs, const double share[2],
                                      double *directions) {
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    if (share[lung] == 1.0) {
      continue;
    }
    const double length = cbrt(share[lung]);
    for (size_t at = 3 * lungs->lung_begin[lung]; at < 3 * lungs->lung_begin[lung + 1]; ++at) {
      directions[at] *= length;
    }
  }
}
