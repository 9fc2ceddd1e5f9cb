/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measure the error that storage adds to the displacement of a basis file. */
#include <math.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/vec3.h"
#include <supine/runtime.h>

#include "precompute/projection/accuracy.h"
#include "precompute/projection/tally.h"

/* Compute the displacement of vertex i from the numbers in the file, in double precision. */
static void exact_displacement(const supine_basis_info *info, const supine_pose *pose, size_t i,
                               const double gain[3], double u[3]) {
  for (size_t axis = 0; axis < 3; ++axis) {
    const size_t row = info->vector ? 3 * i + axis : i;
    u[axis] = 0.0;
    for (size_t k = 0; k < info->mode_count; ++k) {
      u[axis] += pose->weights[k] * (double)info->coefficients[row * info->mode_count + k];
    }
    u[axis] *= gain[axis] * (info->vector ? 1.0 : (double)info->direction[3 * i + axis]);
  }
}

/* Add the errors of all positions `xyz` in a pose. Return the sum of the squared displacements. */
static double compare(const supine_basis_info *info, const supine_pose *pose, const float *xyz,
                      supine_tally *tally) {
  double square_sum = 0.0;
  for (size_t i = 0, lung = 0; i < info->vertex_count; ++i) {
    double u[3];
    double error[3];
    lung += i >= info->lung_begin[lung + 1];
    exact_displacement(info, pose, i, pose->gains[lung], u);
    for (size_t axis = 0; axis < 3; ++axis) {
      error[axis] = (double)xyz[3 * i + axis] - (double)info->vertices[3 * i + axis] - u[axis];
    }
    const double length = supine_length(error);
    supine_accuracy_tally_add(tally, 1, &length);
    square_sum += supine_dot(u, u);
  }
  return square_sum;
}

supine_status supine_accuracy_add_storage(const supine_basis *basis, supine_accuracy *accuracy) {
  enum { DIRECTIONS = 16 };
  const supine_basis_info *info = supine_basis_get_info(basis);
  double directions[3 * DIRECTIONS];
  double square_sum = 0.0;
  SUPINE_ARENA arena = {0};
  float *xyz = supine_arena_take(&arena, 3 * info->vertex_count, sizeof *xyz);
  supine_tally *tally = supine_arena_zeros(&arena, 1, sizeof *tally);
  if (arena.failed) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_accuracy_held_out_directions(DIRECTIONS, directions);
  for (size_t d = 0; d < DIRECTIONS; ++d) {
    const double *g = directions + 3 * d;
    const supine_state state = {.gravity = {g[0], g[1], g[2]}};
    supine_pose pose = {.basis = 0};
    if (supine_basis_pose(basis, &state, &pose, NULL) == SUPINE_OK &&
        supine_deform(basis, &pose, xyz) == SUPINE_OK) {
      square_sum += compare(info, &pose, xyz, tally);
    }
  }
  if (!(square_sum > 0.0)) {
    return SUPINE_OK;
  }
  const double samples = (double)tally->count;
  const double size = sqrt(square_sum / samples);
  const double rms = sqrt(tally->square_sum / samples);
  const double p95 = supine_accuracy_tally_percentile(tally, 0.95);
  accuracy->relative_rms = hypot(accuracy->relative_rms, rms / size);
  accuracy->relative_p95 = hypot(accuracy->relative_p95, p95 / size);
  accuracy->relative_max += tally->largest / size;
  accuracy->rms_mm = hypot(accuracy->rms_mm, rms);
  accuracy->p95_mm = hypot(accuracy->p95_mm, p95);
  accuracy->max_mm += tally->largest;
  return SUPINE_OK;
}
