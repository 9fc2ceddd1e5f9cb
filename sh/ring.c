/* SPDX-License-Identifier: GPL-3.0-or-later */
/* One pair of rings: values to cosine and sine rows along longitude.
 *
 * z = sum + i difference; Z(m) = sum over k of z(k) exp(+2 pi i m k / longitudes). With sum's
 * cosine and sine integrals c, s and difference's d, t:
 *
 *     Z(m) + Z(-m) = 2 (c + i d)        Z(m) - Z(-m) = 2 (-t + i s)
 *
 * The halves are in the matrices of legendre.c. */
#include <string.h>

#include "sh/internal.h"

/* Asks for a row's part of the next block, or for nothing of use past the last: rows are far apart
 * in the caller's memory, and too short here for the processor to foresee. */
static void prefetch(size_t fields, const double *row) {
#ifdef __GNUC__
  for (size_t f = 0; f < fields; f += 64 / sizeof *row) {
    __builtin_prefetch((const char *)row + f * sizeof *row);
  }
#endif
}

SUPINE_CLONES
static void gather(size_t fields, const double *restrict north, const double *restrict south,
                   double *restrict z) {
  for (size_t f = 0; f < fields; ++f) {
    z[2 * f] = north[f] + south[f];
    z[2 * f + 1] = north[f] - south[f];
  }
}

SUPINE_CLONES
static void gather_one(size_t fields, double sign, const double *restrict ring,
                       double *restrict z) {
  for (size_t f = 0; f < fields; ++f) {
    z[2 * f] = ring[f];
    z[2 * f + 1] = sign * ring[f];
  }
}

SUPINE_CLONES
static void split(size_t width, const double *restrict z, double *restrict even,
                  double *restrict odd) {
  for (size_t f = 0; f < width; ++f) {
    even[f] = z[2 * f];
    odd[f] = z[2 * f + 1];
  }
}

SUPINE_CLONES
static void split_order(size_t width, const double *restrict plus, const double *restrict minus,
                        double *restrict even, double *restrict odd, double *restrict even_sine,
                        double *restrict odd_sine) {
  for (size_t f = 0; f < width; ++f) {
    even[f] = plus[2 * f] + minus[2 * f];
    odd[f] = plus[2 * f + 1] + minus[2 * f + 1];
    even_sine[f] = plus[2 * f + 1] - minus[2 * f + 1];
    odd_sine[f] = minus[2 * f] - plus[2 * f];
  }
}

/* Eight parameters: a pair of rings and where its numbers lie, in the innermost loop but one. */
void supine_sh_ring_forward(const supine_sh_transform *plan, const supine_sh_workspace *work,
                            size_t fields, size_t stride, const double *north, const double *south,
                            size_t row, size_t rows) {
  const size_t width = plan->width;
  for (size_t k = 0; k < plan->longitudes; ++k) {
    double *z = work->ring + 2 * k * width;
    if (north != NULL && south != NULL) {
      prefetch(fields, north + k * stride + fields);
      prefetch(fields, south + k * stride + fields);
      gather(fields, north + k * stride, south + k * stride, z);
    } else if (north != NULL) {
      gather_one(fields, 1, north + k * stride, z);
    } else {
      gather_one(fields, -1, south + k * stride, z);
    }
    memset(z + 2 * fields, 0, 2 * (width - fields) * sizeof *z);
  }
  fftw_execute_dft(plan->fft, (fftw_complex *)work->ring, (fftw_complex *)work->ring_spectrum);
  const size_t group = rows * width;
  double *out = work->spectra + row * width;
  split(width, work->ring_spectrum, out, out + group);
  for (size_t m = 1; m <= plan->band; ++m) {
    double *rows_m = out + supine_sh_group(m, 0, 0) * group;
    split_order(width, work->ring_spectrum + 2 * m * width,
                work->ring_spectrum + 2 * (plan->longitudes - m) * width, rows_m,
                rows_m + 2 * group, rows_m + group, rows_m + 3 * group);
  }
}
