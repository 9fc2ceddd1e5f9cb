/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Round what was computed as a basis file stores it, and measure what depends on rounding. */
#include <math.h>
#include <string.h>

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

/* Return the displacement of a vertex by a mode along an axis, mm. */
static double displacement_of(const supine_compression *field, const supine_rows *rows, size_t at,
                              size_t mode) {
  const size_t row = rows->kind == SUPINE_ROWS_VECTOR ? at : at / 3;
  const double factor = rows->kind == SUPINE_ROWS_VECTOR ? 1.0 : rows->directions[at];
  return factor * (double)field->coefficients[row * field->mode_count + mode];
}

/* Collapse the displacements by each mode. As the hilum moves, they are no longer along one
 * direction for each vertex: all are stored as vectors. */
static supine_status collapse_modes(const supine_lungs *lungs, const double share[2],
                                    supine_arena *arena, supine_stored *made, supine_error *error) {
  const size_t values = 3 * lungs->mesh.vertex_count;
  const supine_compression field = made->field;
  const size_t modes = field.mode_count;
  SUPINE_ARENA work = {0};
  double *u = supine_arena_take(&work, values, sizeof *u);
  made->field.row_count = values;
  made->field.coefficients = supine_arena_take(arena, values * modes, sizeof(float));
  made->hilum = supine_arena_take(arena, lungs->lung_count * 3 * modes, sizeof *made->hilum);
  SUPINE_TRY(supine_arena_check(&work, error, "%zu vertices of a basis", values / 3));
  SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices of a basis", values / 3));
  for (size_t k = 0; k < modes; ++k) {
    for (size_t i = 0; i < values; ++i) {
      u[i] = displacement_of(&field, &made->rows, i, k);
    }
    supine_lungs_collapse(lungs, share, u, u);
    for (size_t i = 0; i < values; ++i) {
      made->field.coefficients[i * modes + k] = (float)u[i];
    }
    for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
      double mean[3];
      supine_lungs_hilum_mean(lungs, lung, u, mean);
      for (size_t axis = 0; axis < 3; ++axis) {
        made->hilum[(3 * lung + axis) * modes + k] = mean[axis];
      }
    }
  }
  made->rows = (supine_rows){.kind = SUPINE_ROWS_VECTOR};
  return SUPINE_OK;
}

/* Collapse the lungs and their displacements, and round them as in the file. */
static supine_status collapse(const supine_computed *computed, const double share[2],
                              supine_arena *arena, supine_stored *made, supine_error *error) {
  const supine_lungs *lungs = &computed->lungs;
  const supine_rows *rows = &computed->field.rows;
  const size_t n = lungs->mesh.vertex_count;
  const bool healthy = share[0] == 1.0 && share[1] == 1.0;
  SUPINE_ARENA work = {0};
  double *collapsed = supine_arena_take(&work, 3 * n, sizeof *collapsed);
  *made = (supine_stored){.vertices = supine_arena_take(arena, 3 * n, sizeof(float)),
                          .lung = supine_arena_take(arena, n, 1),
                          .rest = computed->reference.known ? computed->resting[0] : NULL,
                          .field = computed->compression,
                          .rows = *rows};
  SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices of a basis", n));
  SUPINE_TRY(supine_arena_check(&work, error, "%zu vertices of a basis", n));
  supine_lungs_collapse(lungs, share, lungs->mesh.vertices, collapsed);
  to_float(collapsed, 3 * n, made->vertices);
  for (size_t i = 0; i < n; ++i) {
    made->lung[i] = lungs->lung_count == 2 && i >= lungs->lung_begin[1] ? 1 : 0;
  }
  if (!healthy) {
    return collapse_modes(lungs, share, arena, made, error);
  }
  if (rows->kind == SUPINE_ROWS_SCALAR) {
    made->directions = supine_arena_take(arena, 3 * n, sizeof(float));
    SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices of a basis", n));
    to_float(rows->directions, 3 * n, made->directions);
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
  double share[SUPINE_SH_BAND_MAX + 1] = {0.0};
  double turning = 0.0;
  SUPINE_TRY(supine_projection_band_shares(basis, share, error));
  for (size_t l = 1; l <= supine_basis_get_info(basis)->band; ++l) {
    turning += share[l];
  }
  if (turning > 0.0) {
    accuracy->turning_rms = accuracy->relative_rms * sqrt(1.0 + share[0] / turning);
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
  SUPINE_TRY(supine_projection_accuracy_add_storage(
      basis, &exact, &stored->rows, &computed->accuracy, computed->errors.vertices));
  if (computed->errors.vertices != NULL) {
    supine_fields_complete_errors(computed->lungs.mesh.vertex_count, &computed->errors);
  }
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
