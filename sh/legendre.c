/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Legendre functions on the northern latitudes, as the matrix of the transform. */
#include <math.h>
#include <stdlib.h>

#include <gsl/gsl_sf_legendre.h>

#include <supine/sh.h>

#include "sh/internal.h"

/* Each (m, parity, cosine or sine, l) of a coefficient block, in order. */
static void fill_positions(supine_sh_transform *plan) {
  size_t row = 0;
  for (size_t m = 0; m <= plan->band; ++m) {
    for (size_t parity = 0; parity < 2; ++parity) {
      for (int sine = 0; sine < (m > 0 ? 2 : 1); ++sine) {
        for (size_t l = m + parity; l <= plan->band; l += 2) {
          plan->position[row++] = supine_sh_index(l, sine ? -(int)m : (int)m);
        }
      }
    }
  }
}

/* Latitude p's column of `analysis`. GSL's SPHARM functions are orthonormal
 * with exp(i m phi); a real harmonic of m > 0 is sqrt(2) times that. The FFT leaves twice each
 * cosine and sine of m > 0. */
static void fill_latitude(supine_sh_transform *plan, size_t p, double weight, const double *value) {
  double *analysis = plan->analysis;
  for (size_t m = 0; m <= plan->band; ++m) {
    const double scale = m == 0 ? 1 : M_SQRT1_2;
    for (size_t parity = 0; parity < 2; ++parity) {
      const size_t degrees = supine_sh_degrees(plan->band, m, parity);
      for (size_t d = 0; d < degrees; ++d) {
        const double y = scale * value[gsl_sf_legendre_array_index(m + parity + 2 * d, m)];
        analysis[d * plan->pairs + p] = weight * y;
      }
      analysis += degrees * plan->pairs;
    }
  }
}

supine_status supine_sh_legendre(supine_sh_transform *plan, const supine_sh_grid *grid) {
  const size_t degrees = (plan->band + 1) * (plan->band + 2) / 2;
  double *value = malloc(gsl_sf_legendre_array_n(plan->band) * sizeof *value);
  plan->analysis = malloc(degrees * plan->pairs * sizeof *plan->analysis);
  plan->position = malloc(plan->count * sizeof *plan->position);
  if (value == NULL || plan->analysis == NULL || plan->position == NULL) {
    free(value);
    return SUPINE_ERROR_MEMORY;
  }
  fill_positions(plan);
  for (size_t p = 0; p < plan->pairs; ++p) {
    const double weight = grid->weight[p] * 2 * M_PI / (double)grid->longitudes;
    (void)gsl_sf_legendre_array_e(GSL_SF_LEGENDRE_SPHARM, plan->band, grid->z[p], 1, value);
    fill_latitude(plan, p, weight, value);
  }
  free(value);
  return SUPINE_OK;
}
