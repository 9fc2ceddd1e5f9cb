/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Conjugate gradients in the form of Chronopoulos and Gear (1989): two passes over the vectors a
 * step instead of three, for the same iterates. For matrices of larger condition number. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/physics/equilibrium_internal.h"

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
static inline void image_rows(supine_pass *work, size_t count, size_t begin, size_t end,
                              size_t thread) {
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
  supine_pass *work = context;
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
static inline void step_rows(supine_pass *work, size_t count, size_t begin, size_t end) {
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
  supine_pass *work = context;
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

/* r = b - B v, and p = q = 0. */
static void start_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const supine_pass *work = context;
  supine_equilibrium *eq = work->eq;
  for (size_t i = begin; i < end; ++i) {
    double out[SUPINE_RHS_MAX];
    row_product(eq, i, eq->count, eq->solution, out);
    for (size_t r = 0; r < eq->count; ++r) {
      const size_t at = i * eq->count + r;
      eq->residual[at] = eq->right[at] - out[r];
      eq->direction[at] = 0.0;
      eq->product[at] = 0.0;
    }
  }
}

static supine_status allocate(supine_equilibrium *eq) {
  const size_t values = eq->network->vertex_count * eq->rhs_max;
  if (eq->image != NULL) {
    return SUPINE_OK;
  }
  eq->residual = malloc(values * sizeof(double));
  eq->direction = malloc(values * sizeof(double));
  eq->product = malloc(values * sizeof(double));
  eq->image = malloc(values * sizeof(double));
  if (eq->residual != NULL && eq->direction != NULL && eq->product != NULL && eq->image != NULL) {
    return SUPINE_OK;
  }
  free(eq->image);
  eq->image = NULL; /* the others go with the equilibrium, or are replaced */
  return SUPINE_ERROR_MEMORY;
}

supine_status supine_physics_conjugate_gradients(supine_pass *work, size_t steps_max,
                                                 supine_solve_report *report) {
  supine_equilibrium *eq = work->eq;
  double last_rr[SUPINE_RHS_MAX] = {0.0};
  bool done[SUPINE_RHS_MAX] = {false};
  if (allocate(eq) != SUPINE_OK) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_physics_pass_run(work, start_range);
  for (size_t step = 0;; ++step) {
    supine_physics_pass_run(work, image_range);
    report->residual = 0.0;
    bool all = true;
    for (size_t r = 0; r < eq->count; ++r) {
      const double rr = supine_physics_pass_total(work->rr, r);
      const double rw = supine_physics_pass_total(work->rw, r);
      const double relative = work->norm[r] > 0.0 ? sqrt(rr / work->norm[r]) : sqrt(rr);
      report->residual = relative <= report->residual ? report->residual : relative; /* keeps NaN */
      done[r] = done[r] || relative <= work->wanted;
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
    if (all || step == steps_max || !isfinite(report->residual)) {
      return SUPINE_OK;
    }
    supine_physics_pass_run(work, step_range);
    ++report->iterations;
  }
}
