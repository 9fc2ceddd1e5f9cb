/* SPDX-License-Identifier: MIT */
/* Folding scales into the weights, once a frame instead of once a vertex. */
#include "runtime/internal.h"

void supine_fold(const supine_basis *basis, const double *weights, double scale, float *folded) {
  for (size_t k = 0; k < basis->info.mode_count; ++k) {
    folded[k] = (float)(scale * weights[k] * basis->mode_scale[k]);
  }
}
