/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Express the force f_i on any vertex i for any direction of gravity g by the forces for R
 * directions g_r:
 *
 *     f_i(g) = sum over r of f_i(g_r) w_r(g)
 *
 * The weights w satisfy this equation exactly at R chosen vertices j (cross approximation:
 * Goreinov, Tyrtyshnikov and Zamarashkin 1997). Without softening, R is 4 or 5 and the equation is
 * exact for all vertices. With softening, R depends on the tolerance. */
#ifndef SUPINE_SPAN_H
#define SUPINE_SPAN_H

#include "precompute/physics/force.h"

/* Largest number of directions: enough for a softening of about 12. */
enum { SUPINE_SPAN_MAX = 128 };

typedef struct supine_span {
  size_t rank;                                       /* R */
  double directions[3 * SUPINE_SPAN_MAX];            /* [R, 3] */
  size_t vertices[SUPINE_SPAN_MAX];                  /* [R] chosen vertices */
  double inverse[SUPINE_SPAN_MAX * SUPINE_SPAN_MAX]; /* [R, R] inverse of the forces f_j(g_r) */
} supine_span;

/* Choose the directions and vertices.
 * @retval SUPINE_ERROR_ARGUMENT   the softening needs more than SUPINE_SPAN_MAX directions
 * @retval SUPINE_ERROR_NUMERICAL  the force is zero everywhere
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_span_create(const supine_lungs *lungs, const supine_force_law *law,
                                            supine_span *span, supine_error *error);

/* Compute w for the given directions into weights [gravities->count, R].
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_span_weights(const supine_lungs *lungs, const supine_force_law *law,
                                             const supine_span *span,
                                             const supine_gravities *gravities, double *weights);

#endif
