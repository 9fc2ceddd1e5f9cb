/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The equilibrium of (5), (12)-(14): springs eliminated, symmetric, by conjugate gradients. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/parallel.h>

#include "internal.h"

/* Conjugate gradients in the form of Chronopoulos and Gear (1989): two passes over the vectors a
 * step instead of three, for the same iterates. */

enum { ROWS_GRAIN = 4096, THREADS_MAX = 64, STEPS_MAX = 200, STEPS_MAX_WITH_REACH = 20000 };

static const double default_tolerance = 1e-14;

struct supine_equilibrium {
  const supine_network *network;
  size_t rhs_max, threads;
  double *stiffness; /* [N] E, geometric mean 1, file's order */
  double *inner;     /* [N] E, internal order */
  double *weight;    /* [2 E] off-diagonal entries of the scaled matrix, negated */
  double *scale;     /* [N] 1 / sqrt(diagonal), internal order */
  double *solution;  /* [N, count] v = y / scale */
  double *residual, *direction, *product, *image; /* [N, count] r, p, q = B p, w = B r */
  size_t count;                                   /* of the last solve; 0: none yet */
};

supine_status supine_equilibrium_create(const supine_network *network, size_t rhs_max,
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
  made->threads = used > THREADS_MAX ? THREADS_MAX : used;
  made->stiffness = malloc(n * sizeof(double));
  made->inner = malloc(n * sizeof(double));
  made->weight = malloc((links + 1) * sizeof(double));
  made->scale = malloc(n * sizeof(double));
  made->solution = malloc(n * rhs_max * sizeof(double));
  made->residual = malloc(n * rhs_max * sizeof(double));
  made->direction = malloc(n * rhs_max * sizeof(double));
  made->product = malloc(n * rhs_max * sizeof(double));
  made->image = malloc(n * rhs_max * sizeof(double));
  if (made->stiffness == NULL || made->inner == NULL || made->weight == NULL ||
      made->scale == NULL || made->solution == NULL || made->residual == NULL ||
      made->direction == NULL || made->product == NULL || made->image == NULL) {
    supine_equilibrium_destroy(made);
    return SUPINE_ERROR_MEMORY;
  }
  *equilibrium = made;
  return SUPINE_OK;
}

