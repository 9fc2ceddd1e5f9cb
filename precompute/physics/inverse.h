/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Invert the equilibrium ([Santhanam2008] IV-B.3): f = A t / load in the notation of
 * equilibrium.h, one pass over the links. */
#ifndef SUPINE_INVERSE_H
#define SUPINE_INVERSE_H

#include "precompute/physics/equilibrium.h"

/** Find the force f [N] whose equilibrium is the catch F [N].
 * @param stiffness  [N] E > 0, relative, or NULL: 1 everywhere
 * @param catch_     [N] F
 * @param force      [N] f; written
 * @retval SUPINE_ERROR_ARGUMENT  a stiffness that is not positive and finite (vertex named)
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_inverse_force(const supine_network *network, const double *stiffness,
                                           const double *catch_, double *force,
                                           supine_error *error);

#endif
