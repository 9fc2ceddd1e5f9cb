/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Scale the stiffness of tissue to a geometric mean of 1. */
#include <math.h>

#include "base/arena.h"
#include "precompute/physics/stiffness.h"

supine_status supine_physics_stiffness_normalise(size_t count, const double *stiffness,
                                                 double *scaled, supine_error *error) {
  if (stiffness == NULL) {
    for (size_t i = 0; i < count; ++i) {
      scaled[i] = 1.0;
    }
    return SUPINE_OK;
  }
  double logarithms = 0.0;
  for (size_t i = 0; i < count; ++i) {
    SUPINE_REFUSE_IF(!(stiffness[i] > 0.0) || !isfinite(stiffness[i]), error, SUPINE_ERROR_ARGUMENT,
                     "the stiffness of vertex %zu is %g: give a positive number", i, stiffness[i]);
    logarithms += log(stiffness[i]);
  }
  const double factor = exp(-logarithms / (double)count);
  for (size_t i = 0; i < count; ++i) {
    scaled[i] = stiffness[i] * factor;
  }
  return SUPINE_OK;
}
