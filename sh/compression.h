/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compress an expansion to K functions of the direction, its modes: the first harmonics, as
 * [Santhanam2008] does, or the K functions that give the least squared error. */
#ifndef SUPINE_COMPRESSION_H
#define SUPINE_COMPRESSION_H

#include "sh/expansion.h"

/** Largest number of modes of a compression. */
enum { SUPINE_MODES_MADE_MAX = 64 };

/** Rows compressed to K modes, functions of the direction g: F_i(g) of row i is about sum over k of
 * coefficients[i, k] sum over lm of modes[k, lm] Y_lm(g), with spherical harmonics Y_lm. */
typedef struct supine_compression {
  size_t row_count;
  size_t band;
  size_t mode_count;
  float *coefficients; /**< [row_count, mode_count] coefficient of each mode in each row */
  double *modes;       /**< [mode_count, (band + 1)^2] harmonic coefficients of each mode */
  double *mix; /**< [rank, mode_count] matrix: coefficients = (supine_expansion.columns) mix */
} supine_compression;

void supine_sh_compression_free(supine_compression *compression);

/** Use the (band + 1)^2 harmonics, at most SUPINE_MODES_MADE_MAX, as modes, as [Santhanam2008]. */
supine_status supine_sh_compress_harmonics(const supine_expansion *expansion,
                                           supine_compression *compression, supine_error *error);

/** Compress an expansion to the modes that give the least squared error. They are the leading right
 * singular vectors of the product expansion->columns x expansion->functions.
 * @param weight     [N] weight of each row's squared error, or NULL for 1
 * @param mode_max   largest number of modes, 1 to SUPINE_MODES_MADE_MAX; there are fewer if the
 *   matrix has lower rank
 * @param singular   [mode_max] singular values of the modes in falling order, then zeros, or NULL
 * @param total      written: sum of the squares of all singular values; may be NULL */
supine_status supine_sh_compress_modes(const supine_expansion *expansion, const double *weight,
                                       size_t mode_max, supine_compression *compression,
                                       double *singular, double *total, supine_error *error);

/** Find the smallest number of modes with an error below 1.01 times that with `count` modes.
 * @param singular  [count] singular values of the modes
 * @param total     sum of the squares of all singular values
 * @param error     relative RMS error with `count` modes */
size_t supine_sh_modes_needed(size_t count, const double *singular, double total, double error);

/** Keep the first `count` modes of a compression, whose array `mix` has `rank` rows. */
void supine_sh_compression_truncate(supine_compression *compression, size_t rank, size_t count);

/** Allocate a compression with the numbers of rows and of harmonics of `expansion`. Its arrays
 * `modes` and `mix` are zero; its `coefficients` are not set. Free it also after an error. */
supine_status supine_sh_compression_create(const supine_expansion *expansion, size_t mode_count,
                                           supine_compression *made);

/** Compute made->mix = expansion->functions x made->modes^T, and
 * made->coefficients = expansion->columns x made->mix. */
void supine_sh_compression_mix(const supine_expansion *expansion, supine_compression *made);

/** Find the `count` leading eigenpairs of a symmetric matrix [n, n], largest eigenvalue first, into
 * vectors [count, n] and the first `count` of values [n]; the other values are work space. The
 * matrix is overwritten; only its lower triangle in column-major order is read. */
supine_status supine_sh_leading_eigenpairs(size_t n, double *matrix, size_t count, double *values,
                                           double *vectors);

/** Compute the value of each mode at the unit vector g, weights [mode_count]. */
void supine_sh_compression_weights(const supine_compression *compression, const double g[3],
                                   double *weights);

#endif
