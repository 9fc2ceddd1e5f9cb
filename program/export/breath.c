/* SPDX-License-Identifier: GPL-3.0-or-later */
/* How deep a breath is: by volume where the surface is closed, by displacement where it is open. */
#include <math.h>
#include <stdlib.h>

#include "program/export/export.h"

supine_status supine_export_breath_set(const export_source *source, double volume, double largest,
                                       export_breath *breath, supine_error *error) {
  static const double supine[3] = {0, 1, 0};
  *breath = (export_breath){.volume = volume, .largest = largest};
  if (source->info->has_volume) {
    return SUPINE_OK;
  }
  const size_t n = source->info->vertex_count;
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  for (size_t j = 0; j < SUPINE_LUNGS_MAX; ++j) {
    scales[j] = 1;
  }
  float *xyz = malloc(3 * n * sizeof *xyz);
  if (xyz == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  (void)supine_basis_weights(source->basis, supine, weights); /* a direction that is legal */
  supine_deform(source->basis, weights, scales, xyz);
  double farthest = 0;
  for (size_t i = 0; i < n; ++i) {
    double square = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double d = (double)xyz[3 * i + axis] - (double)source->vertices[3 * i + axis];
      square += d * d;
    }
    farthest = fmax(farthest, sqrt(square));
  }
  free(xyz);
  if (!(farthest > 0)) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "nothing moves when supine: no breath scale gives %g mm", largest);
  }
  breath->scale = largest / farthest;
  return SUPINE_OK;
}

supine_status supine_export_breath_scale(const export_source *source, const export_breath *breath,
                                         const double g[3], const double *weights, double fraction,
                                         double *scale, supine_error *error) {
  if (!source->info->has_volume) {
    *scale = fraction * breath->scale;
    return SUPINE_OK;
  }
  double rest = 0;
  (void)supine_basis_resting_volume(source->basis, g, &rest); /* a direction that is legal */
  return supine_basis_scale(source->basis, weights, rest + fraction * breath->volume, scale, error);
}
