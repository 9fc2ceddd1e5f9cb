/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Successive over-relaxation: one pass over the vectors a sweep, where conjugate gradients take two
 * longer ones a step. On these matrices, whose condition number is below 2, it needs as many sweeps
 * as the other needs steps: 0.6 of the time for four right-hand sides, but 1.15 for a single one,
 * where each row waits for the last (tests/bench/bench_solve.c). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/physics/equilibrium_internal.h"

enum { SWEEPS_MAX = 60, ROWS_MIN = 4096 };

/* The best factor for meshes of nearly equal links is 1.08 to 1.10, and the sweeps hardly depend on
 * it there. */
static const double over_relaxation = 1.09;

/* Sweeps measure each row as it stands when met, which lags behind the residual after the sweep by
 * about this factor: then it is time to look. */
static const double lag = 3.0;

static size_t block_of(const supine_equilibrium *eq, size_t row) {
  size_t block = 0;
  while (row >= eq->block_begin[block + 1]) {
    ++block;
  }
  return block;
}

/* Numbers the halo: each row that some other block links to has one place. */
static supine_status number_halo(supine_equilibrium *eq) {
  const supine_network *net = eq->network;
  const size_t links = net->row_begin[net->vertex_count];
  uint32_t *place = calloc(net->vertex_count, sizeof *place); /* 1 more than the place; 0: none */
  eq->column = malloc((links + 1) * sizeof *eq->column);
  eq->halo = malloc((links + 1) * sizeof *eq->halo);
  if (place == NULL || eq->column == NULL || eq->halo == NULL) {
    free(place);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t i = 0, block = 0; i < net->vertex_count; ++i) {
    while (i >= eq->block_begin[block + 1]) {
      ++block;
    }
    for (size_t s = net->row_begin[i]; s < net->row_begin[i + 1]; ++s) {
      const uint32_t other = net->neighbour[s];
      eq->column[s] = other;
      if (block_of(eq, other) != block) {
        if (place[other] == 0) {
          eq->halo[eq->halo_count] = other;
          place[other] = (uint32_t)++eq->halo_count;
        }
        eq->column[s] = (uint32_t)(net->vertex_count + place[other] - 1);
      }
    }
  }
  free(place);
  return SUPINE_OK;
}

supine_status supine_physics_relaxation_prepare(supine_equilibrium *eq) {
  const size_t n = eq->network->vertex_count;
  size_t blocks = n / ROWS_MIN;
  blocks = blocks > eq->threads ? eq->threads : blocks;
  eq->block_count = blocks < 1 ? 1 : blocks;
  for (size_t b = 0; b <= eq->block_count; ++b) {
    eq->block_begin[b] = n * b / eq->block_count;
  }
  return eq->block_count == 1 ? SUPINE_OK : number_halo(eq);
}

/* One sweep over a block of rows: v_i += omega (b_i - (B v)_i), and the squares of those residuals.
 * Inlined for each common count, so that the compiler keeps the sums in registers. */
static inline void sweep_rows(supine_pass *work, size_t count, size_t block) {
  supine_equilibrium *eq = work->eq;
  const size_t *row_begin = eq->network->row_begin;
  const uint32_t *column = eq->column != NULL ? eq->column : eq->network->neighbour;
  double rr[SUPINE_RHS_MAX] = {0.0};
  for (size_t i = eq->block_begin[block]; i < eq->block_begin[block + 1]; ++i) {
    double row[SUPINE_RHS_MAX];
    double *own = eq->solution + i * count;
    for (size_t r = 0; r < count; ++r) {
      row[r] = eq->right[i * count + r] - own[r];
    }
    for (size_t s = row_begin[i]; s < row_begin[i + 1]; ++s) {
      const double weight = eq->weight[s];
      const double *other = eq->solution + (size_t)column[s] * count;
      for (size_t r = 0; r < count; ++r) {
        row[r] += weight * other[r];
      }
    }
    for (size_t r = 0; r < count; ++r) {
      rr[r] += row[r] * row[r];
      own[r] += work->omega * row[r];
    }
  }
  memcpy(work->rr[block], rr, sizeof rr);
}

SUPINE_CLONES static void sweep_blocks(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  supine_pass *work = context;
  const unsigned saved = supine_denormals_flush();
  for (size_t block = begin; block < end; ++block) {
    switch (work->eq->count) {
    case 1:
      sweep_rows(work, 1, block);
      break;
    case 4:
      sweep_rows(work, 4, block);
      break;
    case 5:
      sweep_rows(work, 5, block);
      break;
    case 16:
      sweep_rows(work, 16, block);
      break;
    default:
      sweep_rows(work, work->eq->count, block);
    }
  }
  supine_denormals_restore(saved);
}

/* A sweep of all blocks; the largest relative residual. omega = 0 looks and changes nothing. */
static double sweep(supine_pass *work, double omega) {
  supine_equilibrium *eq = work->eq;
  const size_t count = eq->count;
  work->omega = omega;
  for (size_t h = 0; h < eq->halo_count; ++h) {
    memcpy(eq->solution + (eq->network->vertex_count + h) * count,
           eq->solution + (size_t)eq->halo[h] * count, count * sizeof(double));
  }
  memset(work->rr, 0, sizeof work->rr);
  supine_parallel_for(eq->block_count, 1, eq->block_count, sweep_blocks, work);
  double largest = 0.0;
  for (size_t r = 0; r < count; ++r) {
    const double rr = supine_physics_pass_total(work->rr, r);
    const double relative = work->norm[r] > 0.0 ? sqrt(rr / work->norm[r]) : sqrt(rr);
    largest = relative <= largest ? largest : relative; /* keeps NaN */
  }
  return largest;
}

void supine_physics_relaxation(supine_pass *work, supine_solve_report *report) {
  while (report->iterations < SWEEPS_MAX) {
    report->residual = sweep(work, over_relaxation);
    ++report->iterations;
    if (!isfinite(report->residual)) {
      return;
    }
    if (report->residual <= lag * work->wanted) {
      report->residual = sweep(work, 0.0);
      if (report->residual <= work->wanted) {
        return;
      }
    }
  }
}
