/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Round what was computed as a basis file stores it, and measure what depends on rounding. */
#include <math.h>
#include <string.h>

#include <supine/compare.h>

#include "base/arena.h"
#include "precompute/lungs/disease.h"
#include "precompute/stored.h"
#include "precompute/volume_range.h"
#include "runtime/checks.h"

static void to_float(const double *values, size_t count, float *out) {
  for (size_t i = 0; i < count; ++i) {
    out[i] = (float)values[i];
  }
}

/* Shrink the displacements of VECTOR rows in collapsed lungs to the cube root of the lung's share.
 */
static void collapse_coefficients(const supine_lungs *lungs, const double share[2],
                                  const supine_compression *field, float *coefficients) {
  for (size_t i = 0; i < field->row_count; ++i) {
    const size_t lung = lungs->lung_count == 2 && i >= 3 * lungs->lung_begin[1];
    const float factor = (float)cbrt(share[lung]);
    for (size_t k = 0; k < field->mode_count; ++k) {
      const size_t at = i * field->mode_count + k;
      coefficients[at] = factor * field->coefficients[at];
    }
  }
}

/* Collapse the lungs and their displacements, and round them as in the file. */
static supine_status collapse(const supine_computed *computed, const double share[2],
                              supine_arena *arena, supine_stored *made, supine_error *error) {
  const supine_lungs *lungs = &computed->lungs;
  const supine_rows *rows = &computed->field.rows;
  const size_t n = lungs->mesh.vertex_count;
  const supine_compression *field = &computed->compression;
  double *collapsed = supine_arena_take(arena, 3 * n, sizeof *collapsed);
  *made = (supine_stored){.vertices = supine_arena_take(arena, 3 * n, sizeof(float)),
                          .lung = supine_arena_take(arena, n, 1),
                          .rest = computed->reference.known ? computed->resting[0] : NULL,
                          .field = *field,
                          .rows = *rows};
  SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices of a basis", n));
  supine_lungs_collapse(lungs, share, collapsed);
  to_float(collapsed, 3 * n, made->vertices);
  for (size_t i = 0; i < n; ++i) {
    made->lung[i] = lungs->lung_count == 2 && i >= lungs->lung_begin[1] ? 1 : 0;
  }
  if (rows->kind == SUPINE_ROWS_SCALAR) {
    made->directions = supine_arena_take(arena, 3 * n, sizeof(float));
    SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices of a basis", n));
    memcpy(collapsed, rows->directions, 3 * n * sizeof *collapsed);
    supine_lungs_collapse_directions(lungs, share, collapsed);
    to_float(collapsed, 3 * n, made->directions);
    made->rows.directions = collapsed;
  } else if (share[0] != 1.0 || share[1] != 1.0) {
    made->field.coefficients =
        supine_arena_take(arena, field->row_count * field->mode_count, sizeof(float));
    SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices of a basis", n));
    collapse_coefficients(lungs, share, field, made->field.coefficients);
  }
  return SUPINE_OK;
}

/* Find the numbers by which a basis over volume finds its parameters. */
static supine_status store_volumes(const supine_fit *fit, supine_stored *made,
                                   supine_error *error) {
  SUPINE_TRY(supine_fields_volumes_fit(fit, &made->simulated, error));
  const size_t count = made->simulated.share_count;
  for (size_t i = 0; i < 2 * 9 * count; ++i) {
    made->shares[i] = made->simulated.shares[i / count / 9][i / count % 9][i % count];
  }
  return SUPINE_OK;
}

/* Find the modes of the vertex normals from vertices and displacements rounded as in the file. */
static supine_status find_normals(const supine_computed *computed, const double bend[3],
                                  supine_arena *arena, supine_stored *made, supine_error *error) {
  static const double straight[3] = {0.0, 0.0, 0.0};
  const supine_normals_surface surface = {.lungs = &computed->lungs,
                                          .vertices = made->vertices,
                                          .kind = made->rows.kind,
                                          .directions = made->directions,
                                          .field = &made->field,
                                          .resting = made->rest,
                                          .forms = &computed->forms,
                                          .bend = computed->reference.known ? bend : straight};
  return supine_normals_modes_create(&surface, arena, &made->normals, error);
}

