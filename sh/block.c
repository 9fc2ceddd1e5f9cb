/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A block of coefficients to the caller's array: rows are put in their places, and turned where the
 * coefficients of a field lie together. */
#include "sh/internal.h"

/* turned[field, (band + 1)^2] from the rows of a block; eight fields, a cache line, at a time. */
static void turn(const supine_sh_transform *plan, size_t fields, const double *block,
                 double *turned) {
  for (size_t f = 0; f < fields; f += 8) {
    for (size_t i = 0; i < plan->count; ++i) {
      const double *row = block + i * plan->width + f;
      double *out = turned + f * plan->count + plan->position[i];
      for (size_t g = 0; g < 8; ++g) { /* width is a multiple of 8: past `fields` there is space */
        out[g * plan->count] = row[g];
      }
    }
  }
}

void supine_sh_block_store(const supine_sh_transform *plan, const supine_sh_batch *batch,
                           size_t begin, size_t fields, supine_sh_mode mode,
                           const supine_sh_workspace *work, double *coefficients) {
  const double *block = work->coefficients;
  if (batch->field_stride == 1) {
    for (size_t i = 0; i < plan->count; ++i) {
      supine_sh_row_write(fields, mode, block + i * plan->width,
                          coefficients + plan->position[i] * batch->coefficient_stride + begin);
    }
    return;
  }
  turn(plan, fields, block, work->spectra);
  for (size_t f = 0; f < fields; ++f) {
    supine_sh_row_write(plan->count, mode, work->spectra + f * plan->count,
                        coefficients + (begin + f) * batch->field_stride);
  }
}
