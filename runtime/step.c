/* SPDX-License-Identifier: MIT */
/* One step of a breath at a frozen orientation [Santhanam2008] (III-B). */
#include <supine/runtime.h>

void supine_step(size_t count, const float *restrict step, float *restrict xyz) {
  for (size_t i = 0; i < 3 * count; ++i) {
    xyz[i] += step[i];
  }
}
