/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Solve the physical model for held-out directions of gravity. */
#include "base/arena.h"
#include "base/vec3.h"

#include "precompute/projection/accuracy.h"

void supine_accuracy_held_out_directions(size_t count, double *directions) {
  static const double first_longitude = 0.3; /* rad; off the nodes of the harmonics' grid */
  for (size_t i = 0; i < count; ++i) {
    supine_spiral((double)i, (double)count, first_longitude, directions + 3 * i);
  }
}

void supine_accuracy_truth_free(supine_truth *truth) {
  supine_arena_free(&truth->memory);
  *truth = (supine_truth){0};
}

/* Find the change of volume for each held-out direction of gravity as a cubic polynomial of the
 * gain (factor on the displacement). */
static supine_status find_cubics(const supine_lungs *lungs, const double *share,
                                 const supine_rows *rows, const supine_truth *truth,
                                 supine_error *error) {
  supine_volume_forms columns = {0};
  SUPINE_TRY(supine_physics_volume_forms_create(lungs, share, rows, truth->columns, truth->rank,
                                                &columns, error));
  for (size_t d = 0; d < truth->direction_count; ++d) {
    supine_physics_volume_forms_contract(&columns, truth->functions + d * truth->rank,
                                         truth->cubic + 3 * d);
  }
  supine_physics_volume_forms_free(&columns);
  return SUPINE_OK;
}

supine_status supine_accuracy_truth_create(const supine_lungs *lungs, const supine_model *model,
                                           const supine_span *span,
                                           const supine_gravity_field *field, size_t count,
                                           supine_truth *truth, supine_error *error) {
  const size_t rank = span->rank;
  SUPINE_ARENA arena = {0};
  double *range = supine_arena_take(&arena, 2 * count, sizeof *range);
  *truth =
      (supine_truth){.direction_count = count, .rank = rank, .columns = field->expansion.columns};
  truth->directions = supine_arena_take(&truth->memory, 3 * count, sizeof(double));
  truth->functions = supine_arena_take(&truth->memory, count * rank, sizeof(double));
  truth->cubic = supine_arena_zeros(&truth->memory, 3 * count, sizeof(double));
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu held-out directions", count));
  SUPINE_TRY(supine_arena_check(&truth->memory, error, "%zu held-out directions", count));
  supine_accuracy_held_out_directions(count, truth->directions);
  const supine_gravities gravities = {count, truth->directions, range, range + count};
  if (supine_physics_height_range(lungs, model->force.pair, count, truth->directions, range,
                                  range + count) != SUPINE_OK ||
      supine_projection_span_weights(lungs, &model->force, span, &gravities, truth->functions) !=
          SUPINE_OK) {
    return supine_error_memory(error, "%zu held-out directions", count);
  }
  return find_cubics(lungs, model->share, &field->rows, truth, error);
}
