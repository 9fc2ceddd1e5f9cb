/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute what a basis of another simulator's fields stores: fit the fields, compress the fit, and
 * measure the errors. */
#include <stdlib.h>

#include "base/arena.h"
#include "precompute/computed.h"

/* Another simulator's fields -> field of displacements, and predictions of each from the others. */
static supine_status fit(const supine_prepared *prepared, const supine_basis_choice *choice,
                         supine_computed *made, supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const supine_named_volumes *named = &prepared->named;
  SUPINE_TRY(supine_fields_fit(choice->fields, lungs, choice->choose_band ? -1 : (int)choice->band,
                               &made->fit, error));
  SUPINE_REFUSE_IF(made->fit.report.order == 0 && (named->has_rest || named->full > 0.0), error,
                   SUPINE_ERROR_ARGUMENT,
                   "the simulations have one volume for each direction of gravity: simulate "
                   "several volumes, or leave out those at rest and at full inflation");
  if (made->fit.report.order > 0 && choice->scan_gravity != NULL) {
    const int band = (int)made->fit.report.band;
    SUPINE_TRY(
        supine_fields_count_from_scan(&made->fit, choice->scan_gravity, &made->counted, error));
    supine_fields_fit_free(&made->fit);
    SUPINE_TRY(supine_fields_fit(&made->counted, lungs, band, &made->fit, error));
    SUPINE_TRY(supine_fields_check_scan(&made->fit, choice->scan_gravity, error)); /* as moved */
  }
  return supine_fields_field(&made->fit, &made->field, error);
}

/* Let displacements of gravity alone count from the scan, whose gravity is known: subtract from
 * each mode its weight w in this posture, so that the given surface reproduces the scan. The
 * constant harmonic is 1 / sqrt(4 pi), so that its coefficient falls by sqrt(4 pi) w. fit()
 * does this for displacements over gravity and volume. */
static void count_from_scan(const double scan_gravity[3], supine_compression *compression) {
  static const double sqrt_4pi = 3.5449077018110321;
  double weights[SUPINE_MODES_MADE_MAX];
  supine_sh_compression_weights(compression, scan_gravity, weights);
  for (size_t k = 0; k < compression->mode_count; ++k) {
    compression->modes[k * supine_sh_count(compression->band)] -= sqrt_4pi * weights[k];
  }
}

/* Find clusters of vertices that move alike, if the basis stores them. Their coefficients then
 * replace those of the compression, so that all that follows is of what is stored. */
static supine_status cluster(const supine_basis_choice *choice, supine_computed *made,
                             supine_error *error) {
  const size_t n = made->lungs.mesh.vertex_count;
  supine_compression *compression = &made->compression;
  SUPINE_ARENA arena = {0};
  float *vertices = supine_arena_take(&arena, 3 * n, sizeof *vertices);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(
      supine_fields_cluster(&made->fit, compression, choice->storage, &made->clusters, error));
  if (made->clusters.count == 0) {
    return SUPINE_OK;
  }
  float *stored = malloc(3 * n * compression->mode_count * sizeof *stored);
  if (stored == NULL) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    vertices[i] = (float)made->lungs.mesh.vertices[i];
  }
  supine_clusters_expand(&made->clusters, vertices, stored);
  made->exact = compression->coefficients;
  compression->coefficients = stored;
  return SUPINE_OK;
}

supine_status supine_precompute_from_fields(const supine_prepared *prepared,
                                            const supine_basis_choice *choice,
                                            supine_computed *computed, supine_error *error) {
  supine_spectrum spectrum;
  supine_compression *compression = &computed->compression;
  computed->kind = SUPINE_COMPUTED_BY_FIELDS;
  computed->lungs = prepared->source.lungs;
  SUPINE_TRY(fit(prepared, choice, computed, error));
  SUPINE_TRY(supine_precompute_tell_progress(choice, 2, error));
  SUPINE_TRY(supine_precompute_compress(choice, computed, &spectrum, error));
  supine_precompute_drop_modes(choice, &spectrum, supine_fields_fit_error(&computed->fit),
                               computed);
  SUPINE_TRY(supine_precompute_tell_progress(choice, 3, error));
  if (choice->scan_gravity != NULL && computed->fit.report.order == 0) {
    count_from_scan(choice->scan_gravity, compression);
  }
  SUPINE_TRY(cluster(choice, computed, error));
  SUPINE_TRY(supine_projection_volume_forms(compression, &computed->lungs, prepared->model.share,
                                            &computed->field.rows, &computed->forms, error));
  SUPINE_TRY(supine_precompute_tell_progress(choice, 4, error));
  const size_t n = computed->lungs.mesh.vertex_count;
  supine_fit_errors *errors = &computed->errors;
  errors->rows = 2 * computed->fit.report.band + 4;
  errors->terms = supine_sh_count(computed->fit.report.band + 1);
  errors->vertices = supine_arena_take(&computed->memory, n, sizeof(float));
  errors->harmonics =
      supine_arena_zeros(&computed->memory, errors->rows * errors->terms, sizeof(double));
  if (computed->fit.report.order > 0) {
    errors->volume_count = computed->fit.report.volume_count;
    errors->by_volume = supine_arena_zeros(&computed->memory, errors->volume_count, sizeof(double));
  }
  SUPINE_TRY(supine_arena_check(&computed->memory, error, "%zu vertices", n));
  return supine_fields_measure(&computed->fit, choice->modes == 0 ? 0 : compression->mode_count,
                               &computed->accuracy, errors, error);
}