void supine_equilibrium_destroy(supine_equilibrium *equilibrium) {
  if (equilibrium != NULL) {
    free(equilibrium->stiffness);
    free(equilibrium->inner);
    free(equilibrium->weight);
    free(equilibrium->scale);
    free(equilibrium->solution);
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

supine_status supine_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                               const double *stiffness, supine_error *error) {
  const supine_network *net = equilibrium->network;
  const supine_status status =
      supine_stiffness_normalise(net->vertex_count, stiffness, equilibrium->stiffness, error);
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

/* One pass of the iteration: its numbers for each right-hand side, and each thread's sums. */
typedef struct pass {
  supine_equilibrium *eq;
  const double *force;
  double *catch_;
  double alpha[SUPINE_RHS_MAX], beta[SUPINE_RHS_MAX];
  double rr[THREADS_MAX][SUPINE_RHS_MAX]; /* <r, r> */
  double rw[THREADS_MAX][SUPINE_RHS_MAX]; /* <r, B r> */
} pass;

/* out = B in for one row, B = I - weight. */
static inline void row_product(const supine_equilibrium *eq, size_t i, size_t count,
                               const double *in, double *out) {
  const supine_network *net = eq->network;
  const double *own = in + i * count;
  for (size_t r = 0; r < count; ++r) {
    out[r] = own[r];
  }
  for (size_t s = net->row_begin[i]; s < net->row_begin[i + 1]; ++s) {
    const double weight = eq->weight[s];
    const double *other = in + (size_t)net->neighbour[s] * count;
    for (size_t r = 0; r < count; ++r) {
      out[r] -= weight * other[r];
    }
  }
}

/* w = B r, with <r, r> and <r, w>. Inlined for each common count, so that the compiler keeps the
 * sums in registers. */
static inline void image_rows(pass *work, size_t count, size_t begin, size_t end, size_t thread) {
  supine_equilibrium *eq = work->eq;
  double rr[SUPINE_RHS_MAX] = {0.0};
  double rw[SUPINE_RHS_MAX] = {0.0};
  for (size_t i = begin; i < end; ++i) {
    double out[SUPINE_RHS_MAX];
    const double *own = eq->residual + i * count;
    row_product(eq, i, count, eq->residual, out);
    for (size_t r = 0; r < count; ++r) {
      eq->image[i * count + r] = out[r];
      rr[r] += own[r] * own[r];
      rw[r] += own[r] * out[r];
    }
  }
  memcpy(work->rr[thread], rr, sizeof rr);
  memcpy(work->rw[thread], rw, sizeof rw);
}

SUPINE_CLONES static void image_range(void *context, size_t begin, size_t end, size_t thread) {
  pass *work = context;
  switch (work->eq->count) {
  case 1:
    image_rows(work, 1, begin, end, thread);
    break;
  case 4:
    image_rows(work, 4, begin, end, thread);
    break;
  case 5:
    image_rows(work, 5, begin, end, thread);
    break;
  case 16:
    image_rows(work, 16, begin, end, thread);
    break;
  default:
    image_rows(work, work->eq->count, begin, end, thread);
  }
}

/* p = r + beta p, q = w + beta q, v += alpha p, r -= alpha q. */
static inline void step_rows(pass *work, size_t count, size_t begin, size_t end) {
  supine_equilibrium *eq = work->eq;
  double *restrict v = eq->solution;
  double *restrict residual = eq->residual;
  double *restrict p = eq->direction;
  double *restrict q = eq->product;
  const double *restrict w = eq->image;
  for (size_t i = begin; i < end; ++i) {
    for (size_t r = 0; r < count; ++r) {
      const size_t at = i * count + r;
      p[at] = residual[at] + work->beta[r] * p[at];
      q[at] = w[at] + work->beta[r] * q[at];
      v[at] += work->alpha[r] * p[at];
      residual[at] -= work->alpha[r] * q[at];
    }
  }
}

SUPINE_CLONES static void step_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  pass *work = context;
  switch (work->eq->count) {
  case 1:
    step_rows(work, 1, begin, end);
    break;
  case 4:
    step_rows(work, 4, begin, end);
    break;
  case 5:
    step_rows(work, 5, begin, end);
    break;
  case 16:
    step_rows(work, 16, begin, end);
    break;
  default:
    step_rows(work, work->eq->count, begin, end);
  }
}

/* Right-hand side b = scale own f / S in internal order, and a clean start. */
static void load_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const pass *work = context;
  supine_equilibrium *eq = work->eq;
  const size_t count = eq->count;
  for (size_t i = begin; i < end; ++i) {
    const double own = eq->network->own == NULL ? 1.0 : eq->network->own[i];
    const double factor = eq->scale[i] * eq->inner[i] * own;
    const double *force = work->force + (size_t)eq->network->order[i] * count;
    for (size_t r = 0; r < count; ++r) {
      const size_t at = i * count + r;
      eq->residual[at] = factor * force[r];
      eq->direction[at] = 0.0;
      eq->product[at] = 0.0;
    }
  }
}

/* r = b - B v for a warm start. */
static void residual_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const pass *work = context;
  supine_equilibrium *eq = work->eq;
  for (size_t i = begin; i < end; ++i) {
    double out[SUPINE_RHS_MAX];
    row_product(eq, i, eq->count, eq->solution, out);
    for (size_t r = 0; r < eq->count; ++r) {
      eq->residual[i * eq->count + r] -= out[r];
    }
  }
}

/* F = S y = S scale v, (4), back in the file's order. */
static void store_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const pass *work = context;
  const supine_equilibrium *eq = work->eq;
  for (size_t i = begin; i < end; ++i) {
    const double factor = eq->scale[i] / eq->inner[i];
    double *out = work->catch_ + (size_t)eq->network->order[i] * eq->count;
    for (size_t r = 0; r < eq->count; ++r) {
      out[r] = factor * eq->solution[i * eq->count + r];
    }
  }
}

