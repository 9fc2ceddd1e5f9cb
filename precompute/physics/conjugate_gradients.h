/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Conjugate gradients in single precision, which an outer loop in double corrects. */
#ifndef SUPINE_CONJUGATE_GRADIENTS_H
#define SUPINE_CONJUGATE_GRADIENTS_H

#include "precompute/physics/system.h"

/* What they work on, the caller's. The residual is the right side of the system's first stage. */
typedef struct supine_gradients {
  supine_system *system;
  double *solution;     /* [rows, lanes] improved by unit times what the residual asks for */
  float *direction;     /* [rows, lanes] */
  float *product;       /* [rows, lanes] */
  double *sums;         /* [rows / SUPINE_SUM_ROWS + 1, 2, lanes] */
  const double *unit;   /* [lanes] that the residual is in */
  const double *wanted; /* [lanes] <r, r / diagonal> to stop at */
} supine_gradients;

/* The `part`-th sums of all rows' blocks, 0 or 1, for one lane. */
double supine_physics_gradients_total(const double *sums, size_t rows, size_t lanes, size_t part,
                                      size_t lane);

/* Takes at most `steps_max` steps; returns their number. Lanes that are done stand still. */
size_t supine_physics_conjugate_gradients(const supine_gradients *work, size_t steps_max);

#endif
