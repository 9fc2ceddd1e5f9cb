/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Biharmonic interpolation: the function u with given values at points p_j,
 *
 *     u(x) = sum over j of w_j |x - p_j|  +  a + B x,    sum w_j = 0, sum w_j p_j = 0
 *
 * whose w_j, a and B follow from the values. Among all functions with these values, u minimises the
 * integral over space of the squared second derivatives. Affine functions are reproduced. */
#ifndef SUPINE_INSIDE_BIHARMONIC_H
#define SUPINE_INSIDE_BIHARMONIC_H

#include <stddef.h>

#include <supine/status.h>

/** Zero-initialise for supine_inside_biharmonic_fit; supine_inside_biharmonic_free frees it. */
typedef struct supine_inside_biharmonic {
  size_t count;     /**< number of centres */
  size_t columns;   /**< number of values per point */
  size_t *chosen;   /**< [count] indices of the centres among the points, in order of choice */
  double *centres;  /**< [count, 3] positions relative to `middle`, divided by `unit` */
  double *weights;  /**< [columns, count + 4] factors of distances from centres and of 1, x, y, z */
  double middle[3]; /**< centre of the points' box, mm */
  double unit;      /**< half the diagonal of the points' box, mm */
  double spacing;   /**< largest distance of any point from the centre nearest to it, mm */
} supine_inside_biharmonic;

/** Choose at most `centre_max` of the points as centres, each as far as possible from the earlier
 * centres, and fit the values at the centres.
 *
 * @param points  [count, 3] mm
 * @param values  [count, columns]
 * @retval SUPINE_ERROR_NUMERICAL  the points lie in one plane
 * @retval SUPINE_ERROR_MEMORY
 * Cost: count x M distances to choose M centres; M^3 / 6 multiplications to factorise a matrix of
 * 8 M^2 bytes, of which half are used. */
supine_status supine_inside_biharmonic_fit(size_t count, const double *points, size_t columns,
                                           const double *values, size_t centre_max,
                                           supine_inside_biharmonic *fit, supine_error *error);
void supine_inside_biharmonic_free(supine_inside_biharmonic *fit);

/** Evaluate the interpolation.
 * @param points  [count, 3] mm
 * @param values  [count, columns], written
 * Cost: a square root and `columns` multiplications for each pair of a point and a centre. */
void supine_inside_biharmonic_evaluate(const supine_inside_biharmonic *fit, size_t count,
                                       const double *points, double *values);

#endif
