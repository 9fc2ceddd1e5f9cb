/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the displacement of the hilum, and expected errors relative to it. */
#ifndef SUPINE_OPTIONS_HILUM_H
#define SUPINE_OPTIONS_HILUM_H

#include "precompute/posed/posed.h"

/* Displacement of the hilum between two states. */
typedef struct supine_hilum {
  double move[3];  /* LPS, mm; 0 if the file does not say how the hilum moves */
  double expected; /* its expected error in the body, mm; NAN if unknown */
} supine_hilum;

/* Find the displacement of the hilum. If the file does not say how the hilum moves, fail only if it
 * is needed. Other statuses: as supine_basis_pose. */
supine_status supine_options_hilum(const supine_basis *basis, const supine_state *state,
                                   const supine_state *from, bool needed, supine_hilum *hilum,
                                   supine_error *error);

/* Replace expected errors in the body, of positions and of displacements from a state, by those
 * relative to the hilum: of the difference between the displacement of each vertex and that of the
 * hilum. Do nothing if the errors are unknown. Statuses: as supine_options_hilum if the hilum is
 * needed. */
supine_status supine_options_hilum_errors(const supine_basis *basis, const supine_state *state,
                                          const supine_state *from, supine_errors *errors,
                                          supine_error *error);

#endif
