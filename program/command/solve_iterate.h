/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Solve by the Pitcher/Catcher iteration of Santhanam 2008. */
#ifndef SUPINE_SOLVE_ITERATE_H
#define SUPINE_SOLVE_ITERATE_H

#include "precompute/physics/solve.h"

/* Replace the solved forces by those of Santhanam's iteration, and print the largest difference. */
supine_status supine_command_iterate(const supine_lungs *lungs, const supine_model *model,
                                     const double g[3], supine_solution *solution,
                                     supine_error *error);

#endif
