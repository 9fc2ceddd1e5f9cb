/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Exchange forces in the network of masses and springs of [Santhanam2008] III-E. The nodes are a
 * mass at each vertex and a spring at the midpoint of each edge. A spring is linked to the two
 * masses of its edge. Each node keeps a share of the force that reaches it, and passes the rest to
 * its neighbours.
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
 * The matrix is symmetric and positive definite.
 *
 * [Santhanam2008] A. P. Santhanam, C. Imielinska, P. Davenport, P. Kupelian, J. P. Rolland,
 * "Modeling Real-Time 3-D Lung Deformations for Medical Visualization", IEEE Trans. Inf. Technol.
 * Biomed. 12(2), 2008. */
#ifndef SUPINE_NETWORK_H
#define SUPINE_NETWORK_H

#include "precompute/lungs/lungs.h"

/** The linear equations for the network of one surface. Not thread-safe. */
typedef struct supine_network supine_network;

/** Assemble the equations of a surface whose stiffness is 1 everywhere but in lesions.
 * @param topology  edges of the mesh; must outlive the network
 * @param lesions   [vertices] factors on the normalised stiffness in lesions, or NULL; copied
 * @param network   written; release with supine_physics_network_destroy, also after an error */
supine_status supine_physics_network_create(const supine_mesh *mesh,
                                            const supine_topology *topology, const double *lesions,
                                            supine_network **network, supine_error *error);
void supine_physics_network_destroy(supine_network *network);

/** Replace the vertex positions and the stiffness. This is faster than creating a new network.
 * @param stiffness  as for supine_physics_network_set_stiffness */
supine_status supine_physics_network_set_shape(supine_network *network, const supine_mesh *mesh,
                                               const double *stiffness, supine_error *error);

/** Set the stiffness of the vertices. It changes the matrix, which the next solve factorises again.
 * @param stiffness  [vertices] above 0, scaled to a geometric mean of 1; NULL for 1 everywhere */
supine_status supine_physics_network_set_stiffness(supine_network *network, const double *stiffness,
                                                   supine_error *error);

/** Compute the force F that each vertex keeps, for each of `count` applied forces f.
 * @param force     [vertices, count] applied forces
 * @param retained  [vertices, count] written; may be `force` */
supine_status supine_physics_network_solve(supine_network *network, size_t count,
                                           const double *force, double *retained,
                                           supine_error *error);

/** Find the force [vertices] to apply so that each vertex keeps the force retained [vertices]. */
supine_status supine_physics_network_force(supine_network *network, const double *retained,
                                           double *force, supine_error *error);

/** Run the Pitcher/Catcher iteration of [Santhanam2008]. The nodes are the N vertices and the edges
 * of a mesh. The Pitcher of a node is the force that the node has yet to distribute. In each step,
 * the node with the largest Pitcher keeps a share of it and passes the rest to its neighbours. The
 * iteration ends when no Pitcher exceeds `tolerance` > 0 times the largest applied force. It is
 * slow and serves only to test supine_physics_network_solve.
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

/** Return half the length of the edge between two vertices, in mm, but at least 1. */
double supine_physics_link_distance(const double *first, const double *second);

#endif
