/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A block of coefficients to and from the caller's array: rows are put in their places, and turned
 * where the coefficients of a field lie together. */
#include "internal.h"

/* Eight fields at a time: a line of each row is read once, and what is written stays in cache. */
static void turn(const supine_sh_transform *plan, const supine_sh_batch *batch, size_t fields,
                 supine_sh_mode mode, const double *block, double *coefficients) {
  for (size_t f = 0; f < fields; f += 8) {
    const size_t end = fields - f < 8 ? fields : f + 8;
    for (size_t i = 0; i < plan->count; ++i) {
      const double *row = block + i * plan->width;
      double *out = coefficients + plan->position[i];
      for (size_t g = f; g < end; ++g) {
        double *place = out + g * batch->field_stride;
        *place = mode == SUPINE_SH_ADD ? *place + row[g] : row[g];
      }
    }
  }
}

void supine_sh_block_store(const supine_sh_transform *plan, const supine_sh_batch *batch,
                           size_t begin, size_t fields, supine_sh_mode mode, const double *block,
                           double *coefficients) {
  if (batch->field_stride != 1) {
    turn(plan, batch, fields, mode, block, coefficients + begin * batch->field_stride);
    return;
  }
  for (size_t i = 0; i < plan->count; ++i) {
    supine_sh_row_write(fields, mode, block + i * plan->width,
                        coefficients + plan->position[i] * batch->coefficient_stride + begin);
  }
}

void supine_sh_block_load(const supine_sh_transform *plan, const supine_sh_batch *batch,
                          size_t begin, size_t fields, const double *coefficients, double *block) {
  for (size_t i = 0; i < plan->count; ++i) {
    const double *in = coefficients + plan->position[i] * batch->coefficient_stride;
    double *row = block + i * plan->width;
    for (size_t f = 0; f < fields; ++f) {
      row[f] = in[(begin + f) * batch->field_stride];
    }
    for (size_t f = fields; f < plan->width; ++f) {
      row[f] = 0;
    }
  }
}
