/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Solve the physics of [Santhanam2008] III-E: masses at the vertices of a surface and springs at
 * the midpoints of its edges exchange force until they are in equilibrium.
 *
 * Masses and springs are the nodes of a graph. The number S of a node weights the force that it
 * receives: S = 1/E for a mass of stiffness E, and S = E for a spring, where E is the mean
 * stiffness of its two masses. D(i, j) is the distance of two nodes in mm, at least 1, and D(j, j)
 * = 1. clique(j) is node j with its neighbours. f_j is the force applied to node j, and x_j the
 * total force that reaches it. Node j passes the share Te[j->i] of x_j to its neighbour i, and
 * keeps the share Te[j->j]. With Z_j = sum over l in clique(j) of S_l / D(l, j),
 *
 *     Te[j->i] = S_i / (D(j, i) Z_j), which sums to 1 over i                   (8), (3)
 *     x = f + A x,  A[i, j] = Te[j->i] for i != j;    F_i = Te[i->i] x_i       (5), (12)-(14)
 *
 * The result is the catch F, the force that each node keeps. The substitution y = x / Z eliminates
 * the springs exactly. The substitution y = S t leaves one unknown t for each mass, and makes the
 * matrix a diagonal matrix plus a graph Laplacian. With D the distance from a mass to the spring of
 * its edge ij,
 *
 *     mass_i t_i + sum over edges ij of c_ij (t_i - t_j) = f_i,     F_i = S_i^2 t_i
 *     c_ij = S_i S_j / (D (D + 2 S_i S_j))
 *     mass_i = S_i^2 + sum over edges ij of (S_i + S_j) / (2 S_j (D + 2 S_i S_j))
 *
 * The matrix is symmetric and positive definite; CHOLMOD factorises it once and then solves for any
 * number of forces.
 *
 * In this transfer of force, a mass with more edges keeps a smaller share, so results change as the
 * mesh is refined. A length R > 0 in mm, the reach, removes this dependence by other weights. For a
 * mass, 1 / D(j, j) is replaced by area_j, the area of the vertex divided by the mean area; for a
 * spring, by 0. For an edge ij of length h with the spring l, 1 / D(i, l) is replaced by w_ij,
 * where s is a third of the area of the triangles at the edge:
 *
 *     w_ij = 4 (R^2 / mean area) s / h^2
 *
 * The stiffness then acts on the force instead of the edges: the force f_i is multiplied by the
 * expandability a_i = 1/E_i. The matrix depends on the geometry alone:
 *
 *     area_i F_i + sum over edges ij of (w_ij / 2) (F_i - F_j) = area_i a_i f_i
 *
 * This is a discrete form of (1 - R^2 Laplacian) F = a f on the surface: on any mesh, a disturbance
 * decays as exp(-r / R) with the distance r, and a region wider than R moves in proportion to a.
 * The sum of area_i F_i equals the sum of area_i a_i f_i.
 *
 * [Santhanam2008] A. P. Santhanam, C. Imielinska, P. Davenport, P. Kupelian, J. P. Rolland,
 * "Modeling Real-Time 3-D Lung Deformations for Medical Visualization", IEEE Trans. Inf. Technol.
 * Biomed. 12(2), 2008. */
#ifndef SUPINE_EQUILIBRIUM_H
#define SUPINE_EQUILIBRIUM_H

#include "precompute/lungs/lungs.h"

/** The matrix of one surface and its Cholesky factor. Not thread-safe. */
typedef struct supine_equilibrium supine_equilibrium;

/** Assemble the matrix of a surface with a stiffness of 1 everywhere.
 * @param mesh      [N] vertices in mm
 * @param topology  edges of the mesh; must outlive the equilibrium
 * @param reach     R in mm, or 0 for the transfer of the paper
 * @param lesions   [N] factors that multiply the normalised stiffness, or NULL; copied
 * @param equilibrium  written; release with supine_physics_equilibrium_destroy
 * @retval SUPINE_ERROR_MEMORY
 * @retval SUPINE_ERROR_UNSUPPORTED  CHOLMOD is not installed */
