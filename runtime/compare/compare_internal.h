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
  double *gram; /**< [G, K, K], mm^2 */
  double *sum;  /**< [K, K] the lungs' Gram matrices together */
};

/** q^T G p of K weights each. */
double supine_compare_product(const double *gram, const double *q, const double *p, size_t count);

#endif
