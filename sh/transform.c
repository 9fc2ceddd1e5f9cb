/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Transform fields on a grid to coefficients: FFTs in longitude, Legendre functions in latitude. */
#include <math.h>
#include <pthread.h>
#include <string.h>

#include <fftw3.h>
#include <gsl/gsl_sf_legendre.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "sh/expansion.h"

/* FFTW's planner keeps plans for the whole process: one thread at a time may use it. */
static pthread_mutex_t planner = PTHREAD_MUTEX_INITIALIZER;

/* Plan the FFT of one latitude. FFTW_ESTIMATE makes the same plan every time, in microseconds. */
static fftw_plan plan_fft(int longitudes, int fields, double *ring, fftw_complex *spectrum) {
  (void)pthread_mutex_lock(&planner);
  fftw_plan made =
      fftw_plan_many_dft_r2c(1, &longitudes, fields, ring, NULL, fields, 1, spectrum, NULL, fields,
                             1, FFTW_ESTIMATE | FFTW_PRESERVE_INPUT | FFTW_UNALIGNED);
  (void)pthread_mutex_unlock(&planner);
  return made;
}

/* Add one latitude to the coefficients [fields, (band + 1)^2]. GSL normalises its SPHARM functions
 * for exp(i m phi). Real harmonics with m != 0 have cos(m phi) or sin(m phi) instead, and therefore
 * an additional factor sqrt(2).
 * @param legendre  functions at this latitude, times the weight; see gsl_sf_legendre_array_index
 * @param spectrum  [longitudes / 2 + 1, fields] FFT of the values at this latitude */
static void add_ring(size_t band, size_t fields, const double *legendre, fftw_complex *spectrum,
                     double *coefficients) {
  for (size_t m = 0; m <= band; ++m) {
    for (size_t f = 0; f < fields; ++f) {
      const double *s = spectrum[m * fields + f]; /* FFT of field f at order m */
      double *c = coefficients + f * supine_sh_count(band);
      for (size_t l = m; l <= band; ++l) {
        const double y = legendre[gsl_sf_legendre_array_index(l, m)];
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

supine_status supine_sh_transform(size_t band, const supine_sh_grid *grid, size_t fields,
                                  const double *values, double *coefficients, supine_error *error) {
  const size_t width = grid->longitudes;
  const size_t functions = gsl_sf_legendre_array_n(band);
  SUPINE_REFUSE_IF(band > SUPINE_SH_BAND_MAX || grid->latitudes <= band || width <= 2 * band, error,
                   SUPINE_ERROR_ARGUMENT,
                   "a grid of %zu x %zu directions cannot represent band %zu: give more than %zu "
                   "latitudes and %zu longitudes, and a band of at most %d",
                   grid->latitudes, width, band, band, 2 * band, SUPINE_SH_BAND_MAX);
  SUPINE_ARENA arena = {0};
  double *legendre = supine_arena_take(&arena, functions, sizeof *legendre);
  double *ring = supine_arena_take(&arena, width * fields, sizeof *ring);
  fftw_complex *spectrum = supine_arena_take(&arena, (width / 2 + 1) * fields, sizeof *spectrum);
  const fftw_plan fft = arena.failed ? NULL : plan_fft((int)width, (int)fields, ring, spectrum);
  if (fft == NULL) {
    return supine_error_memory(error, "a transform of band %zu", band);
  }
  memset(coefficients, 0, fields * supine_sh_count(band) * sizeof *coefficients);
  for (size_t j = 0; j < grid->latitudes; ++j) {
    (void)gsl_sf_legendre_array_e(GSL_SF_LEGENDRE_SPHARM, band, grid->z[j], 1, legendre);
    for (size_t i = 0; i < functions; ++i) {
      legendre[i] *= grid->weight[j] * 2 * M_PI / (double)width;
    }
    memcpy(ring, values + j * width * fields, width * fields * sizeof *ring);
    fftw_execute(fft);
    add_ring(band, fields, legendre, spectrum, coefficients);
  }
  (void)pthread_mutex_lock(&planner);
  fftw_destroy_plan(fft);
  (void)pthread_mutex_unlock(&planner);
  return SUPINE_OK;
}
