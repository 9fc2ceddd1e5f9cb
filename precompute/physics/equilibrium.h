/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Solve for the equilibrium of forces on a surface. There are two models: the network of masses and
 * springs of [Santhanam2008] III-E, and a smoothing, whose result does not depend on the mesh.
 *
 * Network. The nodes are a mass at each vertex and a spring at the midpoint of each edge. A spring
 * is linked to the two masses of its edge. Each node keeps a share of the force that reaches it,
 * and passes the rest to its neighbours.
 *
 *     E_j       stiffness of a mass; for a spring, the mean stiffness of its two masses
 *     S_j       weight of node j: 1 / E_j for a mass, E_j for a spring
 *     D(i, j)   distance between the nodes i and j in mm, at least 1; D(j, j) = 1
 *     Z_j       sum of S_l / D(l, j) over node j and its neighbours l
 *     f_j, x_j  force applied to node j, and total force that reaches it, also from neighbours
 *     T(j, i)   share of x_j that node j passes to its neighbour i; node j keeps the share T(j, j)
 *     F_j       force that node j keeps, which is the result
 *
 *     T(j, i) = S_i / (D(j, i) Z_j), which sums to 1 over i          equations (8), (3)
 *     x_i = f_i + sum of T(j, i) x_j over the neighbours j of i      (5), (12)-(14)
 *     F_i = T(i, i) x_i
 *
 * The substitution x_j = Z_j S_j t_j makes the matrix symmetric. Eliminating the springs exactly
 * leaves one unknown t_i for each mass. With the distance D of mass i from the spring of edge ij,
 *
 *     mass_i t_i + sum over edges ij of c_ij (t_i - t_j) = f_i,     F_i = S_i^2 t_i
 *     c_ij = S_i S_j / (D (D + 2 S_i S_j))
 *     mass_i = S_i^2 + sum over edges ij of (S_i + S_j) / (2 S_j (D + 2 S_i S_j))
 *
 * Smoothing. In the network, a mass with more edges keeps a smaller share, so results change as the
 * mesh is refined. With a smoothing length (reach) R > 0 in mm, these equations apply instead:
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
 * Both matrices are symmetric and positive definite. CHOLMOD factorises a matrix once and then
 * solves for any number of forces.
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
 * @param topology  edges of the mesh; must outlive the equilibrium
 * @param reach     smoothing length R, mm; 0 for the transfer of force of [Santhanam2008]
 * @param lesions   [vertices] factors on the normalised stiffness in lesions, or NULL; copied
 * @param equilibrium  written; release with supine_physics_equilibrium_destroy */
supine_status supine_physics_equilibrium_create(const supine_mesh *mesh,
                                                const supine_topology *topology, double reach,
                                                const double *lesions,
                                                supine_equilibrium **equilibrium,
                                                supine_error *error);
void supine_physics_equilibrium_destroy(supine_equilibrium *equilibrium);

/** Assemble the equations diagonal_i F_i + sum over edges ij of weight_ij (F_i - F_j) = f_i. */
supine_status
supine_physics_equilibrium_create_weighted(const supine_topology *topology, size_t vertex_count,
                                           const double *diagonal, const double *weight,
                                           supine_equilibrium **equilibrium, supine_error *error);

/** Replace the vertex positions, the smoothing length and the stiffness of an equilibrium. This is
 * faster than creating a new equilibrium.
 * @param reach  smoothing length, mm; may be above 0 only if it was above 0 at creation */
supine_status supine_physics_equilibrium_set_shape(supine_equilibrium *equilibrium,
                                                   const supine_mesh *mesh, double reach,
                                                   const double *stiffness, supine_error *error);

/** Set the stiffness of the vertices. It acts only if the smoothing length (reach) is 0, and
 * changes the matrix, which the next solve factorises again.
 * @param stiffness  [vertices] above 0, scaled to a geometric mean of 1; NULL for 1 everywhere */
supine_status supine_physics_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                                       const double *stiffness,
                                                       supine_error *error);

/** Compute the force that each of N vertices retains after exchange with its neighbours, for each
 * of `count` applied forces. The first solve factorises the matrix. The Cholesky factor takes about
 * 40 N log2 N bytes and is kept for the next solve, but not for a lung of more than 100000
 * vertices: solve for all forces in one call.
 * @param force     [vertices, count] applied forces
 * @param retained  [vertices, count] forces that the vertices retain, written; may be `force` */
supine_status supine_physics_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                               const double *force, double *retained,
                                               supine_error *error);

/** Invert supine_physics_equilibrium_solve: find the force [vertices] to apply so that each vertex
 * retains a given force, retained [vertices] ([Santhanam2008] IV-B.3). */
supine_status supine_physics_equilibrium_force(supine_equilibrium *equilibrium,
                                               const double *retained, double *force,
                                               supine_error *error);

/** Apply a unit force to `vertex`, and compute the part of it that remains on each vertex: a column
 * [vertices] of the transfer matrix of [Santhanam2008], equation (2). */
supine_status supine_physics_transfer_column(supine_equilibrium *equilibrium, size_t vertex,
                                             double *column, supine_error *error);

/** Run the Pitcher/Catcher iteration of [Santhanam2008]. The nodes are the N vertices and the edges
 * of a mesh. The Pitcher of a node is the force that the node has yet to distribute. In each step,
 * the node with the largest Pitcher keeps a share of it and passes the rest to its neighbours. The
 * iteration ends when no Pitcher exceeds `tolerance` > 0 times the largest applied force. It is
 * slow and serves only to test supine_physics_equilibrium_solve without smoothing.
 *
 * @param stiffness  [vertices] above 0, scaled to a geometric mean of 1; NULL for 1 everywhere
 * @param force      [vertices] force applied to each vertex
 * @param masses     [vertices] force that each vertex keeps, written
 * @param progress   called at the beginning and after every N steps, with the number of steps and
 *   the sum of |Pitcher| over all nodes divided by the sum of |force|; may be NULL
 * @retval SUPINE_ERROR_NUMERICAL  the iteration has not converged after 100 000 N steps */
supine_status
supine_physics_pitcher_catcher(const supine_mesh *mesh, const supine_topology *topology,
                               const double *stiffness, const double *force, double tolerance,
                               double *masses,
                               void (*progress)(void *context, size_t steps, double remaining),
                               void *context, supine_error *error);

/** Scale a stiffness [count] to a geometric mean of 1, into scaled [count]. If `stiffness` is NULL,
 * set all elements of `scaled` to 1. */
supine_status supine_physics_stiffness_normalise(size_t count, const double *stiffness,
                                                 double *scaled, supine_error *error);

/** Return half the length of the edge between two vertices, in mm, but at least 1. */
double supine_physics_link_distance(const double *first, const double *second);

#endif
