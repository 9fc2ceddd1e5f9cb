/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Expand real functions F_i(g) of a direction g in spherical harmonics Y_lm, and compress them.
 *
 * - A grid holds the directions of a quadrature rule on the sphere.
 * - The transform computes C_i,lm = integral of F_i(g) Y_lm(g) over the sphere.
 * - Usually, many functions are sums of a few. If F_i(g) is the sum over r of P_i,r w_r(g), only
 * the weights w_r(g) need expansion: C = P Q, where row r of Q holds the coefficients of w_r. The
 *   matrix C is therefore stored as a product, C = columns x functions. Here, a row i is a vertex
 * or one coordinate of a vertex, a column is its value for one direction, and g is a direction of
 *   gravity; nothing in this folder depends on that.
 * - A function may also depend on a scalar t, -1 to 1: then each harmonic stands for its products
 *   with the Chebyshev polynomials T_0(t) to T_order(t) (supine_sh_evaluate_products).
 * - An expansion is compressed to K functions of the direction, its modes: the first harmonics, as
 *   [Santhanam2008] does, or the K functions that give the least squared error. */
#ifndef SUPINE_EXPANSION_H
#define SUPINE_EXPANSION_H

#include <stddef.h>
#include <stdlib.h>

#include <supine/sh.h>
#include <supine/status.h>

/** Largest number of latitudes, and of longitudes, of a quadrature rule on the sphere. */
#define SUPINE_SH_GRID_MAX 16384

/** A quadrature rule on the sphere. Its node (j, k) is the direction with cos(colatitude) = z[j]
 * and longitude 2 pi k / longitudes. The weight of the node is weight[j] * 2 pi / longitudes. */
typedef struct supine_sh_grid {
  size_t latitudes;
  size_t longitudes;
  double *z;      /**< [latitudes] Gauss-Legendre nodes, descending: from +z to -z */
  double *weight; /**< [latitudes] Gauss-Legendre weights, summing to 2 */
} supine_sh_grid;

/** Create a quadrature rule on the sphere with these numbers of latitudes and longitudes, 1 to
 * SUPINE_SH_GRID_MAX each. It integrates products of two spherical harmonics of degrees up to L
 * exactly if latitudes > L and longitudes > 2 L.
 * @param grid  written, NULL on failure; free it with supine_sh_grid_destroy */
supine_status supine_sh_grid_create(size_t latitudes, size_t longitudes, supine_sh_grid **grid);

/** Create a rule that is fine enough for functions with kinks: 8 latitudes for each degree up to
 * `band`, at least 32, and twice as many longitudes. */
supine_status supine_sh_grid_for_kinks(size_t band, supine_sh_grid **grid);

/** Free a quadrature rule. NULL is allowed. */
void supine_sh_grid_destroy(supine_sh_grid *grid);

/** Compute the unit vector of the quadrature node at latitude j and longitude k. */
void supine_sh_grid_direction(const supine_sh_grid *grid, size_t j, size_t k, double direction[3]);

/** Transform real fields on a grid: coefficient(l, m) = integral over all directions g of value(g)
 * Y(l, m)(g), by the quadrature rule of the grid. Coefficients are exact to rounding if a field has
 * no harmonics of degrees above the band, which cause aliasing. Thread-safe, unless the program
 * itself uses FFTW's planner at the same time.
 * @param band          0 to SUPINE_SH_BAND_MAX; the grid needs latitudes > band, longitudes > 2
 * band
 * @param values        [latitudes, longitudes, fields] value of each field at each direction
 * @param coefficients  [fields, (band + 1)^2] output */
supine_status supine_sh_transform(size_t band, const supine_sh_grid *grid, size_t fields,
                                  const double *values, double *coefficients, supine_error *error);

typedef struct supine_expansion {
  size_t row_count;  /**< N */
  size_t band;       /**< highest degree of the harmonics */
  size_t order;      /**< highest degree of the polynomials of t; 0 if rows do not depend on t */
  size_t rank;       /**< number of functions whose sums are all rows */
  double *columns;   /**< [row_count, rank] P: weight of each function in each row */
  double *functions; /**< [rank, terms] Q: coefficients of each function */
} supine_expansion;

/** Return the number of products of a harmonic and a polynomial: (band + 1)^2 (order + 1). */
static inline size_t supine_sh_terms(size_t band, size_t order) {
  return supine_sh_count(band) * (order + 1);
}

static inline void supine_sh_expansion_free(supine_expansion *expansion) {
  free(expansion->columns);
  free(expansion->functions);
  *expansion = (supine_expansion){0};
}

/** Largest number of modes of a compression. */
enum { SUPINE_MODES_MADE_MAX = 64 };

/** Rows compressed to K modes, functions of the direction g: F_i(g) of row i is about sum over k of
 * coefficients[i, k] sum over lm of modes[k, lm] Y_lm(g), with spherical harmonics Y_lm. */
typedef struct supine_compression {
  size_t row_count;
  size_t band;
  size_t order;
  size_t mode_count;
  float *coefficients; /**< [row_count, mode_count] coefficient of each mode in each row */
  double *modes;       /**< [mode_count, terms] coefficients of each mode */
  double *mix; /**< [rank, mode_count] matrix: coefficients = (supine_expansion.columns) mix */
} supine_compression;

void supine_sh_compression_free(supine_compression *compression);

/** Use the harmonics, times polynomials if order is not 0, at most SUPINE_MODES_MADE_MAX, as modes,
 * as [Santhanam2008]. */
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

/** Compute the value of each mode at the unit vector g, weights [mode_count]. Modes that depend on
 * t take it as 0. */
void supine_sh_compression_weights(const supine_compression *compression, const double g[3],
                                   double *weights);

/** Compute the value of each mode at the unit vector g and the scalar t, weights [mode_count]. */
void supine_sh_compression_weights_at(const supine_compression *compression, const double g[3],
                                      double t, double *weights);

#endif
