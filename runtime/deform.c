/* SPDX-License-Identifier: MIT */
/* Deformed positions: x_i = p_i + s (w . c_i) d_i. */
#include "internal.h"

static float dot(const float *weights, const float *coefficients, size_t count) {
  float sum = 0;
  for (size_t k = 0; k < count; ++k) {
    sum += weights[k] * coefficients[k];
  }
  return sum;
}

/* Vertices of one lung; the breath scale is in the weights. */
static void deform_part(const supine_basis *basis, const float *weights, size_t begin, size_t end,
                        float *xyz) {
  const size_t modes = basis->info.mode_count;
  for (size_t i = begin; i < end; ++i, xyz += 3) {
    const float *rest = basis->vertices + 3 * i;
    if (basis->info.vector) {
      const float *c = basis->coefficients + 3 * i * modes;
      for (size_t axis = 0; axis < 3; ++axis) {
        xyz[axis] = rest[axis] + dot(weights, c + axis * modes, modes);
      }
    } else {
      const float *d = basis->direction + 3 * i;
      const float amount = dot(weights, basis->coefficients + i * modes, modes);
      for (size_t axis = 0; axis < 3; ++axis) {
        xyz[axis] = rest[axis] + amount * d[axis];
      }
    }
  }
}

void supine_deform_range(const supine_basis *basis, const double *weights, const double *scales,
                         size_t begin, size_t end, float *xyz) {
  float scaled[SUPINE_MODES_MAX];
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    const size_t first = basis->lung_begin[lung] > begin ? basis->lung_begin[lung] : begin;
    const size_t last = basis->lung_begin[lung + 1] < end ? basis->lung_begin[lung + 1] : end;
    if (first < last) {
      for (size_t k = 0; k < basis->info.mode_count; ++k) {
        scaled[k] = (float)(scales[lung] * weights[k]);
      }
      deform_part(basis, scaled, first, last, xyz + 3 * (first - begin));
    }
  }
}

void supine_deform(const supine_basis *basis, const double *weights, const double *scales,
                   float *xyz) {
  supine_deform_range(basis, weights, scales, 0, basis->info.vertex_count, xyz);
}
