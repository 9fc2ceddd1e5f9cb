/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Expand real functions F_i(g) of a direction g in spherical harmonics Y_lm:
 *
 *     C_i,lm = integral of F_i(g) Y_lm(g) over the sphere
 *
 * Usually, many functions are sums of a few. If F_i(g) is the sum over r of P_i,r w_r(g), only the
 * weights w_r(g) need expansion: C = P Q, where row r of Q holds the coefficients of w_r. The
 * matrix C is therefore stored as a product, C = columns x functions. Here, a row i is a vertex or
 * one coordinate of a vertex, a column is its value for one direction, and g is a direction of
 * gravity; nothing in this folder depends on that. */
#ifndef SUPINE_EXPANSION_H
#define SUPINE_EXPANSION_H

#include <stddef.h>
#include <stdlib.h>

typedef struct supine_expansion {
  size_t row_count;  /**< N */
  size_t band;       /**< highest degree of the harmonics */
  size_t rank;       /**< number of functions whose sums are all rows */
  double *columns;   /**< [row_count, rank] P: weight of each function in each row */
  double *functions; /**< [rank, (band + 1)^2] Q: harmonic coefficients of each function */
} supine_expansion;

static inline void supine_sh_expansion_free(supine_expansion *expansion) {
  free(expansion->columns);
  free(expansion->functions);
  *expansion = (supine_expansion){0};
}

#endif