static void basis_close(supine_basis **basis) {
  supine_basis_close(*basis);
}

/* Name rest and full inflation among the simulated volumes, where they are known. */
static supine_status name_volumes(const supine_basis *basis, const supine_named_volumes *named,
                                  supine_stored *made, supine_error *error) {
  const double full = named->full;
  const double totals[6] = {full, full, full, full, full, full}; /* in every posture */
  if (named->has_rest) {
    SUPINE_TRY(supine_fields_divide_volume(
        basis, named->rest, "volumes at rest (those not given are assumed from the others)",
        made->named[0], error));
    made->rest = made->named[0][0];
  }
  if (full > 0.0) {
    SUPINE_TRY(supine_fields_divide_volume(basis, totals, "volume at full inflation",
                                           made->named[1], error));
    made->full = made->named[1][0];
  }
  return SUPINE_OK;
}

/* Measure the error of the basis relative to what depends on gravity: the squared displacement
 * without that of band 0. A surface without area has none. */
static supine_status measure_turning(const supine_basis *basis, supine_accuracy *accuracy,
                                     supine_error *error) {
  const size_t bands = supine_basis_get_info(basis)->band + 1;
  double energy[SUPINE_SH_BAND_MAX + 1];
  double turning = 0.0;
  supine_compare *compare = NULL;
  const supine_status status = supine_compare_create(basis, &compare, error);
  if (status != SUPINE_OK) {
    return status == SUPINE_ERROR_MESH ? SUPINE_OK : status;
  }
  supine_compare_energy(compare, energy);
  supine_compare_destroy(compare);
  for (size_t l = 1; l < bands; ++l) {
    turning += energy[l];
  }
  if (turning > 0.0) {
    accuracy->turning_rms = accuracy->relative_rms * sqrt(1.0 + energy[0] / turning);
  }
  return SUPINE_OK;
}

supine_status supine_precompute_store(const supine_prepared *prepared,
                                      const supine_basis_choice *choice,
                                      const supine_computed *computed, supine_arena *arena,
                                      supine_stored *stored, supine_error *error) {
  const supine_model *model = &prepared->model;
  SUPINE_TRY(collapse(computed, model->share, arena, stored, error));
  if (computed->compression.order > 0) {
    return store_volumes(&computed->fit, stored, error);
  }
  if (!choice->without_normals) {
    SUPINE_TRY(find_normals(computed, model->bend, arena, stored, error));
  }
  return SUPINE_OK;
}

supine_status supine_precompute_measure_stored(const supine_prepared *prepared, const void *bytes,
                                               size_t size, supine_computed *computed,
                                               supine_arena *arena, supine_stored *stored,
                                               supine_error *error) {
  const supine_basis_options options = {.size = sizeof options,
                                        .simd = SUPINE_SIMD_PORTABLE,
                                        .without_normals = true,
                                        .allow_folds = true}; /* its limits are measured here */
  SUPINE_FREED_BY(basis_close) supine_basis *basis = NULL;
  SUPINE_TRY(supine_basis_open_memory_with(bytes, size, &options, &basis, error));
  supine_compression exact = stored->field;
  if (computed->exact != NULL) {
    exact.coefficients = computed->exact;
  }
  SUPINE_TRY(supine_projection_accuracy_add_storage(basis, &exact, &stored->rows,
                                                    &computed->accuracy, computed->vertex_error));
  SUPINE_TRY(measure_turning(basis, &computed->accuracy, error));
  if (computed->compression.order > 0) { /* the simulations give the range of volumes */
    return name_volumes(basis, &prepared->named, stored, error);
  }
  if (!computed->reference.known) {
    return SUPINE_OK;
  }
  stored->volume_range = supine_arena_take(
      arena, SUPINE_RANGE_NODES * computed->lungs.lung_count * 2, sizeof *stored->volume_range);
  SUPINE_TRY(supine_arena_check(arena, error, "the range of volumes"));
  return supine_precompute_volume_range(basis, stored->volume_range, error);
}
