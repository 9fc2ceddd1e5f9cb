/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Biharmonic interpolation: the function u with given values at points p_j (the centres),
 *
 *     u(x) = sum over j of w_j |x - p_j|  +  a + b . x,    sum w_j = 0, sum w_j p_j = 0
 *
 * The weights w_j, the constant a and the vector b follow from the given values. Among all
 * functions with these values, u minimises the integral over space of the squared second
 * derivatives. Affine functions are reproduced exactly. */
#ifndef SUPINE_INSIDE_BIHARMONIC_H
#define SUPINE_INSIDE_BIHARMONIC_H

#include <stddef.h>

#include <supine/status.h>

#include "base/arena.h"

/** An interpolant of given values. Zero-initialise; release with supine_inside_biharmonic_free,
 * also after an error. */
typedef struct supine_inside_biharmonic {
  supine_arena arena; /**< holds the arrays */
  size_t count;       /**< number of centres: input points at which the function is exact */
  size_t columns;     /**< number of components of the function: 3 for a vector */
  size_t *chosen;     /**< [count] indices of the input points chosen as centres, in that order */
  double *centres;    /**< [count, 3] positions of the centres minus `middle`, divided by `unit` */
  double *weights; /**< [columns, count + 4] factor of each centre's distance, then of 1, x, y, z */
  double middle[3]; /**< centre of the bounding box of the input points, mm */
  double unit;      /**< half the diagonal of the bounding box of the input points, mm */
  double spacing;   /**< largest distance from an input point to its nearest centre, mm */
} supine_inside_biharmonic;

/** Choose at most `centre_max` of the points as centres, each as far as possible from the earlier
 * centres, and find the function that has the given values at the centres.
 *
 * @param points  [count, 3] mm
 * @param values  [count, columns] value of each component at each point
 * Cost: count x M distances to choose M centres; M^3 / 6 multiplications to factorise a matrix of
 * 8 M^2 bytes, of which half are used. */
supine_status supine_inside_biharmonic_fit(size_t count, const double *points, size_t columns,
                                           const double *values, size_t centre_max,
                                           supine_inside_biharmonic *fit, supine_error *error);
void supine_inside_biharmonic_free(supine_inside_biharmonic *fit);

/** Evaluate the interpolating function.
 * @param points  [count, 3] mm
 * @param values  [count, columns] output: value of each component at each point
 *
 * Cost: a square root and `columns` multiplications for each pair of a point and a centre. */
void supine_inside_biharmonic_evaluate(const supine_inside_biharmonic *fit, size_t count,
                                       const double *points, double *values);

#endif
