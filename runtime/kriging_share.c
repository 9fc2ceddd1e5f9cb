/* SPDX-License-Identifier: MIT */
/* Compute what observed points leave of the variance of a random field. */
#include <math.h>

#include "runtime/kriging.h"

/* Variance of an observed position, as a share of that of the field: about 2 mm on each axis where
 * the field has 6 mm. */
static const double noise_share = 0.1;

static double correlate(const supine_kriging_place *a, const supine_kriging_place *b) {
  supine_kriging_model unit = supine_kriging_default;
  unit.sill = 3; /* so that a size of 1 has the variance 1 on each axis */
  unit.least = 0;
  return supine_kriging_covariance(&unit, a->position, 1, b->position, 1, a->lung == b->lung);
}

bool supine_kriging_share_prepare(size_t count, const supine_kriging_place *seen, double *factor) {
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      factor[i * count + j] = correlate(&seen[i], &seen[j]) + (i == j ? noise_share : 0);
    }
  }
  return supine_kriging_factor(count, factor);
}

double supine_kriging_share(size_t count, const supine_kriging_place *seen, const double *factor,
                            const supine_kriging_place *at, double *scratch) {
  double share = 1;
  for (size_t i = 0; i < count; ++i) {
    scratch[i] = correlate(&seen[i], at);
  }
  supine_kriging_forward(count, factor, scratch);
  for (size_t i = 0; i < count; ++i) {
    share -= scratch[i] * scratch[i];
  }
  return fmax(0, share);
}
