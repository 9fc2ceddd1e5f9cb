/* SPDX-License-Identifier: MIT */
/** @file
 * What a comparison holds, for the files compare*.c. */
#ifndef SUPINE_RUNTIME_COMPARE_INTERNAL_H
#define SUPINE_RUNTIME_COMPARE_INTERNAL_H

#include <supine/compare.h>

#include "runtime/internal.h"

struct supine_compare {
  const supine_basis *basis;
  double area;  /**< mm^2 */
  float *share; /**< [N] a_i: each vertex's share of the area */
  double *gram; /**< [G, 3, K, K] of each axis, mm^2 */
  double *sum;  /**< [K, K] all of them together */
};

/** Squared RMS distance of the displacement q [G, 3, K] = gains x weights from 0, mm^2. */
double supine_compare_square(const supine_compare *compare, const double *q);

/** q [G, 3, K] of a pose; less that of `from` where it is not NULL. */
void supine_compare_state(const supine_compare *compare, const supine_pose *pose,
                          const supine_pose *from, double *q);

#endif
