/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Express the force f_i on any vertex i for any direction of gravity g as a weighted sum of the
 * forces for R fixed directions g_r:
 *
 *     f_i(g) = sum over r of f_i(g_r) w_r(g)
 *
 * The weights w satisfy this equation exactly at R chosen vertices (cross approximation: Goreinov,
 * Tyrtyshnikov and Zamarashkin 1997). If supine_force_law.soften is 0, R is 4 or 5 and the equation
 * is exact for all vertices. Otherwise, R depends on the tolerance of span.c. */
#ifndef SUPINE_SPAN_H
#define SUPINE_SPAN_H

#include "precompute/physics/force.h"

/* Largest number of directions of gravity in a span. Softening of the tissue
 * (supine_force_law.soften) up to about 12 needs no more. */
enum { SUPINE_SPAN_MAX = 128 };

typedef struct supine_span {
  size_t rank;                            /* number of directions of gravity in `directions` */
  double directions[3 * SUPINE_SPAN_MAX]; /* [rank, 3] directions whose forces are summed */
  size_t vertices[SUPINE_SPAN_MAX];       /* [rank] vertices on which the summed force is exact */
  /* [rank, rank] inverse of A, where A[i, j] is the force on vertices[i] for directions[j] */
  double inverse[SUPINE_SPAN_MAX * SUPINE_SPAN_MAX];
} supine_span;

/* Choose the R directions g_r of gravity whose forces are summed, and the R vertices (see above).
 */
supine_status supine_projection_span_create(const supine_lungs *lungs, const supine_force_law *law,
                                            supine_span *span, supine_error *error);

/* Express the force for each direction of `gravities` as a weighted sum of the forces for
 * span->directions. Write the weights to weights [gravities->count, rank]. */
supine_status supine_projection_span_weights(const supine_lungs *lungs, const supine_force_law *law,
                                             const supine_span *span,
                                             const supine_gravities *gravities, double *weights);

#endif
