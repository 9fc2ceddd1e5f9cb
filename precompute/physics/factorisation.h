/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Solve A t = b, where A is symmetric and positive definite, with a row for each vertex of a mesh
 * and an element off the diagonal for each edge. CHOLMOD factorises A once and then solves for any
 * number of right-hand sides b. Parts of the mesh without edges between them, such as two lungs,
 * are solved in parallel. */
#ifndef SUPINE_FACTORISATION_H
#define SUPINE_FACTORISATION_H

#include "mesh/mesh.h"

/** A matrix and its Cholesky factor. Not thread-safe. */
typedef struct supine_factorisation supine_factorisation;

/** Allocate a matrix with the pattern of a mesh. Set its elements with
 * supine_physics_factorisation_set before all other calls.
 * @param topology       edges of the mesh; must outlive the factorisation
 * @param factorisation  written; release with supine_physics_factorisation_destroy */
supine_status supine_physics_factorisation_create(const supine_topology *topology,
                                                  size_t vertex_count,
                                                  supine_factorisation **factorisation,
                                                  supine_error *error);
void supine_physics_factorisation_destroy(supine_factorisation *factorisation);

/** Set the elements of the matrix. The next solve factorises it.
 * @param diagonal  [vertices] elements A_ii
 * @param coupling  [edges] elements A_ij = A_ji of the edges ij, times -1 */
void supine_physics_factorisation_set(supine_factorisation *factorisation, const double *diagonal,
                                      const double *coupling);

/** Solve A t = b for `count` right-hand sides. The Cholesky factor takes about 40 N log2 N bytes
 * for a part of N vertices. It is kept for the next solve, unless the first part has more than
 * 40000 vertices: solve for all right-hand sides in one call.
 * @param right     [vertices, count] right-hand sides b
 * @param solution  [vertices, count] solutions t, written; may be `right`
 * @return SUPINE_ERROR_NUMERICAL if the matrix is not positive definite, or if the residual is not
 *   small, as after right-hand sides that are not finite */
supine_status supine_physics_factorisation_solve(supine_factorisation *factorisation, size_t count,
                                                 const double *right, double *solution,
                                                 supine_error *error);

/** Compute the product A t.
 * @param vector   [vertices] t
 * @param product  [vertices] A t, written; must not be `vector` */
void supine_physics_factorisation_multiply(supine_factorisation *factorisation,
                                           const double *vector, double *product);

#endif
