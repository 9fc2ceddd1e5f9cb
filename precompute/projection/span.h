/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Express the force f_i on any vertex i for any direction of gravity g as a weighted sum of the
 * forces for R fixed directions g_r:
 *
 *     f_i(g) = sum over r of f_i(g_r) w_r(g)
 *
 * The weights w satisfy this equation exactly at R chosen vertices j (cross approximation:
 * Goreinov, Tyrtyshnikov and Zamarashkin 1997). Without softening (force.h), R is 4 or 5 and the
 * equation is exact for all vertices. With softening, R depends on the tolerance of span.c. */
#ifndef SUPINE_SPAN_H
#define SUPINE_SPAN_H

#include "precompute/physics/force.h"

/* Largest number R of directions; values of supine_force_law.soften up to about 12 need no more. */
enum { SUPINE_SPAN_MAX = 128 };

typedef struct supine_span {
  size_t rank;                            /* number R of directions */
  double directions[3 * SUPINE_SPAN_MAX]; /* [R, 3] directions g_r */
  size_t vertices[SUPINE_SPAN_MAX];       /* [R] chosen vertices j */
  /* [R, R] inverse of the matrix of the forces on these vertices for these directions */
  double inverse[SUPINE_SPAN_MAX * SUPINE_SPAN_MAX];
} supine_span;

/* Choose the R directions of gravity and the R vertices.
 * @retval SUPINE_ERROR_ARGUMENT   law->soften needs more than SUPINE_SPAN_MAX directions
 * @retval SUPINE_ERROR_NUMERICAL  the force is zero everywhere
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_span_create(const supine_lungs *lungs, const supine_force_law *law,
                                            supine_span *span, supine_error *error);

/* Compute the weights w for the given directions of gravity, into weights [gravities->count, R].
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_span_weights(const supine_lungs *lungs, const supine_force_law *law,
                                             const supine_span *span,
                                             const supine_gravities *gravities, double *weights);

#endif
