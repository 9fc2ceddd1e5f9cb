/* SPDX-License-Identifier: MIT */
/** @file
 * The volume of a lung at given weights, as a polynomial of its gains, in mL.
 *
 * Every function is thread-safe and allocates nothing. */
#ifndef SUPINE_VOLUME_H
#define SUPINE_VOLUME_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The volume V of a lung minus the volume F of its reference surface, mL, as a polynomial of the
 * lung's gains x, y and z at given weights:
 *
 *     V - F = of . (x, y, z, yz, xz, xy, xyz) */
typedef struct supine_volume_form {
  double of[7];
} supine_volume_form;

/** Add the polynomial for K weights to `form`. The volume of a lung is a sum of determinants, and
 * each product in a determinant has one x, one y and one z coordinate of vertices. Therefore
 *
 *     of[j]     += sum_k L_jk w_k             for the gain of axis j = 0, 1, 2
 *     of[3 + j] += sum_kl Q_jkl w_k w_l       for the product of the gains of the other two axes
 *     of[6]     += sum_klm T_klm w_k w_l w_m
 * @param count      number K of weights
 * @param axes       3, or 1 if one gain serves all axes. With 1, only the coefficients of x, yz and
 *                   xyz change.
 * @param linear     [axes, K] L, mL
 * @param quadratic  [axes, K, K] Q, mL
 * @param third      [K, K, K] T, mL
 * @param weights    [K] w */
SUPINE_API void supine_volume_contract(size_t count, size_t axes, const double *linear,
                                       const double *quadratic, const double *third,
                                       const double *weights, supine_volume_form *form);

/** Return the volume of a lung at given gains minus that of the reference surface, mL. */
SUPINE_API double supine_volume_form_at(const supine_volume_form *form, const double gains[3]);

/** For the gains s ratio[0], s ratio[1] and s ratio[2], V - F of supine_volume_form is the
 * polynomial cubic[0] s + cubic[1] s^2 + cubic[2] s^3. Compute its three coefficients, mL. */
SUPINE_API void supine_volume_form_along(const supine_volume_form *form, const double ratio[3],
                                         double cubic[3]);

/** Find the scale s at which cubic[0] s + cubic[1] s^2 + cubic[2] s^3 is `volume`, mL, in the
 * interval around 0 in which this polynomial is monotone.
 * @retval SUPINE_ERROR_NUMERICAL  no such scale: the surface folds before it holds the volume, or
 *                                 the volume does not change with the scale */
SUPINE_API supine_status supine_volume_scale(const double cubic[3], double volume, double *scale,
                                             supine_error *error);

/** Compute the three gains at point sigma of a path, as multiples of the gain at rest.
 * The path leads from full inflation (sigma = 0) to rest (sigma = 1), and continues beyond
 * both:
 *
 *     ratio_j = sigma + 2 bend_j e(sigma)
 *     e = (sigma^3 - sigma) / 2  for sigma <= 1,   (sigma - 1) / sigma^6  for sigma > 1
 *
 * The diaphragm (z) makes most of a quiet breath, the rib cage (x, y) most of a breath near full
 * inflation (Verschakelen 1995, 120 subjects). Below rest (sigma > 1), e returns to 0, as a bent
 * path would turn triangles over. A bend of 0 gives a straight path.
 * @param bend   [3] bend on x, y and z
 * @param ratio  [3], written */
SUPINE_API void supine_volume_bend(const double bend[3], double sigma, double ratio[3]);

/** Find the gains on the path of supine_volume_bend at which a lung holds a volume V. F is the
 * volume of the reference surface of this lung.
 * @param bend    [3] bend of the path
 * @param rest    V - F at rest, mL; unused if the bend is 0
 * @param volume  V - F to hold, mL
 * @param gains   [3], written
 * @retval SUPINE_ERROR_NUMERICAL  no such gains: the surface folds before it holds the volume, or
 *                                 the volume does not change with the gains */
SUPINE_API supine_status supine_volume_form_gains(const supine_volume_form *form,
                                                  const double bend[3], double rest, double volume,
                                                  double gains[3], supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
