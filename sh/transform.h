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

/** Transform real fields on a grid. Only one thread of the process may call this at a time, because
 * FFTW's planner has global state.
 * @param band          0 to SUPINE_SH_BAND_MAX; the grid needs latitudes > band, longitudes > 2
 * band
 * @param values        [latitudes, longitudes, fields] value of each field at each direction
 * @param coefficients  [fields, (band + 1)^2] output */
supine_status supine_sh_transform(size_t band, const supine_sh_grid *grid, size_t fields,
                                  const double *values, double *coefficients, supine_error *error);

#endif
