/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Invert a displacement field node by node, and measure the error of the inverse. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "base/vec3.h"

#include "precompute/warp/field.h"

static const double tolerance = 1e-5;   /* residual at which iteration stops, mm */
static const double lost_beyond = 0.01; /* residual above which a node has no inverse, mm */

/* Compute the residual x + u(x) - y, mm, and return its length. Unless `slope` is NULL, compute the
 * derivative of the residual with respect to x, counted in grid spacings along each axis. */
static double misfit(const supine_field *field, const double x[3], const double y[3],
                     double residual[3], double (*slope)[3]) {
  supine_warp_cell cell;
  double u[3];
  supine_warp_find_cell(&field->nodes, x, &cell);
  supine_warp_interpolate(&field->nodes, &cell, u, slope);
  for (int k = 0; k < 3; ++k) {
    residual[k] = x[k] + u[k] - y[k];
    if (slope != NULL) {
      for (int a = 0; a < 3; ++a) {
        slope[k][a] += field->nodes.step[a][k];
      }
    }
  }
  return supine_length(residual);
}

/* Compute the step of Newton's method along each axis of the grid, in grid spacings. Return false
 * if the derivative `slope` is singular. */
static bool newton(const double slope[3][3], const double residual[3], double step[3]) {
  supine_image equations = {.origin = {0.0}};
  for (size_t k = 0; k < 9; ++k) {
    equations.step[k % 3][k / 3] = -slope[k / 3][k % 3];
  }
  supine_image_locate(&equations, residual, step);
  return isfinite(step[0] + step[1] + step[2]);
}

/* Halve each step of Newton's method until the residual falls, as u has kinks. */
double supine_warp_solve(const supine_field *field, const double y[3], double x[3]) {
  enum { STEPS = 40, HALVINGS = 6 };
  double residual[3];
  double slope[3][3];
  double off = misfit(field, x, y, residual, slope);
  for (int i = 0; i < STEPS && off > tolerance; ++i) {
    double step[3];
    if (!newton((const double(*)[3])slope, residual, step)) {
      break;
    }
    double better = INFINITY;
    double next[3];
    for (int halving = 0; halving < HALVINGS && !(better < off); ++halving) {
      const double share = ldexp(1.0, -halving);
      for (int k = 0; k < 3; ++k) {
        next[k] = x[k];
        for (int a = 0; a < 3; ++a) {
          next[k] += share * step[a] * field->nodes.step[a][k];
        }
      }
      better = misfit(field, next, y, residual, slope);
    }
    if (!(better < off)) {
      break;
    }
    memcpy(x, next, sizeof next);
    off = better;
  }
  return off;
}

typedef struct inversion {
  const supine_field *field;
  supine_field *inverse;
  unsigned char *lost; /* [nodes] 1 if the residual at the node exceeds lost_beyond */
} inversion;

static void invert_rows(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const inversion *work = context;
  const supine_image *nodes = &work->field->nodes;
  const float *u = nodes->values;
  float *v = work->inverse->nodes.values;
  for (size_t row = begin; row < end; ++row) {
    for (size_t i = 0; i < nodes->size[0]; ++i) {
      const size_t node = row * nodes->size[0] + i;
      double y[3];
      double x[3];
      supine_image_place(nodes, node, y);
      for (size_t k = 0; k < 3; ++k) {
        x[k] = y[k] - (double)u[3 * node + k];
      }
      double off = supine_warp_solve(work->field, y, x);
      if (off > lost_beyond) { /* the iteration failed: restart it without the estimate -u(y) */
        double other[3];
        memcpy(other, y, sizeof other);
        const double again = supine_warp_solve(work->field, y, other);
        if (again < off) {
          off = again;
          memcpy(x, other, sizeof x);
        }
      }
      work->lost[node] = off > lost_beyond;
      for (size_t k = 0; k < 3; ++k) {
        v[3 * node + k] = (float)(x[k] - y[k]);
      }
    }
  }
}

/* Measure the residual of a field and its inverse at every node inside the lungs. */
static void measure(const supine_field *field, const supine_field *inverse,
                    supine_warp_residual *residual) {
  const supine_image *nodes = &field->nodes;
  const float *u = nodes->values;
  size_t count = 0;
  double sum = 0.0;
  for (size_t node = 0; node < supine_image_count(nodes); ++node) {
    if (!(((const float *)field->depth.values)[node] > 0.0F)) {
      continue;
    }
    double x[3];
    double back[3];
    supine_image_place(nodes, node, x);
    for (size_t k = 0; k < 3; ++k) {
      x[k] += (double)u[3 * node + k];
    }
    supine_warp_at(inverse, x, back);
    for (size_t k = 0; k < 3; ++k) {
      back[k] += (double)u[3 * node + k];
    }
    const double off = supine_length(back);
    residual->largest = fmax(residual->largest, off);
    sum += off * off;
    ++count;
  }
  residual->rms = count > 0 ? sqrt(sum / (double)count) : 0.0;
}

supine_status supine_warp_invert(const supine_field *field, supine_field *inverse,
                                 supine_warp_residual *residual, supine_error *error) {
  const supine_image *nodes = &field->nodes;
  const size_t count = supine_image_count(nodes);
  supine_field made = {.nodes = *nodes};
  SUPINE_ARENA arena = {0};
  unsigned char *lost = supine_arena_take(&arena, count, 1);
  made.nodes.values = malloc(3 * count * sizeof(float));
  *residual = (supine_warp_residual){0};
  if (arena.failed || made.nodes.values == NULL) {
    supine_warp_free(&made);
    return supine_error_memory(error, "a field of %zu nodes", count);
  }
  inversion work = {field, &made, lost};
  supine_parallel_for(nodes->size[1] * nodes->size[2], 1, 0, invert_rows, &work);
  for (size_t i = 0; i < count; ++i) {
    residual->lost += lost[i];
  }
  measure(field, &made, residual);
  *inverse = made;
  return SUPINE_OK;
}
