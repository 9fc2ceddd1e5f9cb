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
  float *share; /**< [N] a_i, the fraction of the area that a vertex stands for */
  double *gram; /**< [G, 3, K, K] Gram matrices of lungs and axes, mm^2 */
  double *sum;  /**< [K, K] the sum of all */
};

/** Compute the mean square of the displacement with q [G, 3, K] = gains x weights, mm^2. */
double supine_compare_square(const supine_compare *compare, const double *q);

/** Compute q [G, 3, K] of a pose, minus that of `from` unless it is NULL. */
void supine_compare_state(const supine_compare *compare, const supine_pose *pose,
                          const supine_pose *from, double *q);

#endif
