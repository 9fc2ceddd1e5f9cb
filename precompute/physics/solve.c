/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the displacements for one direction of gravity. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"

#include "precompute/lungs/disease.h"
#include "precompute/physics/solve.h"
#include "precompute/physics/volume_forms.h"

void supine_physics_solution_free(supine_solution *solution) {
  free(solution->catch_);
  free(solution->directions);
  supine_physics_equilibrium_destroy(solution->equilibrium);
  *solution = (supine_solution){0};
}

supine_status supine_physics_solve(const supine_lungs *lungs, const supine_model *model,
                                   const double g[3], supine_solution *solution,
                                   supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  supine_solution made = *solution;
  double range[2];
  double *work = malloc(n * sizeof *work);
  *solution = (supine_solution){0};
  memset(made.cubic, 0, sizeof made.cubic);
  memset(made.form, 0, sizeof made.form);
  made.vertex_count = n;
  made.catch_ = made.catch_ != NULL ? made.catch_ : malloc(n * sizeof *made.catch_);
  made.directions =
      made.directions != NULL ? made.directions : malloc(3 * n * sizeof *made.directions);
  supine_status status = supine_physics_model_equilibrium(lungs, model, &made.equilibrium, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  status = SUPINE_ERROR_MEMORY;
  if (work == NULL || made.catch_ == NULL || made.directions == NULL ||
      supine_physics_height_range(lungs, model->force.pair, 1, g, range, range + 1) != SUPINE_OK) {
    (void)supine_error_set(error, status, "no memory to solve %zu vertices", n);
    goto cleanup;
  }
  status =
      supine_physics_directions(lungs, &model->force, &model->direction, made.directions, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  const supine_gravities gravity = {1, g, range, range + 1};
  supine_physics_force(lungs, &model->force, &gravity, n, NULL, work);
  status = supine_physics_equilibrium_solve(made.equilibrium, 1, work, made.catch_, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  if (model->strain != NULL) {
    for (size_t i = 0; i < 3 * n; ++i) {
      made.directions[i] *= made.catch_[i / 3];
    }
    status = supine_physics_strain_apply(model->strain, NULL, 3, made.directions, error);
    for (size_t i = 0; i < n; ++i) {
      made.catch_[i] = 1.0;
    }
  }
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  supine_physics_volume_of_fields(lungs, model->share, made.directions, made.catch_, 1, made.form);
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    supine_physics_volume_form_add(&made.form[lung], made.cubic);
  }
  supine_tissue_collapse_directions(lungs, model->share, made.directions);
  *solution = made;
  made = (supine_solution){0};
cleanup:
  supine_physics_solution_free(&made);
  free(work);
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
