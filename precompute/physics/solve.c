/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the displacements for one direction of gravity. */
#include <math.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "precompute/physics/solve.h"
#include "precompute/physics/volume_forms.h"

void supine_physics_solution_free(supine_solution *solution) {
  free(solution->catch_);
  free(solution->directions);
  supine_physics_equilibrium_destroy(solution->equilibrium);
  *solution = (supine_solution){0};
}

static supine_status solve(const supine_lungs *lungs, const supine_model *model, const double g[3],
                           supine_solution *made, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  SUPINE_ARENA arena = {0};
  double range[2];
  double *work = supine_arena_take(&arena, n, sizeof *work);
  made->catch_ = made->catch_ != NULL ? made->catch_ : malloc(n * sizeof *made->catch_);
  made->directions =
      made->directions != NULL ? made->directions : malloc(3 * n * sizeof *made->directions);
  SUPINE_TRY(supine_physics_model_equilibrium(lungs, model, &made->equilibrium, error));
  if (arena.failed || made->catch_ == NULL || made->directions == NULL ||
      supine_physics_height_range(lungs, model->force.pair, 1, g, range, range + 1) != SUPINE_OK) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  SUPINE_TRY(
      supine_physics_directions(lungs, &model->force, &model->direction, made->directions, error));
  const supine_gravities gravity = {1, g, range, range + 1};
  supine_physics_force(lungs, &model->force, &gravity, n, NULL, work);
  SUPINE_TRY(supine_physics_equilibrium_solve(made->equilibrium, 1, work, made->catch_, error));
  if (model->strain != NULL) {
    for (size_t i = 0; i < 3 * n; ++i) {
      made->directions[i] *= made->catch_[i / 3];
    }
    SUPINE_TRY(supine_physics_strain_apply(model->strain, NULL, 3, made->directions, error));
    for (size_t i = 0; i < n; ++i) {
      made->catch_[i] = 1.0;
    }
  }
  SUPINE_TRY(supine_physics_volume_of_field(lungs, model->share, made->directions, made->catch_,
                                            made->form, error));
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    supine_physics_volume_form_add(&made->form[lung], made->cubic);
  }
  return SUPINE_OK;
}

supine_status supine_physics_solve(const supine_lungs *lungs, const supine_model *model,
                                   const double g[3], supine_solution *solution,
                                   supine_error *error) {
  *solution = (supine_solution){.vertex_count = lungs->mesh.vertex_count,
                                .equilibrium = solution->equilibrium,
                                .catch_ = solution->catch_,
                                .directions = solution->directions};
  const supine_status status = solve(lungs, model, g, solution, error);
  if (status != SUPINE_OK) {
    supine_physics_solution_free(solution);
  }
  return status;
}

double supine_physics_solution_largest(const supine_solution *solution) {
  double largest = 0.0;
  for (size_t i = 0; i < solution->vertex_count; ++i) {
    largest =
        fmax(largest, fabs(solution->catch_[i]) * supine_length(solution->directions + 3 * i));
  }
  return largest;
}

void supine_physics_solution_apply(const supine_solution *solution, const supine_mesh *reference,
                                   double scale, double *positions) {
  for (size_t i = 0; i < solution->vertex_count; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      positions[3 * i + k] = reference->vertices[3 * i + k] +
                             scale * solution->catch_[i] * solution->directions[3 * i + k];
    }
  }
}
