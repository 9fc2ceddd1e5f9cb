/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measure the error that storage adds to the displacement of a basis file. */
#include <math.h>

#include "base/arena.h"
#include "base/vec3.h"
#include <supine/runtime.h>

#include "precompute/projection/accuracy.h"
#include "precompute/projection/tally.h"

supine_status supine_accuracy_add_storage(const supine_basis *basis,
                                          const supine_compression *compression,
                                          const supine_rows *rows, supine_accuracy *accuracy) {
  enum { DIRECTIONS = 16 };
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = info->vertex_count;
  double gravity[3 * DIRECTIONS];
  double square_sum = 0.0;
  SUPINE_ARENA arena = {0};
  float *xyz = supine_arena_take(&arena, 3 * n, sizeof *xyz);
  double *u = supine_arena_take(&arena, 3 * n, sizeof *u);
  supine_tally *tally = supine_arena_zeros(&arena, 1, sizeof *tally);
  SUPINE_TRY(supine_arena_status(&arena));
  supine_accuracy_held_out_directions(DIRECTIONS, gravity);
  for (const double *g = gravity; g < gravity + 3 * DIRECTIONS; g += 3) {
    const supine_state state = {.gravity = {g[0], g[1], g[2]}};
    supine_pose pose = {.basis = 0};
    if (supine_basis_pose(basis, &state, &pose, NULL) != SUPINE_OK ||
        supine_deform(basis, &pose, xyz) != SUPINE_OK) {
      continue;
    }
    supine_projection_displacement(compression, rows, pose.weights, u);
    for (size_t i = 0, lung = 0; i < n; ++i) {
      double error[3];
      lung += i >= info->lung_begin[lung + 1];
      for (size_t j = 3 * i; j < 3 * i + 3; ++j) {
        u[j] *= pose.gains[lung][j % 3];
        error[j % 3] = (double)xyz[j] - (double)info->vertices[j] - u[j];
      }
      square_sum += supine_dot(u + 3 * i, u + 3 * i);
      supine_accuracy_tally_add(tally, 1, (double[]){supine_length(error)});
    }
  }
  if (!(square_sum > 0.0)) {
    return SUPINE_OK;
  }
  const double rms = sqrt(tally->square_sum / (double)tally->count);
  const double p95 = supine_accuracy_tally_percentile(tally, 0.95);
  const double size = sqrt(square_sum / (double)tally->count);
  accuracy->relative_rms = hypot(accuracy->relative_rms, rms / size);
  accuracy->relative_p95 = hypot(accuracy->relative_p95, p95 / size);
  accuracy->relative_max += tally->largest / size;
  accuracy->rms_mm = hypot(accuracy->rms_mm, rms);
  accuracy->p95_mm = hypot(accuracy->p95_mm, p95);
  accuracy->max_mm += tally->largest;
  return SUPINE_OK;
}
