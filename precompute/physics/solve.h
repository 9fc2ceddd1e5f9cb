/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Solve the full physics for one direction of gravity, without a basis. */
#ifndef SUPINE_SOLVE_H
#define SUPINE_SOLVE_H

#include <supine/volume.h>

#include "precompute/physics/equilibrium.h"
#include "precompute/physics/model.h"

/** Solution for one direction of gravity: displacements u_i = s F_i d_i at scale s. */
typedef struct supine_solution {
  size_t vertex_count;
  supine_equilibrium *equilibrium; /**< matrix of the lungs, kept for their next solve */
  double *catch_;                  /**< [N] catch F (equilibrium.h) */
  double *directions;              /**< [N, 3] directions, mm, for collapsed lungs as in
                                      supine_tissue_collapse_directions */
  double cubic[3]; /**< volume gained at scale s: cubic[0] s + cubic[1] s^2 + cubic[2] s^3, mL */
  supine_volume_form form[2]; /**< volume gained by each lung, mL */
} supine_solution;

/** Solve for gravity along the unit vector `g`.
 * @param solution  zero-initialised, or an earlier solution of the same lungs, whose memory is then
 *   reused; vertices may have moved. After an error it is empty. Release it with
 *   supine_physics_solution_free
 * @retval SUPINE_ERROR_ARGUMENT, SUPINE_ERROR_MESH, SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_physics_solve(const supine_lungs *lungs, const supine_model *model,
                                   const double g[3], supine_solution *solution,
                                   supine_error *error);
void supine_physics_solution_free(supine_solution *solution);

/** Find the largest displacement at scale 1, |F_i d_i|, mm. */
double supine_physics_solution_largest(const supine_solution *solution);

/** Compute positions [N, 3] p + s F d, mm.
 * @param reference  p: the lungs' mesh; for collapsed lungs the surface of supine_tissue_collapse
 * @param scale      s */
void supine_physics_solution_apply(const supine_solution *solution, const supine_mesh *reference,
                                   double scale, double *positions);

#endif
