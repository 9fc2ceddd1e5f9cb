/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Smooth a force over a surface. In the network of masses and springs (network.h), a mass with more
 * edges keeps a smaller share, so results change as the mesh is refined. With a smoothing length
 * (reach) R in mm, these equations apply instead:
 *
 *     area_i F_i + sum over edges ij of (w_ij / 2) (F_i - F_j) = area_i f_i
 *
 *     area_i  area of vertex i divided by the mean vertex area
 *     w_ij    weight of edge ij: (R^2 / mean vertex area) (cot a + cot b), with the angles a and b
 *             opposite the edge in its two triangles
 *
 * They are the linear finite elements of (1 - R^2 Laplacian) F = f on the surface. On any mesh, a
 * disturbance decays as exp(-r / R) with the distance r, and a linear force on a flat part stays as
 * it is: weights that are never negative would add roughness to it, which turns thin triangles over
 * in small lungs. The sum of area_i F_i equals the sum of area_i f_i.
 * Stiffness does not change F, but the displacement (strain.h).
 *
 * The matrix is symmetric and positive definite. */
#ifndef SUPINE_SMOOTHING_H
#define SUPINE_SMOOTHING_H

#include "precompute/lungs/lungs.h"

/** The linear equations for the smoothing on one surface. Not thread-safe. */
typedef struct supine_smoothing supine_smoothing;

/** Assemble the equations of a surface.
 * @param topology   edges of the mesh; must outlive the smoothing
 * @param reach      smoothing length R, mm, at least 0
 * @param smoothing  written; release with supine_physics_smoothing_destroy, also after an error */
supine_status supine_physics_smoothing_create(const supine_mesh *mesh,
                                              const supine_topology *topology, double reach,
                                              supine_smoothing **smoothing, supine_error *error);
void supine_physics_smoothing_destroy(supine_smoothing *smoothing);

/** Replace the vertex positions and the smoothing length. This is faster than creating a new
 * smoothing. */
void supine_physics_smoothing_set_shape(supine_smoothing *smoothing, const supine_mesh *mesh,
                                        double reach);

/** Compute the smoothed force F for each of `count` applied forces f.
 * @param force     [vertices, count] applied forces
 * @param smoothed  [vertices, count] written; may be `force` */
supine_status supine_physics_smoothing_solve(supine_smoothing *smoothing, size_t count,
                                             const double *force, double *smoothed,
                                             supine_error *error);

/** Find the force [vertices] that, smoothed, becomes smoothed [vertices].
 * @param force  written; must not be `smoothed` */
void supine_physics_smoothing_force(supine_smoothing *smoothing, const double *smoothed,
                                    double *force);

#endif
