/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The sampled route: a full solve for every direction of a grid, then the transform of every
 * vertex's field. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/parallel.h"
#include "sh/transform.h"
#include <supine/sh.h>

#include "precompute/projection/sampled.h"

struct supine_sampler {
  const supine_lungs *lungs;
  const supine_model *model;
  double tolerance;
  size_t threads;
  supine_network *network;
  supine_equilibrium **equilibria; /* one a thread */
  double **force;                  /* [N] one a thread */
  double **softened;               /* [N] one a thread */
};

void supine_projection_sampler_destroy(supine_sampler *sampler) {
  if (sampler == NULL) {
    return;
  }
  for (size_t t = 0; t < sampler->threads; ++t) {
    if (sampler->equilibria != NULL) {
      supine_physics_equilibrium_destroy(sampler->equilibria[t]);
    }
    if (sampler->force != NULL) {
      free(sampler->force[t]);
    }
    if (sampler->softened != NULL) {
      free(sampler->softened[t]);
    }
  }
  free(sampler->equilibria);
  free(sampler->force);
  free(sampler->softened);
  supine_physics_network_destroy(sampler->network);
  free(sampler);
}

supine_status supine_projection_sampler_create(const supine_lungs *lungs, const supine_model *model,
                                               double tolerance, supine_sampler **sampler,
                                               supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  supine_sampler *made = calloc(1, sizeof *made);
  *sampler = NULL;
  if (made == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to sample the field");
  }
  made->lungs = lungs;
  made->model = model;
  made->tolerance = tolerance;
  made->threads = supine_thread_count();
  made->equilibria = calloc(made->threads, sizeof(supine_equilibrium *));
  made->force = calloc(made->threads, sizeof(double *));
  made->softened = calloc(made->threads, sizeof(double *));
  bool whole = made->equilibria != NULL && made->force != NULL && made->softened != NULL &&
               supine_physics_model_network(lungs, model, &made->network) == SUPINE_OK;
  supine_status status = SUPINE_OK;
  for (size_t t = 0; t < made->threads && whole; ++t) {
    made->force[t] = malloc(n * sizeof(double));
    made->softened[t] = malloc(n * sizeof(double));
    whole =
        made->force[t] != NULL && made->softened[t] != NULL &&
        supine_physics_equilibrium_create(made->network, 1, 1, &made->equilibria[t]) == SUPINE_OK;
    if (whole) { /* stays so unless the law softens; also finds bad stiffness before the work */
      status =
          supine_physics_equilibrium_set_stiffness(made->equilibria[t], model->stiffness, error);
      if (status != SUPINE_OK) {
        break;
      }
    }
  }
  if (!whole) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to sample %zu vertices", n);
  }
  if (status != SUPINE_OK) {
    supine_projection_sampler_destroy(made);
    return status;
  }
  *sampler = made;
  return SUPINE_OK;
}

/* Some directions to solve, and what came of them. */
typedef struct sample_work {
  supine_sampler *sampler;
  const double *directions; /* [count, 3] */
  const double *minimum, *maximum;
  double *fields; /* [count, N] */
  supine_status *statuses;
  supine_error *errors;
  supine_solve_report *worst; /* one a thread */
} sample_work;

/* Neighbouring directions have neighbouring fields: each solve starts from the last. */
static void sample_range(void *context, size_t begin, size_t end, size_t thread) {
  const sample_work *work = context;
  supine_sampler *sampler = work->sampler;
  const size_t n = sampler->lungs->mesh.vertex_count;
  supine_equilibrium *equilibrium = sampler->equilibria[thread];
  for (size_t d = begin; d < end && work->statuses[thread] == SUPINE_OK; ++d) {
    const double *g = work->directions + 3 * d;
    if (sampler->model->force.soften != 0.0) {
      supine_physics_force_stiffness(sampler->lungs, &sampler->model->force,
                                     sampler->model->stiffness, g, work->minimum[d],
                                     work->maximum[d], sampler->softened[thread]);
      work->statuses[thread] = supine_physics_equilibrium_set_stiffness(
          equilibrium, sampler->softened[thread], &work->errors[thread]);
      if (work->statuses[thread] != SUPINE_OK) {
        return;
      }
    }
    supine_physics_force(sampler->lungs, &sampler->model->force, g, work->minimum[d],
                         work->maximum[d], sampler->force[thread]);
    supine_solve_report report;
    work->statuses[thread] = supine_physics_equilibrium_solve(
        equilibrium, 1, sampler->force[thread], sampler->tolerance, d > begin, work->fields + d * n,
        &report, &work->errors[thread]);
    supine_solve_report *worst = &work->worst[thread];
    worst->iterations =
        report.iterations > worst->iterations ? report.iterations : worst->iterations;
    worst->residual = fmax(worst->residual, report.residual);
  }
}

supine_status supine_projection_sampler_solve(supine_sampler *sampler, size_t count,
                                              const double *directions, double *fields,
                                              supine_solve_report *worst, supine_error *error) {
  if (sampler == NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "there is no sampler");
  }
  const size_t threads = sampler->threads;
  supine_status status = SUPINE_ERROR_MEMORY;
  double *range = malloc(2 * count * sizeof *range);
  supine_status *statuses = calloc(threads, sizeof *statuses);
  supine_error *errors = calloc(threads, sizeof *errors);
  supine_solve_report *reports = calloc(threads, sizeof *reports);
  if (range == NULL || statuses == NULL || errors == NULL || reports == NULL ||
      supine_physics_height_range(&sampler->lungs->mesh, count, directions, range, range + count) !=
          SUPINE_OK) {
    (void)supine_error_set(error, status, "no memory to solve %zu directions", count);
    goto cleanup;
  }
  sample_work work = {sampler, directions, range, range + count, fields, statuses, errors, reports};
  supine_parallel_for(count, 1, threads, sample_range, &work);
  status = SUPINE_OK;
  for (size_t t = 0; t < threads; ++t) {
    if (statuses[t] != SUPINE_OK && status == SUPINE_OK) {
      status = supine_error_set(error, statuses[t], "%s", errors[t].message);
    }
    if (worst != NULL) {
      worst->iterations =
          reports[t].iterations > worst->iterations ? reports[t].iterations : worst->iterations;
      worst->residual = fmax(worst->residual, reports[t].residual);
    }
  }
cleanup:
  free(range);
  free(statuses);
  free(errors);
  free(reports);
  return status;
}

supine_status supine_projection_sampled(const supine_lungs *lungs, const supine_model *model,
                                        size_t band, double tolerance,
                                        supine_progress_function *progress, void *context,
                                        supine_projection *projection, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const size_t terms = supine_sh_count(band);
  supine_projection made = {.vertex_count = n, .band = band, .rank = terms};
  supine_sampler *sampler = NULL;
  supine_sh_grid *grid = NULL;
  supine_sh_transform *plan = NULL;
  double *directions = NULL;
  double *ring = NULL;
  supine_solve_report worst = {0};
  supine_status status = supine_projection_sampler_create(lungs, model, tolerance, &sampler, error);
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
    status =
        supine_projection_sampler_solve(sampler, grid->longitudes, directions, ring, &worst, error);
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
