/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Solve the physics of [Santhanam2008] III-E: masses at the vertices of a surface and springs at
 * the midpoints of its edges exchange force until they are in equilibrium.
 *
 * Masses and springs are the nodes of a graph. A spring is linked to the two masses of its edge.
 *
 *     E          stiffness of a mass; for a spring, the mean stiffness of its two masses
 *     S_j        weight of node j: 1/E for a mass, E for a spring
 *     D(i, j)    distance between the nodes i and j in mm, at least 1; D(j, j) = 1
 *     clique(j)  node j and its neighbours
 *     Z_j        sum over l in clique(j) of S_l / D(l, j)
 *     f_j, x_j   force applied to node j, and total force that reaches it, also from neighbours
 *     Te[j->i]   share of x_j that node j passes to its neighbour i; it keeps the share Te[j->j]
 *     F_j        force that node j keeps (its catch), which is the result
 *
 *     Te[j->i] = S_i / (D(j, i) Z_j), which sums to 1 over i                   (8), (3)
 *     x = f + A x,  A[i, j] = Te[j->i] for i != j;    F_i = Te[i->i] x_i       (5), (12)-(14)
 *
 * The substitution x_j = Z_j S_j t_j makes the matrix symmetric. Eliminating the springs exactly
 * leaves one unknown t_i for each mass. With D = D(i, l) for the spring l of an edge ij,
 *
 *     mass_i t_i + sum over edges ij of c_ij (t_i - t_j) = f_i,     F_i = S_i^2 t_i
 *     c_ij = S_i S_j / (D (D + 2 S_i S_j))
 *     mass_i = S_i^2 + sum over edges ij of (S_i + S_j) / (2 S_j (D + 2 S_i S_j))
 *
 * The matrix is symmetric and positive definite; CHOLMOD factorises it once and then solves for any
 * number of forces.
 *
 * In this transfer of force, a mass with more edges keeps a smaller share, so results change as the
 * mesh is refined. A smoothing length R > 0 in mm, called the reach, removes this dependence. It
 * gives a mass the weight area_i, the area of its vertex divided by the mean area, and an edge ij
 * the weight w_ij. Instead of changing these weights, the stiffness divides the applied force:
 *
 *     area_i F_i + sum over edges ij of (w_ij / 2) (F_i - F_j) = area_i a_i f_i
 *     a_i = 1/E_i,    w_ij = 4 (R^2 / mean area) s / h^2
 *
 * where h is the length of the edge, and s is the sum of a third of the area of each triangle at
 * the edge. These equations are a discrete form of (1 - R^2 Laplacian) F = a f on the surface. On
 * any mesh, a disturbance decays as exp(-r / R) with the distance r, and in a region wider than R,
 * F is about a f. The sum of area_i F_i equals the sum of area_i a_i f_i.
 *
 * [Santhanam2008] A. P. Santhanam, C. Imielinska, P. Davenport, P. Kupelian, J. P. Rolland,
 * "Modeling Real-Time 3-D Lung Deformations for Medical Visualization", IEEE Trans. Inf. Technol.
 * Biomed. 12(2), 2008. */
#ifndef SUPINE_EQUILIBRIUM_H
#define SUPINE_EQUILIBRIUM_H

#include "precompute/lungs/lungs.h"

/** The linear equations for the equilibrium of one surface. Not thread-safe. */
typedef struct supine_equilibrium supine_equilibrium;

/** Assemble the equations of a surface whose stiffness is 1 everywhere but in lesions.
 * @param mesh      [N] vertices in mm
 * @param topology  edges of the mesh; must outlive the equilibrium
 * @param reach     smoothing length R, mm; 0 for the transfer of force of [Santhanam2008]
 * @param lesions   [N] factors by which lesions multiply the normalised stiffness, or NULL; copied
 * @param equilibrium  written; release with supine_physics_equilibrium_destroy
 * @retval SUPINE_ERROR_MEMORY
 * @retval SUPINE_ERROR_UNSUPPORTED  CHOLMOD is not installed */
