/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Expand the solutions of a physical model in spherical harmonics of the direction of gravity.
 * Solve for a few directions. Any other solution is a weighted sum of these: expand the weights.
 * Make the displacements of all vertices from the forces on them. */
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "precompute/projection/projection.h"
#include "sh/expansion.h"
#include <supine/sh.h>

void supine_projection_free(supine_projection *projection) {
  free(projection->span);
  supine_sh_expansion_free(&projection->expansion);
  *projection = (supine_projection){0};
}

typedef struct grid_heights {
  double *directions;        /* [count, 3] directions g of gravity at the nodes of the grid */
  double *minimum, *maximum; /* [count] extremes of g.p over all vertices p for each g, mm */
} grid_heights;

/* Find the directions g of the grid, and the minimum and maximum of g.p over all vertices p. Those
 * of direction -g follow from those of g by negation. */
static supine_status find_heights(const supine_lungs *lungs, bool pair, const supine_sh_grid *grid,
                                  grid_heights *made) {
  const size_t width = grid->longitudes;
  const size_t count = grid->latitudes * width;
  for (size_t d = 0; d < count; ++d) {
    supine_sh_grid_direction(grid, d / width, d % width, made->directions + 3 * d);
  }
  const supine_status status = supine_physics_height_range(lungs, pair, count / 2, made->directions,
                                                           made->minimum, made->maximum);
  for (size_t d = 0; d < count / 2; ++d) {
    const size_t opposite =
        (grid->latitudes - 1 - d / width) * width + (d % width + width / 2) % width;
    made->minimum[opposite] = -made->maximum[d];
    made->maximum[opposite] = -made->minimum[d];
  }
  return status;
}

/* Expand the weights w_r(g) of projection.h, which depend on the direction g of gravity and have
 * kinks where another vertex becomes the lowest or highest, in spherical harmonics of g. Write the
 * coefficients to functions [span->rank, (band + 1)^2]. */
static supine_status expand(const supine_lungs *lungs, const supine_force_law *law, size_t band,
                            const supine_span *span, const supine_sh_grid *grid,
                            double *functions) {
  const size_t count = grid->latitudes * grid->longitudes;
  SUPINE_ARENA arena = {0};
  grid_heights heights = {supine_arena_take(&arena, 3 * count, sizeof(double)),
                          supine_arena_take(&arena, count, sizeof(double)),
                          supine_arena_take(&arena, count, sizeof(double))};
  double *weights = supine_arena_take(&arena, count * span->rank, sizeof *weights);
  SUPINE_TRY(supine_arena_status(&arena));
  SUPINE_TRY(find_heights(lungs, law->pair, grid, &heights));
  const supine_gravities gravities = {count, heights.directions, heights.minimum, heights.maximum};
  SUPINE_TRY(supine_projection_span_weights(lungs, law, span, &gravities, weights));
  return supine_sh_transform(band, grid, span->rank, weights, functions, NULL);
}

/* Solve the physical model for each direction of gravity of made->span, into the columns. */
static supine_status solve(const supine_lungs *lungs, const supine_model *model,
                           supine_projection *made, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const size_t rank = made->expansion.rank;
  double range[2 * SUPINE_SPAN_MAX];
  const supine_gravities gravities = {rank, made->span->directions, range, range + rank};
  supine_equilibrium *equilibrium = NULL;
  if (supine_physics_height_range(lungs, model->force.pair, rank, made->span->directions, range,
                                  range + rank) != SUPINE_OK) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  supine_status status = supine_physics_model_equilibrium(lungs, model, &equilibrium, error);
  if (status == SUPINE_OK) {
    supine_physics_force(lungs, &model->force, &gravities, n, NULL, made->expansion.columns);
    status = supine_physics_equilibrium_solve(equilibrium, rank, made->expansion.columns,
                                              made->expansion.columns, error);
  }
  supine_physics_equilibrium_destroy(equilibrium);
  return status;
}

