/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Tabulate the relative RMS error of the displacement by number of harmonics and of modes. */
#include <cblas.h>
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include <supine/sh.h>

#include "precompute/projection/accuracy.h"
#include "precompute/projection/projection.h"

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
