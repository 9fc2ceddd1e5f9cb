/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Chebyshev's iteration in single precision, for systems that their diagonal dominates. */
#ifndef SUPINE_CHEBYSHEV_H
#define SUPINE_CHEBYSHEV_H

#include "precompute/physics/system.h"

/* The largest share of a row's diagonal that its links make, 0 to 1: the eigenvalues of the system
 * over its diagonal lie so far from 1 at most (Gershgorin). `largest` [rows / SUPINE_SUM_ROWS + 1]
 * is space to work in. */
double supine_physics_chebyshev_radius(const supine_system *system, double *largest);

/* How many steps bring a residual to `gain` of what it was. */
size_t supine_physics_chebyshev_steps(double radius, double gain);

/* Takes them for the right side of the system's only stage, and adds unit [lanes] times what comes
 * of them to solution [rows, lanes]. One pass over few vectors a step and no sums: a third of the
 * traffic of conjugate gradients, for a third more steps. */
void supine_physics_chebyshev(supine_system *system, double radius, size_t steps,
                              const double *unit, double *solution);

#endif