/* Norms of the right-hand sides: <b, b> as they stand in the residual before a warm start. */
static void norm_range(void *context, size_t begin, size_t end, size_t thread) {
  pass *work = context;
  const size_t count = work->eq->count;
  double sums[SUPINE_RHS_MAX] = {0.0};
  for (size_t at = begin * count; at < end * count; at += count) {
    for (size_t r = 0; r < count; ++r) {
      sums[r] += work->eq->residual[at + r] * work->eq->residual[at + r];
    }
  }
  memcpy(work->rr[thread], sums, sizeof sums);
}

static void run(pass *work, supine_range_function *function) {
  memset(work->rr, 0, sizeof work->rr);
  memset(work->rw, 0, sizeof work->rw);
  supine_parallel_for(work->eq->network->vertex_count, ROWS_GRAIN, work->eq->threads, function,
                      work);
}

static double total(double sums[THREADS_MAX][SUPINE_RHS_MAX], size_t r) {
  double sum = 0.0;
  for (size_t t = 0; t < THREADS_MAX; ++t) {
    sum += sums[t][r];
  }
  return sum;
}

supine_status supine_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                       const double *force, double tolerance, bool warm,
                                       double *catch_, supine_solve_report *report,
                                       supine_error *error) {
  supine_equilibrium *eq = equilibrium;
  if (count < 1 || count > eq->rhs_max) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%zu right-hand sides asked, 1 to %zu set up", count, eq->rhs_max);
  }
  pass *work = malloc(sizeof *work);
  if (work == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for a solve");
  }
  const double wanted = tolerance > 0.0 ? tolerance : default_tolerance;
  const bool start = warm && eq->count == count;
  const size_t steps_max = eq->network->reach > 0.0 ? STEPS_MAX_WITH_REACH : STEPS_MAX;
  double norm[SUPINE_RHS_MAX];
  double last_rr[SUPINE_RHS_MAX] = {0.0};
  bool done[SUPINE_RHS_MAX] = {false};
  supine_solve_report made = {0, INFINITY};
  eq->count = count;
  work->eq = eq;
  work->force = force;
  work->catch_ = catch_;
  run(work, load_range);
  run(work, norm_range);
  for (size_t r = 0; r < count; ++r) {
    norm[r] = total(work->rr, r);
  }
  if (start) {
    run(work, residual_range);
  } else {
    memset(eq->solution, 0, eq->network->vertex_count * count * sizeof(double));
  }
  for (made.iterations = 0; made.iterations <= steps_max; ++made.iterations) {
    run(work, image_range);
    made.residual = 0.0;
    bool all = true;
    for (size_t r = 0; r < count; ++r) {
      const double rr = total(work->rr, r);
      const double rw = total(work->rw, r);
      const double relative = norm[r] > 0.0 ? sqrt(rr / norm[r]) : sqrt(rr);
      made.residual = relative <= made.residual ? made.residual : relative; /* keeps NaN */
      done[r] = done[r] || rr <= wanted * wanted * norm[r];
      all = all && done[r];
      if (done[r]) {
        work->alpha[r] = work->beta[r] = 0.0;
        continue;
      }
      const bool first = last_rr[r] == 0.0;
      work->beta[r] = first ? 0.0 : rr / last_rr[r];
      work->alpha[r] = rr / (first ? rw : rw - work->beta[r] * rr / work->alpha[r]);
      last_rr[r] = rr;
    }
    if (all || made.iterations == steps_max || !isfinite(made.residual)) {
      break;
    }
    run(work, step_range);
  }
  run(work, store_range);
  free(work);
  if (report != NULL) {
    *report = made;
  }
  if (!(made.residual <= wanted)) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "equilibrium: relative residual %.3g after %zu steps, %.3g wanted",
                            made.residual, made.iterations, wanted);
  }
  return SUPINE_OK;
}

void supine_equilibrium_spring_catch(const supine_equilibrium *equilibrium,
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

supine_status supine_transfer_column(supine_equilibrium *equilibrium, size_t vertex, double *column,
                                     supine_error *error) {
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
      supine_equilibrium_solve(equilibrium, 1, force, 0.0, false, column, NULL, error);
  free(force);
  return status;
}
