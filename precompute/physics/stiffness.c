/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Stiffness of the mass nodes (III-E), free of its absolute scale. */
#include <math.h>

#include "precompute/physics/network.h"

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
    if (!(stiffness[i] > 0.0) || !isfinite(stiffness[i])) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "stiffness of vertex %zu is %g: it must be positive and finite", i,
                              stiffness[i]);
    }
    logarithms += log(stiffness[i]);
  }
  const double factor = exp(-logarithms / (double)count);
  for (size_t i = 0; i < count; ++i) {
    scaled[i] = stiffness[i] * factor;
  }
  return SUPINE_OK;
}
