/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Compute the spherical-harmonic transform of several real fields at once,
 *
 *     coefficient(l, m) = integral over all directions g of value(g) Y(l, m)(g)
 *
 * by the quadrature rule of a grid. Coefficients are computed up to a highest degree, the band.
 * They are exact to rounding if a field has no harmonics of higher degree, which cause aliasing. */
#ifndef SUPINE_TRANSFORM_H
#define SUPINE_TRANSFORM_H

#include <stddef.h>

#include "sh/grid.h"
#include <supine/status.h>

/** Plan for transforms of a fixed number of fields on one grid, up to one band (highest degree).
 * Only one thread at a time may use a plan. Only one thread of the process may create or destroy
 * plans, because FFTW's planner has global state. */
typedef struct supine_sh_transform supine_sh_transform;

/** Create a plan.
 * @param band    0 to SUPINE_SH_BAND_MAX; the grid needs latitudes > band, longitudes > 2 band
 * @param grid    must outlive the plan
 * @param fields  number of fields, at least 1
 * @param plan    written, NULL on failure */
supine_status supine_sh_transform_create(size_t band, const supine_sh_grid *grid, size_t fields,
                                         supine_sh_transform **plan, supine_error *error);

/** Free a plan. NULL is allowed. */
void supine_sh_transform_destroy(supine_sh_transform *plan);

/** Add the contribution of the values at latitude j of the grid to the coefficients. Zero the
 * coefficients first, then add each latitude once, in any order.
 * @param ring          [longitudes, fields] values at latitude j
 * @param coefficients  [fields, (band + 1)^2] input and output */
void supine_sh_transform_ring(supine_sh_transform *plan, size_t j, const double *ring,
                              double *coefficients);

#endif
