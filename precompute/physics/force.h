/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Compute the force that gravity and breath apply to the mass nodes, (18) for any
 * orientation, and the directions of displacement of the nodes, (15)-(17).
 *
 *     h_i(g) = (g.p_i - min_j g.p_j) / (max_j g.p_j - min_j g.p_j)      1 where most dependent
 *     f_i(g) = (base + gain h_i(g) + cx X_i + cy Y_i + cz Z_i) exp(soften (h_i(g) - mean h(g)))
 *
 * with X, Y, Z the box coordinates of lungs.h, and min and max over all lungs. If soften > 0,
 * dependent tissue is more expandable: the exponential, whose geometric mean is 1, is a factor of
 * a = 1/E, which multiplies the force in the equilibrium (equilibrium.h). */
#ifndef SUPINE_FORCE_H
#define SUPINE_FORCE_H

#include "precompute/lungs/lungs.h"

/** Constants of the force f, without unit. */
typedef struct supine_force_law {
  double base;
  double gain;   /**< factor of h, the part that depends on gravity */
  double box[3]; /**< cx, cy, cz */
  double soften; /**< softening of dependent tissue; needs a reach (model.h) */
  bool pair;     /**< true: min and max for a single lung include its mirror image in the midline,
                  * so that the lung moves as if beside the other lung */
} supine_force_law;

/** Find the smallest and largest g.p over all vertices, in mm, for each of `count` directions g
 * [count, 3], into minimum [count] and maximum [count]. Uses all cores.
 * @param pair  true: extend a single lung by its mirror image (supine_force_law)
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_height_range(const supine_lungs *lungs, bool pair, size_t count,
                                          const double *directions, double *minimum,
                                          double *maximum);

/** Directions of gravity and the range of heights along each; arrays are owned by the caller. */
typedef struct supine_gravities {
  size_t count;
  const double *directions; /**< [count, 3] unit */
  const double *minimum;    /**< [count] of g.p over the lungs, mm (supine_physics_height_range) */
  const double *maximum;    /**< [count] */
} supine_gravities;

/** Compute f of the given vertices for every direction into force [vertex_count,
 * gravities->count]. Uses all cores.
 * @param vertices  [vertex_count] indices; NULL: all */
void supine_physics_force(const supine_lungs *lungs, const supine_force_law *law,
                          const supine_gravities *gravities, size_t vertex_count,
                          const size_t *vertices, double *force);

/** The direction of displacement: (15)-(17), d = (+-c1 X^c2, -c3 Y^c4, -c5 Z^c6) mm, or directions
 * fitted to a patient. */
typedef struct supine_direction_law {
  double c[6];           /**< c1 to c6 (model.h) */
  const double *vectors; /**< [N, 3] mm, used instead of c unless NULL; owned by the caller */
} supine_direction_law;

/** Compute d [N, 3], mm, not normalised.
 * @retval SUPINE_ERROR_ARGUMENT  a constant that is not finite, or an exponent that is not
 *   positive
 * @retval SUPINE_ERROR_MESH      every direction is zero */
supine_status supine_physics_directions(const supine_lungs *lungs, const supine_direction_law *law,
                                        double *directions, supine_error *error);

#endif
