/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The resting volume of a field: solved along the axes, and between them by harmonics. */
#include <stdlib.h>

#include <supine/sh.h>
#include <supine/volume.h>

#include "precompute/projection/compression.h"
#include "precompute/rest.h"

/* The cubics of the lungs together at unit gravity g: as they are, and added to `healthy` as they
 * would be without collapse. */
static void add_cubics(const supine_volume_forms *forms, const double *share, const double *weights,
                       double *ill, double *healthy) {
  const size_t k = forms->column_count;
  for (size_t lung = 0; lung < forms->lung_count; ++lung) {
    double cubic[3] = {0.0, 0.0, 0.0};
    supine_volume_add(k, forms->linear + lung * k, forms->quadratic + lung * k * k,
                      forms->cubic + lung * k * k * k, weights, cubic);
    for (size_t i = 0; i < 3; ++i) {
      ill[i] += cubic[i];
      healthy[i] += cubic[i] / share[lung];
    }
  }
}

/* Nine parameters: all that a basis is made of, before it is one. */
static supine_status rest_along(const supine_lungs *lungs, const supine_model *model,
                                const supine_reference *reference,
                                const supine_compression *compression,
                                const supine_volume_forms *forms, const double g[3], double *y,
                                double *volume, supine_error *error) {
  const bool alone = lungs->lung_count == 1;
  double healthy[3] = {0.0, 0.0, 0.0};
  double ill[2][3] = {{0.0}};
  double scale = 0.0;
  for (size_t image = 0; image < (alone ? 2 : 1); ++image) {
    const double seen[3] = {image == 0 ? g[0] : -g[0], g[1], g[2]};
    double weights[SUPINE_MODES_MADE_MAX];
    const supine_status status = supine_sh_evaluate(compression->band, seen, y);
    if (status != SUPINE_OK) {
      return supine_error_set(error, status, "rest: %s", supine_status_string(status));
    }
    supine_projection_compression_weights(compression, y, weights);
    add_cubics(forms, model->share, weights, ill[image], healthy);
  }
  const double share = supine_reference_along_axes(reference->resting.share, g);
  const double sides = alone ? 2.0 : 1.0;
  const double rest = share * (reference->full_volume - reference->anchored);
  supine_error inner = {0};
  if (supine_volume_scale(healthy, sides * (rest - reference->full_volume), &scale, &inner) !=
      SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "with gravity along %g,%g,%g the lungs cannot rest at %g of their full "
                            "volume: %s; give --resting, or take the scan as it is with --scanned "
                            "none",
                            g[0], g[1], g[2], share, inner.message);
  }
  *volume = supine_volume_at(ill[0], scale);
  return SUPINE_OK;
}

supine_status supine_precompute_rest(const supine_lungs *lungs, const supine_model *model,
                                     const supine_reference *reference,
                                     const supine_compression *compression,
                                     const supine_volume_forms *forms, double harmonics[9],
                                     supine_error *error) {
  double *y = malloc(supine_sh_count(compression->band) * sizeof *y);
  double volume[6];
  supine_status status =
      y != NULL ? SUPINE_OK : supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for rest");
  for (size_t axis = 0; axis < 6 && status == SUPINE_OK; ++axis) {
    double g[3] = {0.0, 0.0, 0.0};
    g[axis / 2] = axis % 2 == 0 ? 1.0 : -1.0;
    status = rest_along(lungs, model, reference, compression, forms, g, y, &volume[axis], error);
  }
  free(y);
  if (status == SUPINE_OK) {
    supine_reference_harmonics(volume, harmonics);
  }
  return status;
}
