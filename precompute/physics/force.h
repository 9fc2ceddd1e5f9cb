/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the force of gravity and breath on the vertices, (18) of [Santhanam2008] (equilibrium.h)
 * for any direction of gravity, and the directions of displacement, (15)-(17).
 *
 * With gravity along the unit vector g, the force f_i on vertex i at p_i depends on h_i, which
 * grows from 0 at the uppermost to 1 at the lowest vertex of all lungs:
 *
 *     h_i(g) = (g.p_i - min_j g.p_j) / (max_j g.p_j - min_j g.p_j)
 *     f_i(g) = (base + gain h_i(g) + cx X_i + cy Y_i + cz Z_i) exp(soften (h_i(g) - mean h(g)))
 *
 * X, Y and Z are the box coordinates of lungs.h. If soften > 0, the exponential makes lower tissue
 * more expandable; the geometric mean of the exponential over all vertices is 1. */
#ifndef SUPINE_FORCE_H
#define SUPINE_FORCE_H

#include "precompute/lungs/lungs.h"

/** Dimensionless constants of the applied force f. */
typedef struct supine_force_law {
  double base;
  double gain;   /**< increase of the force from the uppermost to the lowest vertex */
  double box[3]; /**< factors cx, cy and cz of the box coordinates X, Y and Z */
  double soften; /**< softens lower tissue if above 0; requires a positive supine_model.reach */
  bool pair; /**< whether to extend a single lung by its mirror image to find the lowest vertex */
} supine_force_law;

/** Find the smallest and the largest value of g.p over all vertices p, in mm, for each of `count`
 * directions g [count, 3], into minimum [count] and maximum [count]. Uses all cores.
 * @param pair  whether to extend a single lung by its mirror image (supine_force_law)
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_height_range(const supine_lungs *lungs, bool pair, size_t count,
                                          const double *directions, double *minimum,
                                          double *maximum);

/** Directions of gravity g, and for each the range of g.p over all vertices p. The caller owns the
 * arrays. */
typedef struct supine_gravities {
  size_t count;
  const double *directions; /**< [count, 3] unit vectors g */
  const double *minimum;    /**< [count] smallest coordinate of a vertex along each direction, mm */
  const double *maximum;    /**< [count] largest coordinate of a vertex along each direction, mm */
} supine_gravities;

/** Compute the force f on the given vertices for every direction of gravity, into force
 * [vertex_count, gravities->count]. Uses all cores.
 * @param vertices  [vertex_count] indices, or NULL for all vertices */
void supine_physics_force(const supine_lungs *lungs, const supine_force_law *law,
                          const supine_gravities *gravities, size_t vertex_count,
                          const size_t *vertices, double *force);

/** Directions of displacement: d = (+-c1 X^c2, -c3 Y^c4, -c5 Z^c6) in mm, with + in the left lung
 * and box coordinates X, Y and Z (15)-(17), or directions fitted to a patient. */
typedef struct supine_direction_law {
  double c[6];           /**< factors and exponents c1 to c6 of (15)-(17) */
  const double *vectors; /**< [N, 3] fitted to a patient, mm; NULL: use c1 to c6; not owned */
} supine_direction_law;

/** Compute the directions d of all vertices into directions [N, 3], mm, not normalised.
 * @retval SUPINE_ERROR_ARGUMENT  a constant that is not finite, or an exponent that is not
 *   positive
 * @retval SUPINE_ERROR_MESH      every direction is zero */
supine_status supine_physics_directions(const supine_lungs *lungs, const supine_direction_law *law,
                                        double *directions, supine_error *error);

#endif
