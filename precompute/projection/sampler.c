/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Full solves for many directions, several at a time. */
#include <math.h>
#include <stdlib.h>

#include "sh/base/clones.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"

#include "precompute/projection/sampler.h"

enum {
  LANES = 8,           /* directions side by side: a cache line of doubles */
  LANE_BYTES = 64,     /* that a lane of a solve takes for every vertex, and */
  LANE_LINK_BYTES = 4, /* for every link, where conductances depend on the stiffness */
  AT_ONCE_MAX = 8      /* solves: a ring of directions has no more */
};

static const double bytes_max = 600e6; /* of all solves at once (projection.h) */

/* A solve of some lanes and what it works with, one a thread. */
typedef struct group {
  supine_equilibrium *equilibrium;
  double *force;  /* [N, LANES] */
  double *fields; /* [N, LANES] */
  supine_status status;
  supine_error error;
  supine_solve_report worst;
} group;

struct supine_sampler {
  const supine_lungs *lungs;
  const supine_model *model;
  double tolerance;
  supine_network *network;
  size_t column_count;
  double *columns;  /* [N, column_count] that the force is a sum of */
  double middle[3]; /* mean position */
  size_t group_count;
  group groups[AT_ONCE_MAX];
};

void supine_projection_sampler_destroy(supine_sampler *sampler) {
  if (sampler == NULL) {
    return;
  }
  for (size_t k = 0; k < sampler->group_count; ++k) {
    supine_physics_equilibrium_destroy(sampler->groups[k].equilibrium);
    free(sampler->groups[k].force);
    free(sampler->groups[k].fields);
  }
  free(sampler->columns);
  supine_physics_network_destroy(sampler->network);
  free(sampler);
}

/* As many solves at once as there are threads and memory for. */
static size_t groups_of(const supine_lungs *lungs, const supine_model *model, size_t threads) {
  const double links = model->reach > 0.0 || model->force.soften == 0.0
                           ? 0.0
                           : 2.0 * (double)lungs->topology.edge_count;
  const double bytes =
      LANES * (LANE_BYTES * (double)lungs->mesh.vertex_count + LANE_LINK_BYTES * links);
  const size_t fit = (size_t)fmin(bytes_max / bytes, AT_ONCE_MAX);
  return fit < 1 ? 1 : fit < threads ? fit : threads;
}

static supine_status group_create(const supine_sampler *sampler, size_t threads, group *made,
                                  supine_error *error) {
  const size_t n = sampler->lungs->mesh.vertex_count;
  made->force = malloc(n * LANES * sizeof *made->force);
  made->fields = malloc(n * LANES * sizeof *made->fields);
  supine_status status =
      supine_physics_equilibrium_create(sampler->network, LANES, threads, &made->equilibrium);
  if (status != SUPINE_OK || made->force == NULL || made->fields == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to sample %zu vertices", n);
  }
  return supine_physics_equilibrium_set_stiffness(made->equilibrium, sampler->model->stiffness,
                                                  error);
}

supine_status supine_projection_sampler_create(const supine_lungs *lungs, const supine_model *model,
                                               supine_sampler **sampler, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const size_t threads = supine_thread_count();
  supine_sampler *made = calloc(1, sizeof *made);
  *sampler = NULL;
  if (made == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to sample the field");
  }
  made->lungs = lungs;
  made->model = model;
  made->tolerance = model->tolerance > 0.0 ? model->tolerance : SUPINE_SAMPLE_TOLERANCE;
  made->column_count = supine_physics_force_column_count(&model->force);
  made->columns = malloc(n * made->column_count * sizeof *made->columns);
  supine_status status = supine_physics_model_network(lungs, model, &made->network);
  if (status != SUPINE_OK || made->columns == NULL) {
    supine_projection_sampler_destroy(made);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to sample %zu vertices", n);
  }
  supine_physics_force_columns(lungs, &model->force, made->columns);
  for (size_t i = 0; i < 3 * n; ++i) {
    made->middle[i % 3] += lungs->mesh.vertices[i] / (double)n;
  }
  made->group_count = groups_of(lungs, model, threads);
  for (size_t k = 0; k < made->group_count && status == SUPINE_OK; ++k) {
    status = group_create(made, threads / made->group_count, &made->groups[k], error);
  }
  if (status != SUPINE_OK) {
    supine_projection_sampler_destroy(made);
    return status;
  }
  *sampler = made;
  return SUPINE_OK;
}

/* Some directions to solve. */
typedef struct sample_work {
  supine_sampler *sampler;
  size_t count;
  const double *directions; /* [count, 3] */
  const double *minimum, *maximum;
  bool warm;
  double *fields; /* [count, N] */
} sample_work;

/* Exponents of the softening, soften (h - mean h), of some directions, [N, lanes]: E of force.h,
 * scaled to geometric mean 1. */
