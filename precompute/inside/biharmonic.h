/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The biharmonic interpolation of values at scattered points, several columns at once:
 *
 *     u(x) = sum over j of w_j |x - p_j|  +  a + B x,    sum w_j = 0, sum w_j p_j = 0
 *
 * Of all functions through the values it has the least second derivatives, square-integrated over
 * space; affine values come back as they are. */
#ifndef SUPINE_INSIDE_BIHARMONIC_H
#define SUPINE_INSIDE_BIHARMONIC_H

#include <stddef.h>

#include <supine/status.h>

/** Zero-initialise; supine_inside_biharmonic_free releases what fit put there. */
typedef struct supine_inside_biharmonic {
  size_t count;    /**< centres, M */
  size_t columns;  /**< R */
  size_t *chosen;  /**< [M] which of the points are centres, as they were chosen */
  double *centres; /**< [M, 3] in units of `unit` about `middle` */
  double *weights; /**< [R, M + 4]: of the centres, then of 1, x, y, z */
  double middle[3];
  double unit;    /**< mm */
  double spacing; /**< mm from a centre to its nearest others, at most */
} supine_inside_biharmonic;

/** Chooses at most `centre_max` of the points, each the farthest from those before it, and fits the
 * values there.
 *
 * @param points  [count, 3] mm
 * @param values  [count, columns]
 * @retval SUPINE_ERROR_NUMERICAL  the points lie in one plane
 * @retval SUPINE_ERROR_MEMORY
 * Cost: count x M for the choice, 1/6 M^3 multiplications and 4 M^2 bytes for the one
 * factorisation that serves all columns. */
supine_status supine_inside_biharmonic_fit(size_t count, const double *points, size_t columns,
                                           const double *values, size_t centre_max,
                                           supine_inside_biharmonic *fit, supine_error *error);
void supine_inside_biharmonic_free(supine_inside_biharmonic *fit);

/** Values at any points.
 * @param points  [count, 3] mm
 * @param values  [count, columns], written
 * Cost: M (columns + a square root) a point. */
void supine_inside_biharmonic_evaluate(const supine_inside_biharmonic *fit, size_t count,
                                       const double *points, double *values);

#endif
