/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Solve the physical model (model.h) for one direction of gravity, without a precomputed basis. */
#ifndef SUPINE_SOLVE_H
#define SUPINE_SOLVE_H

#include <supine/volume.h>

#include "precompute/physics/equilibrium.h"
#include "precompute/physics/model.h"

/** Displacements for one direction of gravity. Vertex i moves by scale * catch_[i] * directions[i],
 * where the scale is one factor for all vertices. */
typedef struct supine_solution {
  size_t vertex_count;
  supine_equilibrium *equilibrium; /**< equations of the lungs, kept for their next solve */
  double *catch_;     /**< [vertices] force that each vertex retains after exchanging force
                         with its neighbours */
  double *directions; /**< [vertices, 3] displacement of each vertex of healthy lungs at a
                         force of 1, mm. With model->strain it is the displacement itself,
                         and catch_ is 1 */
  double cubic[3];    /**< volume, mL, added at scale s: cubic[0] s + cubic[1] s^2 + cubic[2] s^3 */
  supine_volume_form form[2]; /**< [lung] added volume, mL, as a polynomial of the factors that
                                 scale displacements along x, y and z */
} supine_solution;

/** Compute the displacements for gravity along the unit vector `g`.
 * @param solution  zero-initialised, or an earlier solution of the same lungs, whose memory is then
 *   reused; vertices may have moved. After an error it is empty. Release it with
 *   supine_physics_solution_free. */
supine_status supine_physics_solve(const supine_lungs *lungs, const supine_model *model,
                                   const double g[3], supine_solution *solution,
                                   supine_error *error);
void supine_physics_solution_free(supine_solution *solution);

/** Return the length, mm, of the largest displacement of a vertex, before scaling to a volume. */
double supine_physics_solution_largest(const supine_solution *solution);

/** Compute the positions [N, 3] of displaced vertices, mm.
 * @param reference  mesh of the healthy lungs; supine_lungs_collapse then collapses them
 * @param scale      factor on the displacements */
void supine_physics_solution_apply(const supine_solution *solution, const supine_mesh *reference,
                                   double scale, double *positions);

#endif
