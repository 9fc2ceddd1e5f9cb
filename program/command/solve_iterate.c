/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Solve by the Pitcher/Catcher iteration of Santhanam 2008. */
#include <math.h>

#include "base/arena.h"

#include "precompute/physics/network.h"
#include "program/command/solve_iterate.h"
#include "program/options/command.h"

/* The Pitcher/Catcher iteration of [Santhanam2008] stops when the force that remains on each vertex
 * is at most this fraction of the largest applied force. */
static const double pitcher_tolerance = 1e-6;

/* Print the unbalanced fraction of the force each time the number of iteration steps per vertex has
 * doubled. */
static void report_remaining(void *context, size_t steps, double remaining) {
  const size_t per_vertex = steps / *(const size_t *)context;
  if ((per_vertex & (per_vertex - 1)) == 0) {
    supine_options_line("Pitcher/Catcher: %8zu steps, %.3g of the force not yet balanced\n", steps,
                        remaining);
  }
}

supine_status supine_command_iterate(const supine_lungs *lungs, const supine_model *model,
                                     const double g[3], supine_solution *solution,
                                     supine_error *error) {
  size_t n = lungs->mesh.vertex_count;
  double range[2];
  double difference = 0.0;
  SUPINE_ARENA arena = {0};
  double *force = supine_arena_take(&arena, n, sizeof *force);
  double *caught = supine_arena_take(&arena, n, sizeof *caught);
  SUPINE_REFUSE_IF(
      model->reach > 0.0 || model->lesions != NULL, error, SUPINE_ERROR_ARGUMENT,
      "--pitcher-catcher needs --law paper, and cannot be combined with --reach or --lesion");
  if (arena.failed ||
      supine_physics_height_range(lungs, model->force.pair, 1, g, range, range + 1) != SUPINE_OK) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  const supine_gravities gravity = {1, g, range, range + 1};
  supine_physics_force(lungs, &model->force, &gravity, n, NULL, force);
  SUPINE_TRY(supine_physics_pitcher_catcher(&lungs->mesh, &lungs->topology, model->stiffness, force,
                                            pitcher_tolerance, caught, report_remaining, &n,
                                            error));
  for (size_t i = 0; i < n; ++i) {
    difference = fmax(difference, fabs(caught[i] - solution->catch_[i]));
    solution->catch_[i] = caught[i];
  }
  supine_options_line("Pitcher/Catcher: largest difference from the direct solution %.2g\n",
                      difference);
  SUPINE_ADD_RESULT(json_pack("{s:f}", "pitcher_catcher_difference", difference));
  return SUPINE_OK;
}
