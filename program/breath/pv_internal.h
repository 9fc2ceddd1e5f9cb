/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What the pressure-volume files share. */
#ifndef SUPINE_PV_INTERNAL_H
#define SUPINE_PV_INTERNAL_H

#include <stddef.h>
#include <stdio.h>

#include <gsl/gsl_matrix.h>
#include <gsl/gsl_vector.h>

#include "program/breath/pv.h"

#include "sh/base/csv.h"

/* State of the equation at one x, from y(-1) = 0, y'(-1) = 1, and of its responses to each control
 * parameter: y, y', then (dy/dc_i, dy'/dc_i) for i = 1 ... 5. */
enum { PV_STATE = 2, PV_STATE_WITH_RESPONSES = 2 + 2 * SUPINE_PV_CONTROLS };

/* The state at each of `count` ascending x in [-1, 1]: states [count, size], size one of the two
 * above. SUPINE_ERROR_NUMERICAL or SUPINE_ERROR_MEMORY. */
supine_status supine_breath_integrate(const double control[SUPINE_PV_CONTROLS], size_t count,
                                      const double *x, size_t size, double *states);

/* x of a pressure. */
double supine_breath_normalise(const supine_pv_curve *curve, double pressure);

/* Samples of one limb as the caller gave them; what messages need to name one. */
typedef struct pv_origin {
  const char *name;    /* NULL: none */
  const size_t *lines; /* [count]; NULL: samples count from 1 */
  size_t count;
  const double *pressures; /* [count] */
  const double *volumes;   /* [count] */
} pv_origin;

/* Check that there are enough samples, finite, with pressures strictly rising or falling and a
 * higher volume at the end. */
supine_status supine_breath_samples_check(const pv_origin *origin, supine_error *error);

/* Least and greatest pressure, volumes at these, and the span of the volumes, mL. */
void supine_breath_samples_range(const pv_origin *origin, supine_pv_curve *curve, double *span);

/* Whether some volume falls, while pressure rises, by more than `allowed` from the local trend or
 * from the greatest volume before it; `v` are the volumes by rising pressure, in the unit of
 * `allowed`. */
supine_status supine_breath_check_falls(const pv_origin *origin, const double *v, double allowed,
                                        supine_error *error);

/* Compute the statistics of a least-squares minimum and estimate its noise robustly, both in shares
 * of `span` mL. */
supine_status supine_breath_report_fill(const gsl_matrix *jacobian, const gsl_vector *residual,
                                        double span, double confidence, supine_pv_report *report,
                                        double *sigma);

#endif
