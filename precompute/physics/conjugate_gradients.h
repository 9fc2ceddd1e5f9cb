/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Conjugate gradients in single precision, which an outer loop in double corrects. */
#ifndef SUPINE_CONJUGATE_GRADIENTS_H
#define SUPINE_CONJUGATE_GRADIENTS_H

#include "precompute/physics/system.h"

/* Arrays of the solve, owned by the caller. The system's first stage holds the residual. */
typedef struct supine_gradients {
  supine_system *system;
  double *solution;     /* [rows, lanes]; the update, times unit, is added */
  float *direction;     /* [rows, lanes] */
  float *product;       /* [rows, lanes] */
  double *sums;         /* [rows / SUPINE_SUM_ROWS + 1, 2, lanes] */
  const double *unit;   /* [lanes] unit of the residual */
  const double *wanted; /* [lanes] <r, r / diagonal> to stop at */
} supine_gradients;

/* Sum the `part`-th partial sums, 0 or 1, of all row blocks for one lane. */
double supine_physics_gradients_total(const double *sums, size_t rows, size_t lanes, size_t part,
                                      size_t lane);

/* Take at most `steps_max` steps; return their number. Converged lanes are left unchanged. */
size_t supine_physics_conjugate_gradients(const supine_gradients *work, size_t steps_max);

#endif
