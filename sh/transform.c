/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Transform fields on a grid to coefficients: FFTs in longitude, Legendre functions in latitude. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include <fftw3.h>
#include <gsl/gsl_sf_legendre.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "sh/transform.h"

struct supine_sh_transform {
  size_t band, fields;
  const supine_sh_grid *grid;
  double *legendre; /* Legendre functions at one latitude, indexed by gsl_sf_legendre_array_index */
  fftw_complex *spectrum; /* [longitudes / 2 + 1, fields] FFT of one latitude */
  fftw_plan fft;
};

/* Plan the FFT. FFTW_ESTIMATE makes the same plan every time, in microseconds. */
static fftw_plan plan_fft(supine_sh_transform *plan) {
  const int longitudes = (int)plan->grid->longitudes;
  const int fields = (int)plan->fields;
  SUPINE_ARENA arena = {0};
  double *ring = supine_arena_take(&arena, plan->grid->longitudes * plan->fields, sizeof *ring);
  return ring == NULL
             ? NULL
             : fftw_plan_many_dft_r2c(1, &longitudes, fields, ring, NULL, fields, 1, plan->spectrum,
                                      NULL, fields, 1,
                                      FFTW_ESTIMATE | FFTW_PRESERVE_INPUT | FFTW_UNALIGNED);
}

supine_status supine_sh_transform_create(size_t band, const supine_sh_grid *grid, size_t fields,
                                         supine_sh_transform **plan, supine_error *error) {
  *plan = NULL;
  if (band > SUPINE_SH_BAND_MAX || grid->latitudes <= band || grid->longitudes <= 2 * band) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a grid of %zu x %zu directions cannot represent band %zu: give more "
                            "than %zu latitudes and %zu longitudes, and a band of at most %d",
                            grid->latitudes, grid->longitudes, band, band, 2 * band,
                            SUPINE_SH_BAND_MAX);
  }
  supine_sh_transform *made = calloc(1, sizeof *made);
  if (made != NULL) {
    *made = (supine_sh_transform){.band = band, .fields = fields, .grid = grid};
    made->legendre = malloc(gsl_sf_legendre_array_n(band) * sizeof *made->legendre);
    made->spectrum = malloc((grid->longitudes / 2 + 1) * fields * sizeof *made->spectrum);
    made->fft = made->spectrum == NULL ? NULL : plan_fft(made);
  }
  if (made == NULL || made->legendre == NULL || made->fft == NULL) {
    supine_sh_transform_destroy(made);
    return supine_error_memory(error, "a transform of band %zu", band);
  }
  *plan = made;
  return SUPINE_OK;
}

void supine_sh_transform_destroy(supine_sh_transform *plan) {
  if (plan != NULL) {
    free(plan->legendre);
    free(plan->spectrum);
    if (plan->fft != NULL) {
      fftw_destroy_plan(plan->fft);
    }
    free(plan);
  }
}

/* GSL normalises its SPHARM functions for exp(i m phi). Real harmonics with m != 0 have cos(m phi)
 * or sin(m phi) instead, and therefore an additional factor sqrt(2). */
void supine_sh_transform_ring(supine_sh_transform *plan, size_t j, const double *ring,
                              double *coefficients) {
  const size_t count = supine_sh_count(plan->band);
  const double weight = plan->grid->weight[j] * 2 * M_PI / (double)plan->grid->longitudes;
  (void)gsl_sf_legendre_array_e(GSL_SF_LEGENDRE_SPHARM, plan->band, plan->grid->z[j], 1,
                                plan->legendre);
  fftw_execute_dft_r2c(plan->fft, (double *)(uintptr_t)ring, plan->spectrum);
  for (size_t m = 0; m <= plan->band; ++m) {
    for (size_t f = 0; f < plan->fields; ++f) {
      const double *s = plan->spectrum[m * plan->fields + f]; /* FFT of field f at order m */
      double *c = coefficients + f * count;
      for (size_t l = m; l <= plan->band; ++l) {
        const double y = weight * plan->legendre[gsl_sf_legendre_array_index(l, m)];
        if (m == 0) {
          c[supine_sh_index(l, 0)] += y * s[0];
        } else {
          c[supine_sh_index(l, (int)m)] += M_SQRT2 * y * s[0];
          c[supine_sh_index(l, -(int)m)] -= M_SQRT2 * y * s[1];
        }
      }
    }
  }
}