static void find_exponents(const sample_work *work, size_t first, size_t lanes, double *exponents) {
  const supine_sampler *sampler = work->sampler;
  double slope[LANES][3];
  double mean[LANES] = {0.0};
  for (size_t r = 0; r < lanes; ++r) {
    const size_t d = first + r;
    for (size_t k = 0; k < 3; ++k) {
      slope[r][k] = sampler->model->force.soften * work->directions[3 * d + k] /
                    (work->maximum[d] - work->minimum[d]);
      mean[r] += slope[r][k] * sampler->middle[k];
    }
  }
  for (size_t i = 0; i < sampler->lungs->mesh.vertex_count; ++i) {
    const double *p = sampler->lungs->mesh.vertices + 3 * i;
    for (size_t r = 0; r < lanes; ++r) {
      exponents[i * lanes + r] = supine_dot(slope[r], p) - mean[r];
    }
  }
}

/* (18) at some directions, [N, lanes], as its columns times functions of gravity. */
static void find_forces(const sample_work *work, size_t first, size_t lanes, double *force) {
  const supine_sampler *sampler = work->sampler;
  const size_t columns = sampler->column_count;
  double functions[SUPINE_FORCE_COLUMNS_MAX][LANES];
  for (size_t r = 0; r < lanes; ++r) {
    double values[SUPINE_FORCE_COLUMNS_MAX];
    supine_physics_force_functions(sampler->lungs, &sampler->model->force,
                                   work->directions + 3 * (first + r), work->minimum[first + r],
                                   work->maximum[first + r], values);
    for (size_t k = 0; k < columns; ++k) {
      functions[k][r] = values[k];
    }
  }
  for (size_t i = 0; i < sampler->lungs->mesh.vertex_count; ++i) {
    for (size_t r = 0; r < lanes; ++r) {
      double sum = 0.0;
      for (size_t k = 0; k < columns; ++k) {
        sum += sampler->columns[i * columns + k] * functions[k][r];
      }
      force[i * lanes + r] = sum;
    }
  }
}

static void solve_lanes(const sample_work *work, group *mine, size_t first, size_t lanes) {
  const supine_sampler *sampler = work->sampler;
  const size_t n = sampler->lungs->mesh.vertex_count;
  double *fields = work->fields + first * n;
  supine_solve_report report = {0};
  if (sampler->model->force.soften != 0.0) {
    find_exponents(work, first, lanes, mine->fields);
    mine->status = supine_physics_equilibrium_soften(mine->equilibrium, lanes, mine->fields);
    if (mine->status != SUPINE_OK) {
      (void)supine_error_set(&mine->error, mine->status, "no memory to sample %zu vertices", n);
      return;
    }
  }
  find_forces(work, first, lanes, mine->force);
  for (size_t i = 0; i < n && work->warm; ++i) {
    for (size_t r = 0; r < lanes; ++r) {
      mine->fields[i * lanes + r] = fields[r * n + i];
    }
  }
  mine->status =
      supine_physics_equilibrium_solve(mine->equilibrium, lanes, mine->force, sampler->tolerance,
                                       work->warm, mine->fields, &report, &mine->error);
  for (size_t i = 0; i < n; ++i) {
    for (size_t r = 0; r < lanes; ++r) {
      fields[r * n + i] = mine->fields[i * lanes + r];
    }
  }
  supine_solve_report *worst = &mine->worst;
  worst->iterations = report.iterations > worst->iterations ? report.iterations : worst->iterations;
  worst->residual = fmax(worst->residual, report.residual);
}

/* Lanes begin at the same directions whoever takes them. */
static void sample_range(void *context, size_t begin, size_t end, size_t thread) {
  const sample_work *work = context;
  group *mine = &work->sampler->groups[thread];
  for (size_t k = begin; k < end && mine->status == SUPINE_OK; ++k) {
    const size_t left = work->count - k * LANES;
    solve_lanes(work, mine, k * LANES, left < LANES ? left : LANES);
  }
}

supine_status supine_projection_sampler_solve(supine_sampler *sampler, size_t count,
                                              const double *directions, bool warm, double *fields,
                                              supine_solve_report *worst, supine_error *error) {
  if (sampler == NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "there is no sampler");
  }
  double *range = malloc((2 * count + 1) * sizeof *range);
  if (range == NULL ||
      supine_physics_height_range(sampler->lungs, sampler->model->force.pair, count, directions,
                                  range, range + count) != SUPINE_OK) {
    free(range);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to solve %zu directions", count);
  }
  const size_t groups = sampler->group_count;
  sample_work work = {sampler, count, directions, range, range + count, warm, fields};
  for (size_t k = 0; k < groups; ++k) {
    sampler->groups[k].status = SUPINE_OK;
    sampler->groups[k].worst = (supine_solve_report){0};
  }
  supine_parallel_for((count + LANES - 1) / LANES, 1, groups, sample_range, &work);
  supine_status status = SUPINE_OK;
  for (size_t k = 0; k < groups; ++k) {
    const group *mine = &sampler->groups[k];
    if (mine->status != SUPINE_OK && status == SUPINE_OK) {
      status = supine_error_set(error, mine->status, "%s", mine->error.message);
    }
    if (worst != NULL) {
      worst->iterations =
          mine->worst.iterations > worst->iterations ? mine->worst.iterations : worst->iterations;
      worst->residual = fmax(worst->residual, mine->worst.residual);
    }
  }
  free(range);
  return status;
}
