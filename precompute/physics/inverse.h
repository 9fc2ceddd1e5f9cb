/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The equilibrium backwards ([Santhanam2008] IV-B.3, VI): the force that a catch shows, and how a
 * function of the catch changes with the stiffness.
 *
 * In equilibrium.h's words, with t = F / S^2 and E = exp(theta), theta of mean 0:
 *
 *     A t = area f                               so that f = A t / area, one pass over the links
 *     dJ/dtheta_k = -2 F_k dJ/dF_k - lambda . (dA/dtheta_k) t,    A lambda = S^2 dJ/dF
 *
 * A is symmetric, so that the adjoint lambda is one more solve of the same equilibrium, whatever
 * the number of stiffnesses. */
#ifndef SUPINE_INVERSE_H
#define SUPINE_INVERSE_H

#include "precompute/physics/equilibrium.h"

/** The force f [N] under which a catch F [N] is the equilibrium.
 * @param stiffness  [N] E > 0, relative, or NULL: 1 everywhere
 * @param catch_     [N] F
 * @param force      [N] f; written
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness that is not positive and finite (vertex named)
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_inverse_force(const supine_network *network, const double *stiffness,
                                           const double *catch_, double *force,
                                           supine_error *error);

/** dJ/dlog E [N] of a function J of one catch. As only ratios of E count, it sums to 0.
 * @param equilibrium  of the network, with room for a right-hand side; its stiffness becomes the
 *                     one given
 * @param stiffness    [N] E > 0, relative, or NULL: 1 everywhere
 * @param catch_       [N] F at that stiffness
 * @param slope        [N] dJ/dF there
 * @param tolerance    relative residual of the solve; 0: SUPINE_SOLVE_TOLERANCE
 * @param gradient     [N] written
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness that is not positive and finite (vertex named)
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_physics_inverse_gradient(const supine_network *network,
                                              supine_equilibrium *equilibrium,
                                              const double *stiffness, const double *catch_,
                                              const double *slope, double tolerance,
                                              double *gradient, supine_error *error);

#endif
