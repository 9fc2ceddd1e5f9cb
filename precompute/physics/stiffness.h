/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Scale the stiffness of tissue, of which only ratios count. */
#ifndef SUPINE_STIFFNESS_H
#define SUPINE_STIFFNESS_H

#include <supine/status.h>

#include <stddef.h>

/** Scale a stiffness [count] to a geometric mean of 1, into scaled [count]. If `stiffness` is NULL,
 * set all elements of `scaled` to 1. Return SUPINE_ERROR_ARGUMENT if a value is not above 0. */
supine_status supine_physics_stiffness_normalise(size_t count, const double *stiffness,
                                                 double *scaled, supine_error *error);

#endif