supine_status supine_projection_create(const supine_lungs *lungs, const supine_model *model,
                                       size_t band, supine_projection *projection,
                                       supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  supine_expansion *expansion = &projection->expansion;
  supine_sh_grid *grid = NULL;
  *projection = (supine_projection){.expansion = {.row_count = n, .band = band}};
  SUPINE_REFUSE_IF(band > SUPINE_SH_BAND_MAX, error, SUPINE_ERROR_ARGUMENT,
                   "band %zu: give at most %d", band, SUPINE_SH_BAND_MAX);
  projection->span = malloc(sizeof *projection->span);
  if (projection->span == NULL) {
    return supine_error_memory(error, "the forces");
  }
  SUPINE_TRY(supine_projection_span_create(lungs, &model->force, projection->span, error));
  expansion->rank = projection->span->rank;
  expansion->columns = malloc(n * expansion->rank * sizeof *expansion->columns);
  expansion->functions =
      malloc(expansion->rank * supine_sh_count(band) * sizeof *expansion->functions);
  if (expansion->columns == NULL || expansion->functions == NULL) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  supine_status status = supine_sh_grid_for_kinks(band, &grid);
  if (status == SUPINE_OK) {
    status = expand(lungs, &model->force, band, projection->span, grid, expansion->functions);
    supine_sh_grid_destroy(grid);
  }
  SUPINE_REFUSE_IF(status != SUPINE_OK, error, status, "projection to band %zu: %s", band,
                   supine_status_string(status));
  return solve(lungs, model, projection, error);
}

void supine_projection_field_free(supine_gravity_field *field) {
  supine_sh_expansion_free(&field->expansion);
  supine_arena_free(&field->memory);
  *field = (supine_gravity_field){.rows = {.kind = SUPINE_ROWS_SCALAR}};
}

/* Replace the force on each vertex by the coordinates of its displacement, mm, in tissue whose
 * expandability varies. */
static supine_status apply_strain(const supine_model *model, supine_gravity_field *field,
                                  supine_error *error) {
  supine_expansion *expansion = &field->expansion;
  const size_t rank = expansion->rank;
  const size_t rows = 3 * expansion->row_count;
  double *columns = malloc(rows * rank * sizeof *columns);
  if (columns == NULL) {
    return supine_error_memory(error, "%zu vertices", rows / 3);
  }
  for (size_t i = 0; i < rows * rank; ++i) {
    columns[i] =
        expansion->columns[i / (3 * rank) * rank + i % rank] * field->rows.directions[i / rank];
  }
  free(expansion->columns);
  supine_arena_free(&field->memory);
  field->rows = (supine_rows){.kind = SUPINE_ROWS_VECTOR};
  field->weight = NULL;
  expansion->columns = columns;
  expansion->row_count = rows;
  return supine_physics_strain_apply(model->strain, NULL, 3 * rank, columns, error);
}

supine_status supine_projection_field(const supine_lungs *lungs, const supine_model *model,
                                      supine_projection *projection, supine_gravity_field *field,
                                      supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  double *directions = supine_arena_take(&field->memory, 3 * n, sizeof *directions);
  field->weight = supine_arena_take(&field->memory, n, sizeof *field->weight);
  SUPINE_TRY(supine_arena_check(&field->memory, error, "%zu vertices", n));
  SUPINE_TRY(supine_physics_directions(lungs, &model->force, &model->direction, directions, error));
  /* With these weights, the modes minimise the error of the displacement: 0.34 % RMS for a left
   * lung, 0.40 % without weights. */
  for (size_t i = 0; i < n; ++i) {
    const double *d = directions + 3 * i;
    field->weight[i] = supine_dot(d, d);
  }
  field->rows = (supine_rows){SUPINE_ROWS_SCALAR, directions};
  field->expansion = projection->expansion;
  projection->expansion = (supine_expansion){0};
  if (model->strain != NULL) {
    SUPINE_TRY(apply_strain(model, field, error));
  }
  return SUPINE_OK;
}

void supine_projection_displacement(const supine_compression *compression, const supine_rows *rows,
                                    const double *weights, double *u) {
  const size_t modes = compression->mode_count;
  for (size_t i = 0; i < compression->row_count; ++i) {
    double field = 0.0;
    for (size_t k = 0; k < modes; ++k) {
      field += weights[k] * (double)compression->coefficients[i * modes + k];
    }
    if (rows->kind == SUPINE_ROWS_VECTOR) {
      u[i] = field;
    } else {
      for (size_t at = 3 * i; at < 3 * i + 3; ++at) {
        u[at] = field * rows->directions[at];
      }
    }
  }
}

supine_status supine_projection_volume_forms(const supine_compression *compression,
                                             const supine_lungs *lungs, const double *share,
                                             const supine_rows *rows, supine_volume_forms *forms,
                                             supine_error *error) {
  const size_t count = compression->mode_count;
  const size_t values = compression->row_count * count;
  SUPINE_ARENA arena = {0};
  double *columns = supine_arena_take(&arena, values, sizeof *columns);
  SUPINE_TRY(supine_arena_check(&arena, error, "volume coefficients of %zu modes", count));
  for (size_t i = 0; i < values; ++i) {
    columns[i] = (double)compression->coefficients[i];
  }
  return supine_physics_volume_forms_create(lungs, share, rows, columns, count, forms, error);
}
