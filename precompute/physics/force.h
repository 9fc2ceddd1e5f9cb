/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the force of gravity and breath on each vertex, for any direction of gravity, by equation
 * (18) of [Santhanam2008] (equilibrium.h). Compute the displacement at a force of 1 by (15)-(17).
 *
 * Gravity points along the unit vector g. The force f_i (without a unit) on vertex i at p_i depends
 * on its relative depth h_i, from 0 at the uppermost to 1 at the lowest vertex of all lungs:
 *
 *     h_i(g) = (g.p_i - min_j g.p_j) / (max_j g.p_j - min_j g.p_j)
 *     f_i(g) = (base + gain h_i(g) + cx X_i + cy Y_i + cz Z_i) exp(soften (h_i(g) - mean h(g)))
 *
 * X, Y and Z are coordinates from 0 to 1 in the lungs' bounding box (supine_lungs_box_coordinates).
 * The constants base, gain, cx, cy, cz and soften are given (supine_force_law). If soften > 0, the
 * exponential enlarges the force on lower tissue; its geometric mean over all vertices is 1. */
#ifndef SUPINE_FORCE_H
#define SUPINE_FORCE_H

#include "precompute/lungs/lungs.h"

/** Dimensionless constants of the applied force. */
typedef struct supine_force_law {
  double base;   /**< force on the uppermost vertex (dimensionless), before the terms of `box` and
                    `soften` */
  double gain;   /**< increase of the force from the uppermost to the lowest vertex, due to depth */
  double box[3]; /**< coefficients of a vertex's coordinates (0 to 1) in the lungs' bounding box */
  double soften; /**< logarithm of the factor by which the lowest tissue is softer than the
                    uppermost; unless 0, supine_model.reach must be positive */
  bool pair;     /**< whether to add the mirror image of a single lung to find the lowest vertex */
} supine_force_law;

/** Find the smallest and the largest value of g.p over all vertices p, in mm, for each of `count`
 * directions g [count, 3], into minimum [count] and maximum [count]. Uses all cores.
 * @param pair  whether to add the mirror image of a single lung */
supine_status supine_physics_height_range(const supine_lungs *lungs, bool pair, size_t count,
                                          const double *directions, double *minimum,
                                          double *maximum);

/** Directions of gravity, and the range of heights along each. The caller owns the arrays. */
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

/** Displacement d of each vertex, mm, at a force of 1 (without a unit). Either d is fitted to a
 * patient, or it is (+-c1 X^c2, -c3 Y^c4, -c5 Z^c6), with + in the left lung and - in the right,
 * plus a shear. X, Y and Z are the vertex's coordinates from 0 to 1 in the lungs' bounding box.
 *
 * The shear moves the base to the front and the apex to the back as the lungs fill, without a
 * change of volume. It is fixed to the body, as it was observed in supine patients only:
 *
 *     d_y -= beta (Z - 1/2) D / f(supine),  D: RMS of |f(supine) d| over all vertices, without
 * shear
 */
typedef struct supine_direction_law {
  double shear; /**< beta: displacement along y between apex and base / RMS displacement */
  double c[6]; /**< c1 to c6 of [Santhanam2008] (15)-(17): c1, c3, c5 in mm; c2, c4, c6 exponents */
  const double *vectors; /**< [vertices, 3] displacement per unit force, mm, not owned; NULL to
                            compute it from the constants `c` */
} supine_direction_law;

/** Compute the displacement of each vertex, mm, at a force of 1 into directions [vertices, 3].
 * @param force  law of the applied force, for the shear */
supine_status supine_physics_directions(const supine_lungs *lungs, const supine_force_law *force,
                                        const supine_direction_law *law, double *directions,
                                        supine_error *error);

#endif
