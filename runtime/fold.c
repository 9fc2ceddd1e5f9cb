/* SPDX-License-Identifier: MIT */
/* Folding scales into the weights, once a frame instead of once a vertex. */
#include "internal.h"

void supine_fold(const supine_basis *basis, const double *weights, double scale, bool widened,
                 float *folded) {
  const size_t modes = basis->info.mode_count;
  const bool pairs = basis->tiles.storage == SUPINE_STORAGE_INT16 && !widened;
  for (size_t k = 0; k < modes; ++k) {
    const double weight = scale * weights[k] * basis->mode_scale[k];
    if (!pairs) {
      folded[k] = (float)weight;
      continue;
    }
    /* tiles.h: W_h = w_h / 65536, W_l = (w_l - W_h) / 65536, with W_h as it is rounded. */
    if (k % 2 == 0) {
      folded[k] = (float)(weight / 65536);
      folded[k + 1] = -folded[k] / 65536;
    } else {
      folded[k] = (float)((weight - (double)folded[k - 1]) / 65536);
    }
  }
}
