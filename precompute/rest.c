/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The resting volume of a field: stated along the axes, and between them by harmonics. */
#include <stdlib.h>

#include <supine/sh.h>
#include <supine/volume.h>

#include "precompute/projection/compression.h"
#include "precompute/rest.h"

/* Whether the field takes each lung to its volume at unit gravity g. */
static supine_status check_rest(const supine_compression *compression,
                                const supine_volume_forms *forms, const double g[3],
                                const double *volume, supine_error *error) {
  double weights[SUPINE_MODES_MADE_MAX];
  supine_error inner = {0};
  supine_projection_compression_weights(compression, g, weights);
  for (size_t lung = 0; lung < forms->lung_count; ++lung) {
    static const double straight[3] = {0.0, 0.0, 0.0};
    supine_volume_form form;
    double gains[3];
    supine_physics_volume_forms_contract_lung(forms, lung, weights, &form);
    if (supine_volume_form_gains(&form, straight, 0.0, volume[lung], gains, &inner) != SUPINE_OK) {
      return supine_error_set(
          error, SUPINE_ERROR_NUMERICAL,
          "with gravity along %g,%g,%g the lungs cannot rest %.0f mL below full inflation: %s; "
          "give --resting, or take the scan as it is with --scanned none",
          g[0], g[1], g[2], -volume[lung], inner.message);
    }
  }
  return SUPINE_OK;
}

supine_status supine_precompute_rest(const supine_reference *reference, const double share[2],
                                     const supine_compression *compression,
                                     const supine_volume_forms *forms, double harmonics[2][9],
                                     supine_error *error) {
  double volume[2][6];
  supine_status status = SUPINE_OK;
  for (size_t axis = 0; axis < 6 && status == SUPINE_OK; ++axis) {
    double g[3] = {0.0, 0.0, 0.0};
    double rest[2];
    g[axis / 2] = axis % 2 == 0 ? 1.0 : -1.0;
    (void)supine_reference_rest(reference, g, rest);
    for (size_t lung = 0; lung < reference->lung_count; ++lung) {
      rest[lung] = share[lung] * (rest[lung] - reference->full_volume[lung]);
      volume[lung][axis] = rest[lung];
    }
    status = check_rest(compression, forms, g, rest, error);
  }
  for (size_t lung = 0; lung < reference->lung_count && status == SUPINE_OK; ++lung) {
    supine_reference_harmonics(volume[lung], harmonics[lung]);
  }
  return status;
}
