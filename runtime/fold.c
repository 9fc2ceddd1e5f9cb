/* SPDX-License-Identifier: MIT */
/* Weights and gains as the kernels read them, once a frame. */
#include "runtime/internal.h"

void supine_fold(const supine_basis *basis, const supine_pose *pose, size_t lung, float *folded) {
  const size_t modes = basis->info.mode_count;
  for (size_t k = 0; k < modes; ++k) {
    folded[k] = (float)(pose->weights[k] * basis->mode_scale[k]);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    folded[modes + axis] = (float)pose->gains[lung][axis];
  }
}
