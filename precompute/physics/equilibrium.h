/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file The physics of [Santhanam2008] III-E: mass nodes at the vertices, spring nodes at the
 * midpoints of the edges, and the equilibrium of the force they exchange.
 *
 * With S = 1/E on masses and S = E on springs, D the distance (at least 1 mm; 1 to itself) and
 * Z_j = sum over l in clique(j) of S_l / D(l, j):
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
 * It is symmetric, positive definite and well conditioned. Conjugate gradients in single
 * precision with a diagonal preconditioner solve it, corrected in double until the residual
 * meets the tolerance.
 *
 * The transfer spreads over links, and the share that a mass catches falls with its number of
 * links, so results drift as links shrink. A reach R in mm removes this drift. It is the same
 * transfer with other link weights: a mass's weight to itself, above 1 / D(j, j) = 1, is its
 * area over the mean area, area_j; a spring's is 0; and 1 / D(j, l) is
 *
 *     w = 4 (R^2 / mean area) a / h^2      a: a third of the link's triangles' area, h its length
 *
 * The stiffness then scales the force instead of the links, so the matrix depends on the
 * geometry alone: tissue twice as expandable, a = 1/E, moves twice as far where it is wider than
 * R.
 *
 *     area_i F_i + sum over edges ij of (w_ij / 2) (F_i - F_j) = area_i a_i f_i
 *
 * which is a discrete (1 - R^2 Laplacian) F = a f on the surface, in which a disturbance decays
 * as exp(-r / R) whatever the mesh. The conserved quantity is then area F: sum of area_i F_i =
 * sum of area_i a_i f_i. The finer the mesh, the larger the condition number; a multilevel cycle
 * (coarse.h) keeps the number of steps nearly constant.
 *
 * [Santhanam2008] A. P. Santhanam, C. Imielinska, P. Davenport, P. Kupelian, J. P. Rolland,
 * "Modeling Real-Time 3-D Lung Deformations for Medical Visualization", IEEE Trans. Inf.
 * Technol. Biomed. 12(2), 2008. */
#ifndef SUPINE_EQUILIBRIUM_H
#define SUPINE_EQUILIBRIUM_H

#include "precompute/lungs/lungs.h"

/** Most right-hand sides of one solve. */
enum { SUPINE_RHS_MAX = 64 };

/** The geometry of the nodes: links and distances. Read-only after creation, so equilibria in
 * any threads may share it. */
typedef struct supine_network supine_network;

/** Build the network of a surface. Vertices are renumbered internally (breadth first) if the
 * file's order is slow; all functions here use the file's order.
 * @param mesh      [N] vertices in mm
 * @param topology  its edges
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_network_create(const supine_mesh *mesh,
                                            const supine_topology *topology,
                                            supine_network **network);

void supine_physics_network_destroy(supine_network *network);

/** One stiffness on a network, with the work space of its solves. Not thread-safe. */
typedef struct supine_equilibrium supine_equilibrium;

/** @param network   must outlive the equilibrium
 * @param rhs_max   most right-hand sides of one solve, 1 to SUPINE_RHS_MAX
 * @param threads   of one solve; 0: supine_thread_count()
 * @retval SUPINE_ERROR_ARGUMENT, SUPINE_ERROR_MEMORY */
supine_status supine_physics_equilibrium_create(const supine_network *network, size_t rhs_max,
                                                size_t threads, supine_equilibrium **equilibrium);
void supine_physics_equilibrium_destroy(supine_equilibrium *equilibrium);

/** Set the stiffness; without a reach this changes the matrix.
 * @param stiffness  [N] E > 0, relative: scaled here to geometric mean 1; NULL: 1 everywhere
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness that is not positive and finite (vertex named) */
supine_status supine_physics_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                                       const double *stiffness,
                                                       supine_error *error);

/** Result of a solve. */
typedef struct supine_solve_report {
  size_t iterations;
  double residual; /**< the largest of |r| / |b|, of r = b - A t and b = area a f, which were
                      computed in double, each square divided by A's diagonal */
} supine_solve_report;

/** Relative residual used for a tolerance of 0. A basis file resolves 6e-8, and the solve does
 * not magnify errors: F is as accurate as the residual. */
#define SUPINE_SOLVE_TOLERANCE 1e-10

/** Solve for the catch F of `count` applied forces.
 * @param force      [N, count] f on the masses (nothing is applied to springs)
 * @param tolerance  relative residual to stop at; 0: SUPINE_SOLVE_TOLERANCE. The least that
 *   double precision reaches is 1e-14, with a reach some 1e-16 (R / link)^2
 * @param warm       start from catch_ instead of zero
 * @param catch_     [N, count] F, written
 * @param report     optional
 * @retval SUPINE_ERROR_ARGUMENT   count out of range
 * @retval SUPINE_ERROR_NUMERICAL  the residual stopped falling above the tolerance; also if a
 *   force is not finite */
supine_status supine_physics_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                               const double *force, double tolerance, bool warm,
                                               double *catch_, supine_solve_report *report,
                                               supine_error *error);

/** Compute column `vertex` of the transfer matrix T of (2): the response F [N] to a unit force
 * on that vertex alone.
 * @retval SUPINE_ERROR_ARGUMENT  no such vertex */
supine_status supine_physics_transfer_column(supine_equilibrium *equilibrium, size_t vertex,
                                             double *column, supine_error *error);

/** Run the Pitcher/Catcher iteration of the paper: the node that holds most distributes it over
 * its clique, until no node holds more than `tolerance` times the largest f. The reference for
 * supine_physics_equilibrium_solve; slow, for small meshes.
 *
 * @param stiffness  [N] or NULL, as above
 * @param force      [N]
 * @param masses     [N] F of the masses, written
 * @param springs    [edge_count] F of the springs, written; NULL: not wanted
 * @param progress   called after every N distributions with their number and the sum still held
 *   relative to the sum of |f|; NULL: not wanted
 * @retval SUPINE_ERROR_ARGUMENT, SUPINE_ERROR_MEMORY */
supine_status supine_physics_pitcher_catcher(
    const supine_mesh *mesh, const supine_topology *topology, const double *stiffness,
    const double *force, double tolerance, double *masses, double *springs,
    void (*progress)(void *context, size_t steps, double held), void *context, supine_error *error);

#endif
