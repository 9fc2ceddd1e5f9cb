/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The equilibrium solved in the plainest way: one direction at a time, in double, by conjugate
 * gradients scaled by the diagonal. What solves side by side over coarser graphs are compared with.
 */
#ifndef SUPINE_PLAIN_SOLVE_H
#define SUPINE_PLAIN_SOLVE_H

#include <stdbool.h>

#include "precompute/physics/model.h"

typedef struct plain_solve plain_solve;

/* NULL where that fails. The lungs and the model must outlive it. */
plain_solve *plain_solve_create(const supine_lungs *lungs, const supine_model *model);
void plain_solve_destroy(plain_solve *solve);

/* F [N] for gravity along the unit vector g, to a relative residual as supine_solve_report has it;
 * `warm` starts from what is there. Returns the number of steps. */
size_t plain_solve_run(plain_solve *solve, const double g[3], double tolerance, bool warm,
                       double *catch_);

#endif