supine_status supine_physics_equilibrium_create(const supine_mesh *mesh,
                                                const supine_topology *topology, double reach,
                                                const double *lesions,
                                                supine_equilibrium **equilibrium,
                                                supine_error *error);
void supine_physics_equilibrium_destroy(supine_equilibrium *equilibrium);

/** Update an equilibrium for moved vertices, a reach and a stiffness. This is faster than creating
 * a new one.
 * @param reach  mm; may be above 0 only if it was above 0 at creation
 * Statuses as supine_physics_equilibrium_set_stiffness. */
supine_status supine_physics_equilibrium_set_shape(supine_equilibrium *equilibrium,
                                                   const supine_mesh *mesh, double reach,
                                                   const double *stiffness, supine_error *error);

/** Set the stiffness. Without a reach this changes the matrix, which is then factorised again.
 * @param stiffness  [N] E > 0, which is scaled to a geometric mean of 1; NULL for 1 everywhere
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness that is not positive and finite (vertex named) */
supine_status supine_physics_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                                       const double *stiffness,
                                                       supine_error *error);

/** Compute the catch F for each of `count` applied forces f. The first solve factorises the matrix;
 * the factor takes about 40 N log2 N bytes and is kept for the next solve. The factor of a lung of
 * more than 100000 vertices is not kept: solve for all forces in one call.
 * @param force     [N, count] f on the masses; no force is applied to springs
 * @param catch_    [N, count] F, written; may be `force`
 * @retval SUPINE_ERROR_MEMORY
 * @retval SUPINE_ERROR_NUMERICAL  a force that is not finite, or a relative residual above 1e-8 */
supine_status supine_physics_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                               const double *force, double *catch_,
                                               supine_error *error);

/** Find the applied force f [N] whose catch is F [N], as in [Santhanam2008] IV-B.3.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_equilibrium_force(supine_equilibrium *equilibrium,
                                               const double *catch_, double *force,
                                               supine_error *error);

/** Compute column `vertex` of the transfer matrix T of [Santhanam2008] (2): the catch F [N] for a
 * unit force on that vertex.
 * @retval SUPINE_ERROR_ARGUMENT  no such vertex */
supine_status supine_physics_transfer_column(supine_equilibrium *equilibrium, size_t vertex,
                                             double *column, supine_error *error);

/** Run the Pitcher/Catcher iteration of the paper. A node's Pitcher is the force that it has yet to
 * pass on. In each step, the node with the largest Pitcher distributes it over its clique. The
 * iteration ends when no Pitcher exceeds `tolerance` times the largest |f|. It is slow; tests
 * compare it with supine_physics_equilibrium_solve without a reach.
 *
 * @param stiffness  [N] E > 0, which is scaled to a geometric mean of 1; NULL for 1 everywhere
 * @param force      [N] f
 * @param masses     [N] F of the masses, written
 * @param progress   called at the beginning and after every N steps, with the number of steps and
 *   the sum of |Pitcher| over all nodes divided by the sum of |f|; may be NULL
 * @param tolerance  above 0
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness that is not positive
 * @retval SUPINE_ERROR_MEMORY */
supine_status
supine_physics_pitcher_catcher(const supine_mesh *mesh, const supine_topology *topology,
                               const double *stiffness, const double *force, double tolerance,
                               double *masses,
                               void (*progress)(void *context, size_t steps, double remaining),
                               void *context, supine_error *error);

/** Scale a stiffness [count] to a geometric mean of 1, into scaled [count]. If `stiffness` is NULL,
 * set all elements of `scaled` to 1.
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness that is not positive and finite (vertex named) */
supine_status supine_physics_stiffness_normalise(size_t count, const double *stiffness,
                                                 double *scaled, supine_error *error);

/** Compute the distance from an end of an edge to its spring: half the edge's length in mm, at
 * least 1. */
double supine_physics_link_distance(const double *first, const double *second);

#endif
