/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The sampled route: a full solve for every direction of a grid, then the transform of every
 * vertex's field. */
#include <stdlib.h>

#include "sh/transform.h"
#include <supine/sh.h>

#include "precompute/projection/sampler.h"

/* Over 60 lines: memory for the whole route is taken in one place. */
supine_status supine_projection_sampled(const supine_lungs *lungs, const supine_model *model,
                                        size_t band, supine_progress_function *progress,
                                        void *context, supine_projection *projection,
                                        supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const size_t terms = supine_sh_count(band);
  supine_projection made = {.vertex_count = n, .band = band, .rank = terms};
  supine_sampler *sampler = NULL;
  supine_sh_grid *grid = NULL;
  supine_sh_transform *plan = NULL;
  double *directions = NULL;
  double *ring = NULL;
  supine_solve_report worst = {0};
  supine_status status = supine_projection_sampler_create(lungs, model, &sampler, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  size_t latitudes = 0;
  size_t longitudes = 0;
  status = supine_sh_grid_size(band, 0.0, &latitudes, &longitudes);
  if (status == SUPINE_OK) {
    status = supine_sh_grid_create(latitudes, longitudes, &grid);
  }
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "no grid for band %zu: %s", band,
                           supine_status_string(status));
    goto cleanup;
  }
  status = supine_sh_transform_create(band, grid, &plan, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  directions = malloc(3 * grid->longitudes * sizeof *directions);
  ring = malloc(grid->longitudes * n * sizeof *ring);
  made.columns = calloc(n * terms, sizeof *made.columns);
  if (directions == NULL || ring == NULL || made.columns == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY,
                              "no memory to sample %zu vertices to band %zu (%.1f GB)", n, band,
                              8e-9 * (double)n * (double)(terms + grid->longitudes));
    goto cleanup;
  }
  const supine_sh_batch batch = {.fields = n};
  for (size_t j = 0; j < grid->latitudes && status == SUPINE_OK; ++j) {
    if (progress != NULL && !progress(context, (double)j / (double)grid->latitudes)) {
      status =
          supine_error_set(error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
      break;
    }
    for (size_t k = 0; k < grid->longitudes; ++k) {
      supine_sh_grid_direction(grid, j, k, directions + 3 * k);
    }
    /* from one latitude to the next, each longitude starts from its last field */
    status = supine_projection_sampler_solve(sampler, grid->longitudes, directions, j > 0, ring,
                                             &worst, error);
    if (status == SUPINE_OK) {
      status = supine_sh_forward_ring(plan, &batch, j, ring, made.columns, error);
    }
  }
  if (status == SUPINE_OK) {
    made.solve_count = grid->latitudes * grid->longitudes;
    made.iterations = worst.iterations;
    made.residual = worst.residual;
    *projection = made;
    made = (supine_projection){0};
  }
cleanup:
  supine_projection_free(&made);
  supine_sh_transform_destroy(plan);
  supine_sh_grid_destroy(grid);
  supine_projection_sampler_destroy(sampler);
  free(directions);
  free(ring);
  return status;
}
