/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The matrix product along latitude: small matrices, long rows of fields. */
#include "sh/internal.h"

enum { HALF = SUPINE_SH_LANES / 2, TILE = 4 };

typedef double lanes __attribute__((vector_size(HALF * sizeof(double))));

/* `rows` <= TILE is a constant where this is called: the sums stay in registers. */
static inline __attribute__((always_inline)) void
product_tile(size_t rows, size_t columns, size_t width, const double *restrict t, size_t t_stride,
             const double *restrict x, double *restrict y) {
  for (size_t f = 0; f < width; f += SUPINE_SH_LANES) {
    lanes low[TILE] = {{0}};
    lanes high[TILE] = {{0}};
    for (size_t c = 0; c < columns; ++c) {
      const lanes *in = (const lanes *)(x + c * width + f);
      const lanes in_low = in[0];
      const lanes in_high = in[1];
      for (size_t r = 0; r < rows; ++r) {
        low[r] += t[r * t_stride + c] * in_low;
        high[r] += t[r * t_stride + c] * in_high;
      }
    }
    for (size_t r = 0; r < rows; ++r) {
      lanes *out = (lanes *)(y + r * width + f);
      out[0] = low[r];
      out[1] = high[r];
    }
  }
}

SUPINE_CLONES
void supine_sh_product(size_t rows, size_t columns, size_t width, const double *t, size_t t_stride,
                       const double *x, double *y) {
  while (rows >= TILE) {
    product_tile(TILE, columns, width, t, t_stride, x, y);
    rows -= TILE;
    t += TILE * t_stride;
    y += TILE * width;
  }
  if (rows == 3) {
    product_tile(3, columns, width, t, t_stride, x, y);
  } else if (rows == 2) {
    product_tile(2, columns, width, t, t_stride, x, y);
  } else if (rows == 1) {
    product_tile(1, columns, width, t, t_stride, x, y);
  }
}
