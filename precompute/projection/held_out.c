/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Solve the physical model for held-out directions of gravity. */
#include <cblas.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"

#include "precompute/projection/accuracy.h"

void supine_accuracy_held_out_directions(size_t count, double *directions) {
  static const double first_longitude = 0.3; /* rad; off the nodes of the harmonics' grid */
  for (size_t i = 0; i < count; ++i) {
    supine_spiral((double)i, (double)count, first_longitude, directions + 3 * i);
  }
}

void supine_accuracy_truth_free(supine_truth *truth) {
  free(truth->directions);
  free(truth->functions);
  free(truth->cubic);
  *truth = (supine_truth){0};
}

/* Find the change of volume for each held-out direction of gravity as a cubic polynomial of the
 * gain (factor on the displacement). If truth->rank is at most FEW, use the volume as a polynomial
 * of truth->functions. Otherwise compute the forces for AT_ONCE directions at a time. */
static supine_status find_cubics(const supine_lungs *lungs, const double *share,
                                 const double *directions, const supine_truth *truth) {
  enum { FEW = 8, AT_ONCE = SUPINE_VOLUME_FIELDS };
  const size_t axes = directions == NULL ? 3 : 1;
  const size_t n = axes * lungs->mesh.vertex_count;
  const size_t most = axes == 3 ? 1 : AT_ONCE;
  const size_t rank = truth->rank;
  supine_volume_forms columns = {0};
  supine_volume_form forms[2 * AT_ONCE];
  double *fields = malloc((most + 1) * n * sizeof *fields);
  if (fields == NULL ||
      (rank <= FEW && supine_physics_volume_forms_create(lungs, share, directions, truth->columns,
                                                         rank, &columns, NULL) != SUPINE_OK)) {
    free(fields);
    return SUPINE_ERROR_MEMORY;
  }
  memset(truth->cubic, 0, 3 * truth->direction_count * sizeof *truth->cubic);
  for (size_t d = 0; d < truth->direction_count && rank <= FEW; ++d) {
    supine_physics_volume_forms_contract(&columns, truth->functions + d * rank,
                                         truth->cubic + 3 * d);
  }
  for (size_t first = 0; first < truth->direction_count && rank > FEW; first += most) {
    const size_t left = truth->direction_count - first;
    const size_t count = left < most ? left : most;
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)n, (int)count, (int)rank, 1.0,
                truth->columns, (int)rank, truth->functions + first * rank, (int)rank, 0.0, fields,
                (int)count);
    for (size_t i = 0; i < n; ++i) {
      fields[most * n + i] = 1.0;
    }
    supine_physics_volume_of_fields(lungs, share, axes == 3 ? fields : directions,
                                    axes == 3 ? fields + n : fields, count, forms);
    for (size_t i = 0; i < lungs->lung_count * count; ++i) {
      supine_physics_volume_form_add(&forms[i], truth->cubic + 3 * (first + i % count));
    }
  }
  supine_physics_volume_forms_free(&columns);
  free(fields);
  return SUPINE_OK;
}

supine_status supine_accuracy_truth_create(const supine_lungs *lungs, const supine_model *model,
                                           const double *directions,
                                           const supine_projection *projection, size_t count,
                                           supine_truth *truth, supine_error *error) {
  const size_t rank = projection->expansion.rank;
  double *range = malloc(2 * count * sizeof *range);
  *truth = (supine_truth){.direction_count = count,
                          .directions = malloc(3 * count * sizeof(double)),
                          .rank = rank,
                          .columns = projection->expansion.columns,
                          .functions = malloc(count * rank * sizeof(double)),
                          .cubic = malloc(3 * count * sizeof(double))};
  supine_status status = SUPINE_ERROR_MEMORY;
  if (range != NULL && truth->directions != NULL && truth->functions != NULL &&
      truth->cubic != NULL) {
    supine_accuracy_held_out_directions(count, truth->directions);
    status = supine_physics_height_range(lungs, model->force.pair, count, truth->directions, range,
                                         range + count);
  }
  if (status == SUPINE_OK) {
    const supine_gravities gravities = {count, truth->directions, range, range + count};
    status = supine_projection_span_weights(lungs, &model->force, projection->span, &gravities,
                                            truth->functions);
  }
  free(range);
  if (status == SUPINE_OK) {
    status = find_cubics(lungs, model->share, directions, truth);
  }
  if (status != SUPINE_OK) {
    supine_accuracy_truth_free(truth);
    (void)supine_error_set(error, status, "no memory for %zu held-out directions", count);
  }
  return status;
}
