/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Solve the physical model for held-out directions of gravity, and tabulate the relative RMS error
 * of the displacement by number of harmonics and of modes. */
#include <cblas.h>
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"
#include <supine/sh.h>

#include "precompute/projection/accuracy.h"
#include "precompute/projection/projection.h"

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

enum { VERTICES_MAX = 4096 };

/* Compute the scalar products gram [rank, rank] of the columns of truth->columns over evenly chosen
 * vertices. Each vertex has the weight |d|^2, where d is its displacement per unit force. For any
 * vector w, w^T gram w is then the sum of the squared displacements by the forces columns * w.
 * VECTOR rows have the weight 1. */
static void find_gram(const supine_truth *truth, const supine_gravity_field *field, double *gram) {
  const size_t rank = truth->rank;
  const size_t axes = supine_rows_per_vertex(field->rows.kind);
  const size_t vertex_count = field->expansion.row_count / axes;
  const size_t stride = (vertex_count + VERTICES_MAX - 1) / VERTICES_MAX;
  memset(gram, 0, rank * rank * sizeof *gram);
  for (size_t i = 0; i < vertex_count; i += stride) {
    for (size_t row = axes * i; row < axes * (i + 1); ++row) {
      const double weight = field->weight != NULL ? field->weight[row] : 1.0;
      cblas_dsyr(CblasRowMajor, CblasLower, (int)rank, weight, truth->columns + row * rank, 1, gram,
                 (int)rank);
    }
  }
}

/* Compute w^T gram w, where w are the coefficients. */
static double square_of(const double *gram, size_t rank, const double *coefficients) {
  double image[SUPINE_SPAN_MAX];
  cblas_dsymv(CblasRowMajor, CblasLower, (int)rank, 1.0, gram, (int)rank, coefficients, 1, 0.0,
              image, 1);
  return cblas_ddot((int)rank, coefficients, 1, image, 1);
}

supine_status supine_accuracy_error_table_create(const supine_truth *truth,
                                                 const supine_gravity_field *field,
                                                 const supine_compression *compression,
                                                 supine_error_table *table, supine_error *error) {
  const supine_expansion *expansion = &field->expansion;
  const size_t rank = expansion->rank;
  const size_t bands = expansion->band + 1;
  const size_t terms = bands * bands;
  const size_t modes = compression->mode_count;
  double weights[SUPINE_MODES_MADE_MAX];
  double y[(SUPINE_SH_BAND_MAX + 1) * (SUPINE_SH_BAND_MAX + 1)];
  double residual[SUPINE_SPAN_MAX];
  double all = 0.0;
  SUPINE_ARENA arena = {0};
  double *gram = supine_arena_take(&arena, rank * rank, sizeof *gram);
  *table = (supine_error_table){.band_count = bands, .mode_count = modes};
  SUPINE_TRY(supine_arena_check(&arena, error, "the table of errors"));
  find_gram(truth, field, gram);
  for (size_t d = 0; d < truth->direction_count; ++d) {
    const double *functions = truth->functions + d * rank;
    (void)supine_sh_evaluate(expansion->band, truth->directions + 3 * d, y);
    supine_sh_compression_weights(compression, truth->directions + 3 * d, weights);
    all += square_of(gram, rank, functions);
    memcpy(residual, functions, rank * sizeof *residual);
    for (size_t l = 0; l < bands; ++l) {
      cblas_dgemv(CblasRowMajor, CblasNoTrans, (int)rank, 2 * (int)l + 1, -1.0,
                  expansion->functions + l * l, (int)terms, y + l * l, 1, 1.0, residual, 1);
      table->harmonics[l] += square_of(gram, rank, residual);
    }
    memcpy(residual, functions, rank * sizeof *residual);
    for (size_t k = 0; k < modes; ++k) {
      cblas_dgemv(CblasRowMajor, CblasNoTrans, (int)rank, 1, -1.0, compression->mix + k, (int)modes,
                  weights + k, 1, 1.0, residual, 1);
      table->modes[k] += square_of(gram, rank, residual);
    }
  }
  for (size_t l = 0; l < bands; ++l) {
    table->harmonics[l] = sqrt(table->harmonics[l] / all);
  }
  for (size_t k = 0; k < modes; ++k) {
    table->modes[k] = sqrt(table->modes[k] / all);
  }
  return SUPINE_OK;
}
