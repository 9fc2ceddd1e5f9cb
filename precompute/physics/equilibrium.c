/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The equilibrium of (5), (12)-(14): springs eliminated, the matrix made symmetric and scaled. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/physics/equilibrium_internal.h"

enum { ROWS_GRAIN = 4096, STEPS_MAX = 200, STEPS_MAX_WITH_REACH = 20000 };

static const double default_tolerance = 1e-14;

supine_status supine_physics_equilibrium_create(const supine_network *network, size_t rhs_max,
                                                size_t threads, supine_equilibrium **equilibrium) {
  *equilibrium = NULL;
  if (rhs_max < 1 || rhs_max > SUPINE_RHS_MAX) {
    return SUPINE_ERROR_ARGUMENT;
  }
  supine_equilibrium *made = calloc(1, sizeof *made);
  if (made == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  const size_t n = network->vertex_count;
  const size_t links = network->row_begin[n];
  const size_t used = threads == 0 ? supine_thread_count() : threads;
  made->network = network;
  made->rhs_max = rhs_max;
  made->threads = used > SUPINE_SOLVE_THREADS_MAX ? SUPINE_SOLVE_THREADS_MAX : used;
  made->stiffness = malloc(n * sizeof(double));
  made->inner = malloc(n * sizeof(double));
  made->weight = malloc((links + 1) * sizeof(double));
  made->scale = malloc(n * sizeof(double));
  supine_status status = supine_physics_relaxation_prepare(made);
  made->right = malloc(n * rhs_max * sizeof(double));
  made->solution = malloc((n + made->halo_count) * rhs_max * sizeof(double));
  if (status != SUPINE_OK || made->stiffness == NULL || made->inner == NULL ||
      made->weight == NULL || made->scale == NULL || made->right == NULL ||
      made->solution == NULL) {
    supine_physics_equilibrium_destroy(made);
    return SUPINE_ERROR_MEMORY;
  }
  *equilibrium = made;
  return SUPINE_OK;
}

void supine_physics_equilibrium_destroy(supine_equilibrium *equilibrium) {
  if (equilibrium != NULL) {
    free(equilibrium->stiffness);
    free(equilibrium->inner);
    free(equilibrium->weight);
    free(equilibrium->scale);
    free(equilibrium->right);
    free(equilibrium->solution);
    free(equilibrium->halo);
    free(equilibrium->column);
    free(equilibrium->residual);
    free(equilibrium->direction);
    free(equilibrium->product);
    free(equilibrium->image);
    free(equilibrium);
  }
}

/* Diagonal of the reduced matrix, and k_ij of its links. */
static void matrix_rows(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  supine_equilibrium *eq = context;
  const supine_network *net = eq->network;
  for (size_t i = begin; i < end; ++i) {
    const double own = eq->inner[i];
    double diagonal = net->own == NULL ? 1.0 : net->own[i]; /* Z_i / S_i - sum of k_ij */
    for (size_t s = net->row_begin[i]; s < net->row_begin[i + 1]; ++s) {
      const double other = eq->inner[net->neighbour[s]];
      const double d = net->distance[s];
      const double spring = 0.5 * (own + other);
      const double k = spring / (d * (net->spring_own * d * spring + 1.0 / own + 1.0 / other));
      eq->weight[s] = k;
      diagonal += own * spring / d - k;
    }
    eq->scale[i] = 1.0 / sqrt(diagonal);
  }
}

static void scale_rows(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  supine_equilibrium *eq = context;
  const supine_network *net = eq->network;
  for (size_t i = begin; i < end; ++i) {
    for (size_t s = net->row_begin[i]; s < net->row_begin[i + 1]; ++s) {
      eq->weight[s] *= eq->scale[i] * eq->scale[net->neighbour[s]];
    }
  }
}

supine_status supine_physics_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                                       const double *stiffness,
                                                       supine_error *error) {
  const supine_network *net = equilibrium->network;
  const supine_status status = supine_physics_stiffness_normalise(net->vertex_count, stiffness,
                                                                  equilibrium->stiffness, error);
  if (status != SUPINE_OK) {
    return status;
  }
  for (size_t i = 0; i < net->vertex_count && net->lesions != NULL; ++i) {
    equilibrium->stiffness[i] *= net->lesions[i];
  }
  for (size_t i = 0; i < net->vertex_count; ++i) {
    equilibrium->inner[i] = equilibrium->stiffness[net->order[i]];
  }
  supine_parallel_for(net->vertex_count, ROWS_GRAIN, equilibrium->threads, matrix_rows,
                      equilibrium);
  supine_parallel_for(net->vertex_count, ROWS_GRAIN, equilibrium->threads, scale_rows, equilibrium);
  return SUPINE_OK;
}

/* Right-hand side b = scale own f / S in internal order, with <b, b>. */
static void load_range(void *context, size_t begin, size_t end, size_t thread) {
  supine_pass *work = context;
  supine_equilibrium *eq = work->eq;
  const size_t count = eq->count;
  double sums[SUPINE_RHS_MAX] = {0.0};
  for (size_t i = begin; i < end; ++i) {
    const double own = eq->network->own == NULL ? 1.0 : eq->network->own[i];
    const double factor = eq->scale[i] * eq->inner[i] * own;
    const double *force = work->force + (size_t)eq->network->order[i] * count;
    for (size_t r = 0; r < count; ++r) {
      const double value = factor * force[r];
      eq->right[i * count + r] = value;
      sums[r] += value * value;
    }
  }
  memcpy(work->rr[thread], sums, sizeof sums);
}

