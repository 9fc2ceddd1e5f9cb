/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare the axes of gravity with those of the displacements.
 *
 * Let A [3,3] be the mean over vertices of the linear part of the displacement, u = A g, and P a
 * signed permutation of the axes. Lungs sag: tr A, the sum of the motions along gravity of three
 * orthogonal directions, is large. If the axes of gravity are those of another frame, tr A P^T is
 * larger for the P that leads to the right ones. A law whose mean displacement hardly turns with
 * gravity gains little. */
#include <cblas.h>
#include <math.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "precompute/fields/frame.h"
#include "sh/expansion.h"

/* Compute what the fit makes of the runs of a lung when a vector with these values of the terms is
 * asked: a weight of each run. */
static void weigh_runs(const supine_regression *r, size_t lung, const double *terms,
                       double *weights) {
  cblas_dgemv(CblasRowMajor, CblasTrans, (int)r->terms, (int)r->run_count, 1.0,
              r->pinv + lung * r->terms * r->run_count, (int)r->run_count, terms, 1, 0.0, weights,
              1);
}

/* Sum the squares of what gravity changes in a lung, over vertices and runs: each run minus the
 * terms of the fit that do not depend on gravity. */
static supine_status sum_moved(const supine_fit *fit, size_t lung, double *sum) {
  const supine_regression *r = &fit->chosen;
  const size_t m = r->run_count;
  SUPINE_ARENA arena = {0};
  double *terms = supine_arena_zeros(&arena, r->terms, sizeof *terms);
  double *rest = supine_arena_take(&arena, m, sizeof *rest);
  double *product = supine_arena_take(&arena, m, sizeof *product);
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t run = 0; run < m; ++run) {
    memcpy(terms, r->values + (lung * m + run) * r->terms, (r->order + 1) * sizeof *terms);
    weigh_runs(r, lung, terms, rest);
    cblas_dscal((int)m, -1.0, rest, 1);
    rest[run] += 1.0;
    cblas_dsymv(CblasRowMajor, CblasUpper, (int)m, 1.0, fit->gram + lung * m * m, (int)m, rest, 1,
                0.0, product, 1);
    *sum += cblas_ddot((int)m, product, 1, rest, 1);
  }
  return SUPINE_OK;
}

/* Sum the displacements of the vertices of a lung in a run. */
static void sum_vertices(const supine_fit *fit, size_t lung, size_t run, double sum[3]) {
  const double *u = fit->fields->displacement + 3 * fit->fields->vertex_count * run;
  memset(sum, 0, 3 * sizeof *sum);
  for (size_t i = 3 * fit->lungs->lung_begin[lung]; i < 3 * fit->lungs->lung_begin[lung + 1]; ++i) {
    sum[i % 3] += u[i];
  }
}

/* Add the linear part of a lung's displacement, summed over its vertices, and averaged over the
 * volumes of the runs. */
static supine_status add_linear(const supine_fit *fit, size_t lung, double linear[3][3]) {
  const supine_regression *r = &fit->chosen;
  const size_t m = r->run_count;
  const size_t orders = r->order + 1;
  static const double constant = 0.28209479177387814; /* Y(0, 0) */
  SUPINE_ARENA arena = {0};
  double *terms = supine_arena_zeros(&arena, r->terms, sizeof *terms);
  double *weights = supine_arena_take(&arena, m, sizeof *weights);
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t axis = 0; axis < 3; ++axis) {
    const double direction[3] = {axis == 0, axis == 1, axis == 2};
    double y[4]; /* harmonics to degree 1 */
    SUPINE_TRY(supine_sh_evaluate(1, direction, y));
    for (size_t i = orders; i < 4 * orders; ++i) {
      double polynomial = 0.0; /* mean over the runs */
      for (size_t run = 0; run < m; ++run) {
        polynomial += r->values[(lung * m + run) * r->terms + i % orders] / constant / (double)m;
      }
      terms[i] = y[i / orders] * polynomial;
    }
    weigh_runs(r, lung, terms, weights);
    for (size_t run = 0; run < m; ++run) {
      double sum[3];
      sum_vertices(fit, lung, run, sum);
      for (size_t k = 0; k < 3; ++k) {
        linear[k][axis] += weights[run] * sum[k];
      }
    }
  }
  return SUPINE_OK;
}

/* Return what the motions along three axes of gravity add up to: those that `axis` names. */
static double motion_along(double linear[3][3], const int axis[3]) {
  double sum = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    const size_t column = (size_t)(axis[k] < 0 ? -axis[k] : axis[k]) - 1;
    sum += axis[k] < 0 ? -linear[k][column] : linear[k][column];
  }
  return sum;
}

/* Find the axes of gravity along which the motion is largest. */
static void find_axes(double linear[3][3], int axis[3]) {
  static const int orders[6][3] = {{1, 2, 3}, {1, 3, 2}, {2, 1, 3},
                                   {2, 3, 1}, {3, 1, 2}, {3, 2, 1}};
  double most = -INFINITY;
  for (size_t i = 0; i < 6 * 8; ++i) {
    int trial[3];
    for (size_t k = 0; k < 3; ++k) {
      trial[k] = (i % 8 >> k & 1) != 0 ? -orders[i / 8][k] : orders[i / 8][k];
    }
    const double along = motion_along(linear, trial);
    if (along > most) {
      most = along;
      memcpy(axis, trial, sizeof trial);
    }
  }
}

supine_status supine_fields_find_frame(supine_fit *fit) {
  static const int own[3] = {1, 2, 3};
  const double vertices = (double)fit->fields->vertex_count;
  supine_fit_frame *frame = &fit->report.frame;
  double linear[3][3] = {{0.0}};
  double moved = 0.0;
  for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
    SUPINE_TRY(sum_moved(fit, lung, &moved));
    if (fit->chosen.band > 0) {
      SUPINE_TRY(add_linear(fit, lung, linear));
    }
  }
  *frame = (supine_fit_frame){.axis = {1, 2, 3}};
  frame->moved_mm = sqrt(fmax(moved, 0.0) / (vertices * (double)fit->chosen.run_count));
  if (frame->moved_mm > 0.0 && fit->chosen.band > 0) {
    find_axes(linear, frame->axis);
    frame->gain = (motion_along(linear, frame->axis) - motion_along(linear, own)) /
                  (vertices * frame->moved_mm);
  }
  return SUPINE_OK;
}
