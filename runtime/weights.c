/* SPDX-License-Identifier: MIT */
/* Weights of the modes for one direction of gravity. */
#include <supine/sh.h>

#include "runtime/internal.h"

supine_status supine_basis_weights(const supine_basis *basis, const double gravity[3],
                                   double *weights) {
  double y[(SUPINE_SH_BAND_MAX + 1) * (SUPINE_SH_BAND_MAX + 1)];
  const size_t count = supine_sh_count(basis->info.band);
  const supine_status status = supine_sh_evaluate(basis->info.band, gravity, y);
  if (status != SUPINE_OK) {
    return status;
  }
  for (size_t k = 0; k < basis->info.mode_count; ++k) {
    double sum = 0;
    for (size_t i = 0; i < count; ++i) {
      sum += basis->info.modes[k * count + i] * y[i];
    }
    weights[k] = sum;
  }
  return SUPINE_OK;
}