/* F = S y = S scale v, (4), back in the file's order. */
static void store_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const supine_pass *work = context;
  const supine_equilibrium *eq = work->eq;
  for (size_t i = begin; i < end; ++i) {
    const double factor = eq->scale[i] / eq->inner[i];
    double *out = work->catch_ + (size_t)eq->network->order[i] * eq->count;
    for (size_t r = 0; r < eq->count; ++r) {
      out[r] = factor * eq->solution[i * eq->count + r];
    }
  }
}

/* A range function and its context, called with denormals flushed. */
typedef struct flushed {
  supine_range_function *function;
  void *context;
} flushed;

static void flushed_range(void *context, size_t begin, size_t end, size_t thread) {
  const flushed *call = context;
  const unsigned saved = supine_denormals_flush();
  call->function(call->context, begin, end, thread);
  supine_denormals_restore(saved);
}

void supine_physics_pass_run(supine_pass *work, supine_range_function *function) {
  flushed call = {function, work};
  memset(work->rr, 0, sizeof work->rr);
  memset(work->rw, 0, sizeof work->rw);
  supine_parallel_for(work->eq->network->vertex_count, ROWS_GRAIN, work->eq->threads, flushed_range,
                      &call);
}

double supine_physics_pass_total(double sums[SUPINE_SOLVE_THREADS_MAX][SUPINE_RHS_MAX], size_t r) {
  double sum = 0.0;
  for (size_t t = 0; t < SUPINE_SOLVE_THREADS_MAX; ++t) {
    sum += sums[t][r];
  }
  return sum;
}

supine_status supine_physics_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                               const double *force, double tolerance, bool warm,
                                               double *catch_, supine_solve_report *report,
                                               supine_error *error) {
  supine_equilibrium *eq = equilibrium;
  const bool reach = eq->network->reach > 0.0;
  supine_solve_report made = {0, INFINITY};
  supine_status status = SUPINE_OK;
  if (count < 1 || count > eq->rhs_max) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%zu right-hand sides asked, 1 to %zu set up", count, eq->rhs_max);
  }
  supine_pass *work = malloc(sizeof *work);
  if (work == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for a solve");
  }
  if (!warm || eq->count != count) {
    memset(eq->solution, 0, eq->network->vertex_count * count * sizeof(double));
  }
  eq->count = count;
  *work = (supine_pass){.eq = eq, .force = force, .catch_ = catch_};
  work->wanted = tolerance > 0.0 ? tolerance : default_tolerance;
  supine_physics_pass_run(work, load_range);
  for (size_t r = 0; r < count; ++r) {
    work->norm[r] = supine_physics_pass_total(work->rr, r);
  }
  /* A reach couples far beyond a link, and sweeps get slow; alone, a right-hand side has each row
   * wait for the last. Conjugate gradients take those, and what sweeps leave. */
  if (!reach && count > 1) {
    supine_physics_relaxation(work, &made);
  }
  if (made.residual > work->wanted) {
    status =
        supine_physics_conjugate_gradients(work, reach ? STEPS_MAX_WITH_REACH : STEPS_MAX, &made);
  }
  supine_physics_pass_run(work, store_range);
  const double wanted = work->wanted;
  free(work);
  if (report != NULL) {
    *report = made;
  }
  if (status != SUPINE_OK) {
    return supine_error_set(error, status, "no memory for a solve");
  }
  if (!(made.residual <= wanted)) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "equilibrium: relative residual %.3g after %zu steps, %.3g wanted",
                            made.residual, made.iterations, wanted);
  }
  return SUPINE_OK;
}

void supine_physics_equilibrium_spring_catch(const supine_equilibrium *equilibrium,
                                             const supine_topology *topology, double *catch_) {
  const supine_equilibrium *eq = equilibrium;
  const supine_network *net = eq->network;
  for (size_t e = 0; e < topology->edge_count; ++e) {
    const size_t i = net->rank[topology->edges[2 * e]];
    const size_t j = net->rank[topology->edges[2 * e + 1]];
    size_t s = net->row_begin[i];
    while (net->neighbour[s] != j) {
      ++s;
    }
    const double d = net->distance[s];
    const double spring = 0.5 * (eq->inner[i] + eq->inner[j]);
    const double own = net->spring_own * spring; /* S_e / D(e, e) */
    const double z = own + (1.0 / eq->inner[i] + 1.0 / eq->inner[j]) / d;
    for (size_t r = 0; r < eq->count; ++r) { /* F_e = S_e x_e / Z_e, x_e = S_e (y_i + y_j) / D */
      const double y = eq->scale[i] * eq->solution[i * eq->count + r] +
                       eq->scale[j] * eq->solution[j * eq->count + r];
      catch_[e * eq->count + r] = own / z * spring / d * y;
    }
  }
}

supine_status supine_physics_transfer_column(supine_equilibrium *equilibrium, size_t vertex,
                                             double *column, supine_error *error) {
  const size_t n = equilibrium->network->vertex_count;
  if (vertex >= n) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "vertex %zu of %zu: they count from 0",
                            vertex, n);
  }
  double *force = calloc(n, sizeof *force);
  if (force == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu forces", n);
  }
  force[vertex] = 1.0;
  const supine_status status =
      supine_physics_equilibrium_solve(equilibrium, 1, force, 0.0, false, column, NULL, error);
  free(force);
  return status;
}
