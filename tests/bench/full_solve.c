/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What a frame costs without a basis. */
#include <stdlib.h>

#include "precompute/lungs/phantom.h"
#include "precompute/precompute.h"

#include "full_solve.h"

struct full_solve {
  supine_lungs lungs;
  supine_network *network;
  supine_equilibrium *equilibrium;
  double *force, *caught, *directions, *positions;
};

full_solve *full_solve_create(size_t vertices) {
  full_solve *made = calloc(1, sizeof *made);
  supine_mesh mesh = {0};
  const supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  if (made == NULL || supine_phantom_create(vertices, 2500.0, &mesh, NULL) != SUPINE_OK ||
      supine_lungs_create(&mesh, 1, NULL, &made->lungs, NULL) != SUPINE_OK) {
    supine_mesh_free(&mesh);
    full_solve_destroy(made);
    return NULL;
  }
  const size_t n = made->lungs.mesh.vertex_count;
  supine_mesh_free(&mesh);
  made->force = malloc(n * sizeof *made->force);
  made->caught = malloc(n * sizeof *made->caught);
  made->directions = malloc(3 * n * sizeof *made->directions);
  made->positions = malloc(3 * n * sizeof *made->positions);
  if (made->force == NULL || made->caught == NULL || made->directions == NULL ||
      made->positions == NULL ||
      supine_physics_directions(&made->lungs, &model.direction, made->directions, NULL) !=
          SUPINE_OK ||
      supine_physics_model_network(&made->lungs, &model, &made->network) != SUPINE_OK ||
      supine_physics_equilibrium_create(made->network, 1, 1, &made->equilibrium) != SUPINE_OK ||
      supine_physics_equilibrium_set_stiffness(made->equilibrium, NULL, NULL) != SUPINE_OK) {
    full_solve_destroy(made);
    return NULL;
  }
  return made;
}

void full_solve_destroy(full_solve *solve) {
  if (solve != NULL) {
    supine_physics_equilibrium_destroy(solve->equilibrium);
    supine_physics_network_destroy(solve->network);
    supine_lungs_free(&solve->lungs);
    free(solve->force);
    free(solve->caught);
    free(solve->directions);
    free(solve->positions);
    free(solve);
  }
}

size_t full_solve_vertex_count(const full_solve *solve) {
  return solve->lungs.mesh.vertex_count;
}

void full_solve_run(void *context) {
  full_solve *solve = context;
  static const double g[3] = {0.6, 0.48, -0.64};
  const supine_force_law law = supine_physics_model(SUPINE_LAW_PAPER).force;
  const supine_lungs *lungs = &solve->lungs;
  double low;
  double high;
  if (supine_physics_height_range(lungs, false, 1, g, &low, &high) != SUPINE_OK) {
    return;
  }
  const supine_gravities gravity = {1, g, &low, &high};
  supine_physics_force(lungs, &law, &gravity, lungs->mesh.vertex_count, NULL, solve->force);
  /* to the accuracy that a frame needs, not the default's 1e-14 */
  (void)supine_physics_equilibrium_solve(solve->equilibrium, 1, solve->force, 1e-6, false,
                                         solve->caught, NULL, NULL);
  for (size_t i = 0; i < 3 * lungs->mesh.vertex_count; ++i) {
    solve->positions[i] = lungs->mesh.vertices[i] + solve->caught[i / 3] * solve->directions[i];
  }
}
