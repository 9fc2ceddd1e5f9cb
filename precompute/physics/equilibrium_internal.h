/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The reduced matrix of an equilibrium and one solve with it, for its two iterations. */
#ifndef SUPINE_EQUILIBRIUM_INTERNAL_H
#define SUPINE_EQUILIBRIUM_INTERNAL_H

#include "sh/base/denormals.h"
#include "sh/base/parallel.h"

#include "precompute/physics/network.h"

enum { SUPINE_SOLVE_THREADS_MAX = 64 };

/* B v = b with B = I - weight: the reduced matrix scaled to a diagonal of 1. Rows are in the
 * network's internal order. */
struct supine_equilibrium {
  const supine_network *network;
  size_t rhs_max, threads;
  double *stiffness; /* [N] E, geometric mean 1, file's order */
  double *inner;     /* [N] E, internal order */
  double *weight;    /* [2 E] off-diagonal entries, negated */
  double *scale;     /* [N] 1 / sqrt(diagonal), internal order */
  double *right;     /* [N, count] b */
  double *solution;  /* [N + halo, count] v = y / scale */
  size_t count;      /* of the last solve; 0: none yet */

  /* Relaxation: threads work on blocks of rows; what a block needs of others stands in the halo
   * behind the solution, as it was when the sweep began. */
  size_t block_count;
  size_t block_begin[SUPINE_SOLVE_THREADS_MAX + 1];
  size_t halo_count;
  uint32_t *halo;   /* [halo_count] row that each place of the halo repeats */
  uint32_t *column; /* [2 E] neighbours, those of other blocks in the halo; the network's own where
                       there is one block */

  /* Conjugate gradients, allocated when first needed. [N, count] */
  double *residual, *direction, *product, *image;
};

/* One solve: numbers of each right-hand side, and each thread's sums. */
typedef struct supine_pass {
  supine_equilibrium *eq;
  const double *force;
  double *catch_;
  double wanted;               /* relative residual */
  double norm[SUPINE_RHS_MAX]; /* <b, b> */
  double omega;
  double alpha[SUPINE_RHS_MAX], beta[SUPINE_RHS_MAX];
  double rr[SUPINE_SOLVE_THREADS_MAX][SUPINE_RHS_MAX]; /* <r, r> */
  double rw[SUPINE_SOLVE_THREADS_MAX][SUPINE_RHS_MAX]; /* <r, B r> */
} supine_pass;

/* Calls `function` with `work` on all rows, in threads, denormals flushed, after zeroing the sums.
 */
void supine_physics_pass_run(supine_pass *work, supine_range_function *function);

/* The threads' sums of one right-hand side. */
double supine_physics_pass_total(double sums[SUPINE_SOLVE_THREADS_MAX][SUPINE_RHS_MAX], size_t r);

/* Blocks and halo of relaxation. */
supine_status supine_physics_relaxation_prepare(supine_equilibrium *eq);

/* Improves the solution by sweeps until the residual is as wanted, or until it is plain that
 * conjugate gradients will do better; the report's residual tells. */
void supine_physics_relaxation(supine_pass *work, supine_solve_report *report);

/* Improves the solution to the residual wanted, in at most `steps_max` steps.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_conjugate_gradients(supine_pass *work, size_t steps_max,
                                                 supine_solve_report *report);

#endif
