/* SPDX-License-Identifier: MIT */
/* Compute real spherical harmonics of a unit vector (x, y, z), for m >= 0:
 *
 *     Y(l, m) = q(l, m) Re (x + i y)^m        Y(l, -m) = q(l, m) Im (x + i y)^m
 *
 * q(l, m) is the normalised Legendre function divided by sin^m of the colatitude. It is a
 * polynomial in z, and regular at the poles:
 *
 *     q(l, m) = a(l, m) (z q(l - 1, m) - q(l - 2, m) / a(l - 1, m))
 *     a(l, m)^2 = (4 l^2 - 1) / (l^2 - m^2) */
#include <math.h>

#include <supine/sh.h>

#include "base/vec3.h"

size_t supine_sh_count(size_t band) {
  return (band + 1) * (band + 1);
}

size_t supine_sh_index(size_t l, int m) {
  return (size_t)((ptrdiff_t)(l * l + l) + m);
}

/* Compute the harmonics Y(l, m) and Y(l, -m) for l = m to band, at a unit vector (x, y, z). `top`
 * is q(m, m), with which the recurrence at the top of this file starts. `re` and `im` are the real
 * and the imaginary part of (x + i y)^m. */
static void evaluate_order(size_t band, size_t m, double z, double top, double re, double im,
                           double *y) {
  double previous = 0; /* term q(l - 1, m) / a(l, m) in the recurrence for q(l + 1, m), see above */
  double q = top;
  for (size_t l = m;; ++l) {
    double *centre = y + l * l + l;
    centre[-(ptrdiff_t)m] = q * im;
    centre[m] = q * re; /* if m = 0, this replaces the value of the line above */
    if (l == band) {
      return;
    }
    const double next = (double)(l + 1);
    const double order = (double)m;
    const double a = sqrt((4 * next * next - 1) / ((next - order) * (next + order)));
    const double above = a * (z * q - previous);
    previous = q / a;
    q = above;
  }
}

supine_status supine_sh_evaluate(size_t band, const double direction[3], double *y) {
  double unit[3];
  if (band > SUPINE_SH_BAND_MAX || !supine_normalise(direction, unit)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  double top = 0.28209479177387814347; /* sqrt(1 / (4 pi)) */
  double re = 1;
  double im = 0;
  evaluate_order(band, 0, unit[2], top, re, im, y);
  /* sqrt(2), because real harmonics have cos and sin instead of exp(i m phi) */
  top *= 1.41421356237309504880;
  for (size_t m = 1; m <= band; ++m) {
    const double turned = re * unit[0] - im * unit[1];
    im = re * unit[1] + im * unit[0];
    re = turned;
    top *= sqrt((double)(2 * m + 1) / (double)(2 * m));
    evaluate_order(band, m, unit[2], top, re, im, y);
  }
  return SUPINE_OK;
}

supine_status supine_sh_evaluate_products(size_t band, size_t order, const double direction[3],
                                          double t, double *products) {
  double polynomial[SUPINE_SH_ORDER_MAX + 1] = {1, t};
  if (order > SUPINE_SH_ORDER_MAX || supine_sh_evaluate(band, direction, products) != SUPINE_OK) {
    return SUPINE_ERROR_ARGUMENT;
  }
  for (size_t n = 2; n <= order; ++n) {
    polynomial[n] = 2 * t * polynomial[n - 1] - polynomial[n - 2];
  }
  for (size_t h = supine_sh_count(band); h-- > 0;) { /* from the end: products replace harmonics */
    const double y = products[h];
    for (size_t n = 0; n <= order; ++n) {
      products[h * (order + 1) + n] = y * polynomial[n];
    }
  }
  return SUPINE_OK;
}
