/* SPDX-License-Identifier: MIT */
/** @file
 * A comparison, for the files of this folder. */
#ifndef SUPINE_RUNTIME_COMPARE_INTERNAL_H
#define SUPINE_RUNTIME_COMPARE_INTERNAL_H

#include <supine/compare.h>

#include "runtime/internal.h"

struct supine_compare {
  const supine_basis *basis;
  double area;  /**< mm^2 */
  float *share; /**< [N] a_i, the fraction of the area that belongs to vertex i */
  double *gram; /**< [G, 3, K, K] Gram matrices of lungs and axes, mm^2 */
  double *sum;  /**< [K, K] the sum of all Gram matrices, mm^2 */
};

/** Compute the mean square, mm^2, of the displacement for products q [G, 3, K] of gains and
 * weights.
 */
double supine_compare_square(const supine_compare *compare, const double *q);

/** Compute the products q [G, 3, K] of the gains and weights of a pose, less those of `from` unless
 * it is NULL. */
void supine_compare_state(const supine_compare *compare, const supine_pose *pose,
                          const supine_pose *from, double *q);

#endif
