/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What the files of the transform share.
 *
 * Latitudes are taken in pairs, north and south: pair p is latitudes p and latitudes - 1 - p, and
 * the equator, where there is one, stands alone. Y(l, m) is even in z where l - m is even, so only
 * the sum of a pair's rings meets those degrees and only the difference the others. Sum and
 * difference travel as real and imaginary part of one complex field through the FFT.
 *
 * A block is a group of `width` fields. Its arrays have one row of `width` doubles for
 *   spectra       each (m, parity, cosine or sine, pair), in that order
 *   coefficients  each (m, parity, cosine or sine, l), in that order
 * so that, for each (m, parity), one is a small matrix times the other. m = 0 has no sines. */
#ifndef SUPINE_SH_INTERNAL_H
#define SUPINE_SH_INTERNAL_H

#include <stddef.h>
#include <stdint.h>

#include <fftw3.h>

#include "sh/base/clones.h"
#include "sh/transform.h"

enum {
  SUPINE_SH_LANES = 16,     /* fields that a kernel works on together; `width` is a multiple */
  SUPINE_SH_WIDTH_MAX = 48, /* of `width` */
  SUPINE_SH_ALIGNMENT = 64  /* bytes, of every block array */
};

struct supine_sh_transform {
  size_t band;
  size_t count; /* (band + 1)^2 */
  size_t latitudes, longitudes;
  size_t pairs; /* latitudes / 2, rounded up */
  size_t width;
  double *analysis; /* for each (m, parity): [degrees, pairs], weights included */
  size_t *position; /* [count] index l*l + l + m of each row of a coefficient block */
  fftw_plan fft;    /* [longitudes] complex, for `width` fields at once */
};

/* A thread's own arrays. */
typedef struct supine_sh_workspace {
  double *ring;          /* [longitudes, width] complex */
  double *ring_spectrum; /* [longitudes, width] complex */
  double *spectra;       /* [2 (2 band + 1), pairs, width] */
  double *coefficients;  /* [count, width] */
} supine_sh_workspace;

/* Degrees l <= band with l >= m and l - m of the given parity. */
static inline size_t supine_sh_degrees(size_t band, size_t m, size_t parity) {
  return (band - m + 2 - parity) / 2;
}

/* Which group of `pairs` rows of the spectra (m, parity, cosine or sine) is. */
static inline size_t supine_sh_group(size_t m, size_t parity, size_t sine) {
  return m == 0 ? parity : 4 * m - 2 + 2 * parity + sine;
}

/* legendre.c: fills analysis and position. */
supine_status supine_sh_legendre(supine_sh_transform *plan, const supine_sh_grid *grid);

/* product.c: y[rows, width] = t[rows, columns] x[columns, width]; t has row stride `t_stride`. */
void supine_sh_product(size_t rows, size_t columns, size_t width, const double *t, size_t t_stride,
                       const double *x, double *y);

/* rows.c: what becomes of the caller's memory. STREAM is SET for an output larger than caches. */
typedef enum supine_sh_mode { SUPINE_SH_SET, SUPINE_SH_ADD, SUPINE_SH_STREAM } supine_sh_mode;

/* SET or STREAM, by the size of the whole output. */
supine_sh_mode supine_sh_row_mode(size_t rows, size_t fields);
void supine_sh_row_write(size_t fields, supine_sh_mode mode, const double *row, double *out);
/* Each thread, when it has written its last row. */
void supine_sh_rows_finish(void);

/* ring.c: rings of values to rows of spectra. `fields` <= width of the block are there.
 * A pair's missing ring is NULL. `row` and `rows`: the pair's place among how many in a group. */
void supine_sh_ring_forward(const supine_sh_transform *plan, const supine_sh_workspace *work,
                            size_t fields, size_t stride, const double *north, const double *south,
                            size_t row, size_t rows);

/* block.c: coefficients of the fields from `begin` on. Storing may overwrite the spectra, which
 * have at least as much space as the coefficients. */
void supine_sh_block_store(const supine_sh_transform *plan, const supine_sh_batch *batch,
                           size_t begin, size_t fields, supine_sh_mode mode,
                           const supine_sh_workspace *work, double *coefficients);

/* batch.c: fills in the defaults and refuses strides that overlap or overflow. */
supine_status supine_sh_batch_check(const supine_sh_transform *plan, const supine_sh_batch *batch,
                                    size_t points, supine_sh_batch *full, supine_error *error);

/* batch.c: calls `block` on every block of the batch, over the batch's threads, each with its own
 * workspace. Blocks begin where `output` meets cache lines; the first may be shorter. */
typedef void supine_sh_block_function(const void *context, const supine_sh_workspace *work,
                                      size_t begin, size_t fields);
supine_status supine_sh_batch_run(const supine_sh_transform *plan, const supine_sh_batch *full,
                                  supine_sh_block_function *block, const void *context,
                                  const double *output, supine_error *error);

#endif
