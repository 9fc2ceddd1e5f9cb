/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The linear route: the operator does not turn with gravity, so a few solves serve all directions.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/projection/projection.h"
#include "sh/grid.h"
#include <supine/sh.h>

/* The functions of gravity have kinks where another vertex becomes the lowest or highest. Rules
 * much finer than the band keep the kinks from aliasing into it, and cost no solve. */
enum { LATITUDES_PER_BAND = 8, LATITUDES_MIN = 32 };

void supine_projection_free(supine_projection *projection) {
  free(projection->columns);
  free(projection->functions);
  *projection = (supine_projection){0};
}

/* functions[r, lm] = integral of function r times Y_lm, by the rule's sum. */
static supine_status project_functions(const supine_lungs *lungs, const supine_force_law *law,
                                       size_t band, size_t latitudes, size_t longitudes,
                                       size_t rank, double *functions) {
  const size_t terms = supine_sh_count(band);
  const size_t count = latitudes * longitudes;
  supine_sh_grid *grid = NULL;
  supine_status status = supine_sh_grid_create(latitudes, longitudes, &grid);
  double *directions = malloc(3 * count * sizeof *directions);
  double *minimum = malloc(count * sizeof *minimum);
  double *maximum = malloc(count * sizeof *maximum);
  double *y = malloc(terms * sizeof *y);
  if (status != SUPINE_OK || directions == NULL || minimum == NULL || maximum == NULL ||
      y == NULL) {
    status = status == SUPINE_OK ? SUPINE_ERROR_MEMORY : status;
    goto cleanup;
  }
  for (size_t d = 0; d < count; ++d) {
    supine_sh_grid_direction(grid, d / grid->longitudes, d % grid->longitudes, directions + 3 * d);
  }
  status = supine_physics_height_range(lungs, law->pair, count, directions, minimum, maximum);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  memset(functions, 0, rank * terms * sizeof *functions);
  const double step = 2.0 * M_PI / (double)grid->longitudes;
  for (size_t d = 0; d < count; ++d) {
    const double *g = directions + 3 * d;
    double values[SUPINE_FORCE_COLUMNS_MAX];
    supine_physics_force_functions(lungs, law, g, minimum[d], maximum[d], values);
    status = supine_sh_evaluate(band, g, y);
    if (status != SUPINE_OK) {
      goto cleanup;
    }
    for (size_t r = 0; r < rank; ++r) {
      const double value = grid->weight[d / grid->longitudes] * step * values[r];
      for (size_t t = 0; t < terms; ++t) {
        functions[r * terms + t] += value * y[t];
      }
    }
  }
cleanup:
  supine_sh_grid_destroy(grid);
  free(directions);
  free(minimum);
  free(maximum);
  free(y);
  return status;
}

supine_status supine_projection_linear(const supine_lungs *lungs, const supine_model *model,
                                       size_t band, supine_projection *projection,
                                       supine_error *error) {
  size_t latitudes = LATITUDES_PER_BAND * (band + 1);
  latitudes = latitudes < LATITUDES_MIN ? LATITUDES_MIN : latitudes;
  return supine_projection_linear_rule(lungs, model, band, latitudes, 2 * latitudes, projection,
                                       error);
}

supine_status supine_projection_linear_rule(const supine_lungs *lungs, const supine_model *model,
                                            size_t band, size_t latitudes, size_t longitudes,
                                            supine_projection *projection, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const supine_force_law *law = &model->force;
  const size_t rank = supine_physics_force_column_count(law);
  supine_network *network = NULL;
  supine_equilibrium *equilibrium = NULL;
  double *force = NULL;
  supine_solve_report report = {0};
  supine_projection made = {.vertex_count = n, .band = band, .rank = rank, .solve_count = rank};
  if (law->soften != 0.0) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the linear route needs soften = 0: the stiffness may not turn");
  }
  if (band > SUPINE_SH_BAND_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "band %zu is above %d", band,
                            SUPINE_SH_BAND_MAX);
  }
  supine_status status = supine_physics_model_network(lungs, model, &network);
  if (status == SUPINE_OK) {
    status = supine_physics_equilibrium_create(network, rank, 0, &equilibrium);
  }
  force = malloc(n * rank * sizeof *force);
  made.columns = malloc(n * rank * sizeof *made.columns);
  made.functions = malloc(rank * supine_sh_count(band) * sizeof *made.functions);
  if (status != SUPINE_OK || force == NULL || made.columns == NULL || made.functions == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to solve %zu vertices", n);
    goto cleanup;
  }
  status = supine_physics_equilibrium_set_stiffness(equilibrium, model->stiffness, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  supine_physics_force_columns(lungs, law, force);
  status = supine_physics_equilibrium_solve(equilibrium, rank, force, model->tolerance, false,
                                            made.columns, &report, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  made.iterations = report.iterations;
  made.residual = report.residual;
  status = project_functions(lungs, law, band, latitudes, longitudes, rank, made.functions);
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "projection to band %zu: %s", band,
                           supine_status_string(status));
    goto cleanup;
  }
  *projection = made;
  made = (supine_projection){0};
cleanup:
  supine_projection_free(&made);
  free(force);
  supine_physics_equilibrium_destroy(equilibrium);
  supine_physics_network_destroy(network);
  return status;
}
