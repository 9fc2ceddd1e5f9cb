/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Solve the physics of [Santhanam2008] III-E: mass nodes at the vertices, spring nodes at
 * the midpoints of the edges, and the equilibrium of the force that they exchange.
 *
 * With S = 1/E on masses and S = E on springs (the mean of both ends), D the distance in mm (at
 * least 1; D(j, j) = 1) and Z_j = sum over l in clique(j) of S_l / D(l, j):
 *
 *     Te[j->i] = S_i / (D(j, i) Z_j), every column of which sums to 1          (8), (3)
 *     x = f + A x,  A[i, j] = Te[j->i] for i != j;    F_i = Te[i->i] x_i       (5), (12)-(14)
 *
 * Substituting y = x / Z eliminates the springs exactly; y = S t then leaves, with one unknown
 * for each vertex, a mass matrix plus a graph Laplacian:
 *
 *     mass_i t_i + sum over edges ij of c_ij (t_i - t_j) = f_i,     F_i = S_i^2 t_i
 *     c_ij = S_i S_j / (D (D + 2 S_i S_j))
 *     mass_i = S_i^2 + sum over edges ij of (S_i + S_j) / (2 S_j (D + 2 S_i S_j))
 *
 * The matrix is symmetric and positive definite; CHOLMOD factorises it once and then solves for any
 * number of forces.
 *
 * In this transfer the share of force that a mass keeps falls with its number of links, so results
 * change as the mesh is refined. A reach R in mm removes this dependence, by other link weights:
 * the weight 1 / D(j, j) is area_j for a mass, its area over the mean area, and 0 for a spring; and
 * 1 / D(j, l) of the edge with length h is
 *
 *     w = 4 (R^2 / mean area) s / h^2      s: a third of the area of the edge's triangles
 *
 * The stiffness then scales the force instead of the links, so the matrix depends on the geometry
 * alone. With the expandability a = 1/E, a region wider than R moves in proportion to a.
 *
 *     area_i F_i + sum over edges ij of (w_ij / 2) (F_i - F_j) = area_i a_i f_i
 *
 * which is a discrete (1 - R^2 Laplacian) F = a f on the surface, in which a disturbance decays
 * as exp(-r / R) whatever the mesh. The conserved quantity is then area F: sum of area_i F_i =
 * sum of area_i a_i f_i.
 *
 * [Santhanam2008] A. P. Santhanam, C. Imielinska, P. Davenport, P. Kupelian, J. P. Rolland,
 * "Modeling Real-Time 3-D Lung Deformations for Medical Visualization", IEEE Trans. Inf.
 * Technol. Biomed. 12(2), 2008. */
#ifndef SUPINE_EQUILIBRIUM_H
#define SUPINE_EQUILIBRIUM_H

#include "precompute/lungs/lungs.h"

/** The matrix of one surface and its Cholesky factor. Not thread-safe. */
typedef struct supine_equilibrium supine_equilibrium;

/** Assemble the matrix of a surface with a stiffness of 1 everywhere.
 * @param mesh      [N] vertices in mm
 * @param topology  edges of the mesh; must outlive the equilibrium
 * @param reach     R in mm; 0: the paper's springs
 * @param lesions   [N] factors on the normalised stiffness, copied; NULL: 1
 * @param equilibrium  written; release with supine_physics_equilibrium_destroy
 * @retval SUPINE_ERROR_MEMORY
 * @retval SUPINE_ERROR_UNSUPPORTED  CHOLMOD is not installed */
supine_status supine_physics_equilibrium_create(const supine_mesh *mesh,
                                                const supine_topology *topology, double reach,
                                                const double *lesions,
                                                supine_equilibrium **equilibrium,
                                                supine_error *error);
void supine_physics_equilibrium_destroy(supine_equilibrium *equilibrium);

/** Set moved vertices, the reach and the stiffness: faster than creating another equilibrium.
 * @param reach  mm; above 0 only if it was above 0 at creation
 * Statuses as supine_physics_equilibrium_set_stiffness. */
supine_status supine_physics_equilibrium_set_shape(supine_equilibrium *equilibrium,
                                                   const supine_mesh *mesh, double reach,
                                                   const double *stiffness, supine_error *error);

/** Set the stiffness. This changes the matrix if there is no reach.
 * @param stiffness  [N] E > 0, relative: scaled to geometric mean 1; NULL: 1 everywhere
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness that is not positive and finite (vertex named) */
supine_status supine_physics_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                                       const double *stiffness,
                                                       supine_error *error);

/** Solve for the catch F of `count` applied forces. The first solve factorises the matrix; the
 * factor takes about 40 N log2 N bytes and is kept for the next solve. The factor of a lung of more
 * than 100000 vertices is not kept: solve for all forces in one call.
 * @param force     [N, count] f on the masses (nothing is applied to springs)
 * @param catch_    [N, count] F, written; may be `force`
 * @retval SUPINE_ERROR_MEMORY
 * @retval SUPINE_ERROR_NUMERICAL  a force that is not finite, or |b - A t| / |b| above 1e-8, where
 *                                 b is area a f with a reach and f without */
supine_status supine_physics_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                               const double *force, double *catch_,
                                               supine_error *error);

/** Find the force f [N] whose equilibrium is the catch F [N]: f = A t / (area a) with a reach,
 * f = A t without, as in [Santhanam2008] IV-B.3.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_equilibrium_force(supine_equilibrium *equilibrium,
                                               const double *catch_, double *force,
                                               supine_error *error);

/** Compute column `vertex` of the transfer matrix T of (2): the response F [N] to a unit force
 * on that vertex alone.
 * @retval SUPINE_ERROR_ARGUMENT  no such vertex */
supine_status supine_physics_transfer_column(supine_equilibrium *equilibrium, size_t vertex,
                                             double *column, supine_error *error);

/** Run the Pitcher/Catcher iteration of the paper: the node with the largest Pitcher distributes it
 * over its clique, until no Pitcher exceeds `tolerance` times the largest f. Slow, for small
 * meshes: the reference for supine_physics_equilibrium_solve without a reach.
 *
 * @param stiffness  [N] or NULL, as above
 * @param force      [N]
 * @param masses     [N] F of the masses, written
 * @param progress   called at the beginning and after every N distributions, with their number and
 *   the sum of |Pitcher| over all nodes, relative to the sum of |f|; NULL: not wanted
 * @param tolerance  above 0
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness that is not positive
 * @retval SUPINE_ERROR_MEMORY */
supine_status
supine_physics_pitcher_catcher(const supine_mesh *mesh, const supine_topology *topology,
                               const double *stiffness, const double *force, double tolerance,
                               double *masses,
                               void (*progress)(void *context, size_t steps, double remaining),
                               void *context, supine_error *error);

/** Scale a stiffness [N] to geometric mean 1; NULL: 1 everywhere.
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness that is not positive and finite (vertex named) */
supine_status supine_physics_stiffness_normalise(size_t count, const double *stiffness,
                                                 double *scaled, supine_error *error);

/** Compute D(mass, spring) of an edge: half its length in mm, at least 1. */
double supine_physics_link_distance(const double *first, const double *second);

#endif