supine_status supine_physics_equilibrium_create(const supine_mesh *mesh,
                                                const supine_topology *topology, double reach,
                                                const double *lesions,
                                                supine_equilibrium **equilibrium,
                                                supine_error *error);
void supine_physics_equilibrium_destroy(supine_equilibrium *equilibrium);

/** Replace the vertex positions, the reach and the stiffness of an equilibrium. This is faster than
 * creating a new equilibrium.
 * @param reach  smoothing length, mm; may be above 0 only if it was above 0 at creation
 * Statuses as supine_physics_equilibrium_set_stiffness. */
supine_status supine_physics_equilibrium_set_shape(supine_equilibrium *equilibrium,
                                                   const supine_mesh *mesh, double reach,
                                                   const double *stiffness, supine_error *error);

/** Set the stiffness of the vertices. If the smoothing length (reach) is 0, this changes the
 * matrix, which the next solve factorises again.
 * @param stiffness  [N] E > 0, which is scaled to a geometric mean of 1; NULL for 1 everywhere
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness, named in `error`, is not positive and finite */
supine_status supine_physics_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                                       const double *stiffness,
                                                       supine_error *error);

/** Compute the catch F, the force that each of the N vertices keeps in equilibrium, for each of
 * `count` applied forces f. The first solve factorises the matrix. The Cholesky factor takes about
 * 40 N log2 N bytes and is kept for the next solve, but not for a lung of more than 100000
 * vertices: solve for all forces in one call.
 * @param force     [N, count] f, applied to the vertices
 * @param catch_    [N, count] F, written; may be `force`
 * @retval SUPINE_ERROR_MEMORY
 * @retval SUPINE_ERROR_NUMERICAL  a force that is not finite, or a relative residual above 1e-8 */
supine_status supine_physics_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                               const double *force, double *catch_,
                                               supine_error *error);

/** Find the applied force [N] that lets the N vertices keep the force catch_ [N] in equilibrium
 * ([Santhanam2008] IV-B.3).
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_equilibrium_force(supine_equilibrium *equilibrium,
                                               const double *catch_, double *force,
                                               supine_error *error);

/** Compute column [N] of the transfer matrix of [Santhanam2008] (2): the force that each of the N
 * vertices keeps in equilibrium if a unit force is applied to `vertex`.
 * @retval SUPINE_ERROR_ARGUMENT  no such vertex */
supine_status supine_physics_transfer_column(supine_equilibrium *equilibrium, size_t vertex,
                                             double *column, supine_error *error);

/** Run the Pitcher/Catcher iteration of [Santhanam2008] for N masses. The Pitcher of a node is the
 * force that the node has yet to distribute. In each step, the node with the largest Pitcher keeps
 * a share of it and passes the rest to its neighbours. The iteration ends when no Pitcher exceeds
 * `tolerance` times the largest applied force. It is slow and serves only to test
 * supine_physics_equilibrium_solve at a reach of 0.
 *
 * @param stiffness  [N] E > 0, which is scaled to a geometric mean of 1; NULL for 1 everywhere
 * @param force      [N] force applied to each mass
 * @param masses     [N] force that each mass keeps, written
 * @param progress   called at the beginning and after every N steps, with the number of steps and
 *   the sum of |Pitcher| over all nodes divided by the sum of |force|; may be NULL
 * @param tolerance  above 0
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness is not positive and finite
 * @retval SUPINE_ERROR_MEMORY */
supine_status
supine_physics_pitcher_catcher(const supine_mesh *mesh, const supine_topology *topology,
                               const double *stiffness, const double *force, double tolerance,
                               double *masses,
                               void (*progress)(void *context, size_t steps, double remaining),
                               void *context, supine_error *error);

/** Scale a stiffness [count] to a geometric mean of 1, into scaled [count]. If `stiffness` is NULL,
 * set all elements of `scaled` to 1.
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness, named in `error`, is not positive and finite */
supine_status supine_physics_stiffness_normalise(size_t count, const double *stiffness,
                                                 double *scaled, supine_error *error);

/** Compute the distance from a mass at an end of an edge to the spring at the midpoint: half the
 * length of the edge in mm, at least 1. */
double supine_physics_link_distance(const double *first, const double *second);

#endif
