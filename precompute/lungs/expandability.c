/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Regional models of expandability (III-E). */
#include <math.h>

#include "precompute/lungs/expandability.h"

static bool positive(double value) {
  return value > 0.0 && isfinite(value);
}

supine_status supine_tissue_expandability_regional(const supine_lungs *lungs,
                                                   const supine_expandability_law *law, double *a,
                                                   supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  if (law->shape == SUPINE_EXPANDABILITY_UNIFORM) {
    for (size_t i = 0; i < n; ++i) {
      a[i] = 1.0;
    }
    return SUPINE_OK;
  }
  if (law->axis < 0 || law->axis > 2) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "expandability: no axis %d", law->axis);
  }
  if (!positive(law->from) || !positive(law->to)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "expandability from %g to %g: both must be positive", law->from,
                            law->to);
  }
  for (size_t i = 0; i < n; ++i) {
    double box[3];
    supine_lungs_box_coordinates(lungs, i, box);
    const double t = box[law->axis];
    a[i] = law->shape == SUPINE_EXPANDABILITY_LINEAR ? law->from + (law->to - law->from) * t
                                                     : law->from * pow(law->to / law->from, t);
  }
  return SUPINE_OK;
}

supine_status supine_tissue_expandability_stiffness(size_t count, const double *a,
                                                    double *stiffness, supine_error *error) {
  for (size_t i = 0; i < count; ++i) {
    if (!positive(a[i]) || !positive(1.0 / a[i])) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "expandability of vertex %zu is %g: it must be positive and finite",
                              i, a[i]);
    }
    stiffness[i] = 1.0 / a[i];
  }
  return SUPINE_OK;
}
