/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Compute the force that gravity and breath apply to the vertices, (18) for any orientation,
 * and the directions of displacement of the vertices, (15)-(17).
 *
 * With gravity along the unit vector g, the force f_i on vertex i at p_i depends on h_i, which
 * grows from 0 at the uppermost to 1 at the lowest vertex of all lungs:
 *
 *     h_i(g) = (g.p_i - min_j g.p_j) / (max_j g.p_j - min_j g.p_j)
 *     f_i(g) = (base + gain h_i(g) + cx X_i + cy Y_i + cz Z_i) exp(soften (h_i(g) - mean h(g)))
 *
 * X, Y and Z are the box coordinates of lungs.h. If soften > 0, the exponential makes lower tissue
 * more expandable, like a factor on a = 1/E (equilibrium.h). Its geometric mean is 1. */
#ifndef SUPINE_FORCE_H
#define SUPINE_FORCE_H

#include "precompute/lungs/lungs.h"

/** Dimensionless constants of the force f. */
typedef struct supine_force_law {
  double base;
  double gain;   /**< factor of the height h */
  double box[3]; /**< factors cx, cy, cz of the box coordinates */
  double soften; /**< exponent that softens lower tissue; needs a reach (model.h) */
  bool pair;     /**< whether the heights of a single lung also span its mirror image */
} supine_force_law;

/** Find the smallest and the largest height g.p of all vertices p, in mm, for each of `count`
 * directions g [count, 3], into minimum [count] and maximum [count]. Uses all cores.
 * @param pair  whether to extend a single lung by its mirror image (supine_force_law)
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_height_range(const supine_lungs *lungs, bool pair, size_t count,
                                          const double *directions, double *minimum,
                                          double *maximum);

/** Directions of gravity and the range of heights along each; arrays are owned by the caller. */
typedef struct supine_gravities {
  size_t count;
  const double *directions; /**< [count, 3] unit vectors g */
  const double *minimum;    /**< [count] smallest g.p, mm (supine_physics_height_range) */
  const double *maximum;    /**< [count] largest g.p, mm */
} supine_gravities;

/** Compute the force f on the given vertices for every direction of gravity, into force
 * [vertex_count, gravities->count]. Uses all cores.
 * @param vertices  [vertex_count] indices, or NULL for all vertices */
void supine_physics_force(const supine_lungs *lungs, const supine_force_law *law,
                          const supine_gravities *gravities, size_t vertex_count,
                          const size_t *vertices, double *force);

/** Directions d of displacement: d = (+-c1 X^c2, -c3 Y^c4, -c5 Z^c6) mm by (15)-(17), with + in the
 * left lung, or directions fitted to a patient. */
typedef struct supine_direction_law {
  double c[6];           /**< c1 to c6 (model.h) */
  const double *vectors; /**< [N, 3] mm, which replace c, or NULL; owned by the caller */
} supine_direction_law;

/** Compute the directions d of all vertices into directions [N, 3], mm, not normalised.
 * @retval SUPINE_ERROR_ARGUMENT  a constant that is not finite, or an exponent that is not
 *   positive
 * @retval SUPINE_ERROR_MESH      every direction is zero */
supine_status supine_physics_directions(const supine_lungs *lungs, const supine_direction_law *law,
                                        double *directions, supine_error *error);

#endif
