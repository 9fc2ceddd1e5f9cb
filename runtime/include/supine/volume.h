/* SPDX-License-Identifier: MIT */
/** @file
 * The volume of a lung, mL, as a polynomial of its gains: the factors by which the displacement
 * from the reference surface is multiplied along x, y and z.
 *
 * Every function is thread-safe and allocates nothing.
 *
 * Stability: growing. A minor version may change functions and structs without a replacement;
 * CHANGELOG.md names the change. */
#ifndef SUPINE_VOLUME_H
#define SUPINE_VOLUME_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The volume of a lung minus that of its reference surface, mL, as a polynomial of the lung's
 * gains x, y and z (factors of its displacement along these axes):
 *
 *     of[0] x + of[1] y + of[2] z + of[3] y z + of[4] x z + of[5] x y + of[6] x y z */
typedef struct supine_volume_form {
  double of[7];
} supine_volume_form;

/** Add to `form` the volume of a lung as a polynomial of its gains, at given weights w_k of K
 * modes. Gains are factors of the displacement along x, y and z. L, Q and T are coefficients of
 * first, second and third order, as the volume is a sum of products of an x, a y and a z
 * coordinate:
 *
 *     of[j]     += sum_k L_jk w_k             for the gain of axis j = 0, 1, 2
 *     of[3 + j] += sum_kl Q_jkl w_k w_l       for the product of the gains of the other two axes
 *     of[6]     += sum_klm T_klm w_k w_l w_m
 * @param count      number K of modes
 * @param linear     [3, K] L, mL
 * @param quadratic  [3, K, K] Q, mL
 * @param third      [K, K, K] T, mL
 * @param weights    [K] w */
SUPINE_API void supine_volume_contract(size_t count, const double *linear,
                                       const double *quadratic, const double *third,
                                       const double *weights, supine_volume_form *form);

/** Return the volume of a lung minus that of its reference surface, mL, at given gains (factors of
 * the displacement along x, y and z). */
SUPINE_API double supine_volume_form_at(const supine_volume_form *form, const double gains[3]);

/** Compute how the volume of a lung depends on a scale s if its displacement along axis j = 0, 1, 2
 * (x, y, z) is multiplied by s ratio[j]. The volume minus that of the reference surface is
 *
 *     cubic[0] s + cubic[1] s^2 + cubic[2] s^3
 * @param cubic  [3] coefficients, mL, written */
SUPINE_API void supine_volume_form_along(const supine_volume_form *form, const double ratio[3],
                                         double cubic[3]);

/** Find the scale s at which cubic[0] s + cubic[1] s^2 + cubic[2] s^3 is `volume`, mL, in the
 * interval around 0 in which this polynomial is monotone.
 * @retval SUPINE_ERROR_ARGUMENT   the volume or a coefficient is not finite
 * @retval SUPINE_ERROR_NUMERICAL  no such scale: the surface folds before it holds the volume, or
 *                                 the volume does not change with the scale */
SUPINE_API supine_status supine_volume_scale(const double cubic[3], double volume, double *scale,
                                             supine_error *error);

/** Compute the gains of a lung (factors of its displacement along x, y and z), divided by the gain
 * at rest. `sigma` is the position on the path that the lung follows as its volume changes: 0 at
 * full inflation, 1 at rest, and beyond both:
 *
 *     ratio_j = sigma + 2 bend_j e(sigma)
 *     e = (sigma^3 - sigma) / 2  for sigma <= 1,   (sigma - 1) / sigma^6  for sigma > 1
 *
 * The diaphragm (z) makes most of a quiet breath, the rib cage (x, y) most of a breath near full
 * inflation (Verschakelen 1995, 120 subjects). Far below rest, e returns to 0, as a
 * curved path would turn triangles over.
 * @param bend   [3] curvature of the path on x, y and z; 0 gives a straight path
 * @param ratio  [3], written */
SUPINE_API void supine_volume_bend(const double bend[3], double sigma, double ratio[3]);

/** Find the gains of a lung (factors of its displacement along x, y and z) at which it holds a
 * given volume. Search along the path from full inflation through rest (supine_volume_bend).
 * @param bend    [3] curvature of the path
 * @param rest    volume at rest minus that of the reference surface, mL; unused if `bend` is 0
 * @param volume  volume to reach minus that of the reference surface, mL
 * @param gains   [3], written
 * @retval SUPINE_ERROR_ARGUMENT   a number is not finite
 * @retval SUPINE_ERROR_NUMERICAL  no such gains: the surface folds before it holds the volume, the
 *                                 volume does not change with the gains, a gain would be 2^20 or
 *                                 more, or the volume is beyond 64 times the way to rest */
SUPINE_API supine_status supine_volume_form_gains(const supine_volume_form *form,
                                                  const double bend[3], double rest, double volume,
                                                  double gains[3], supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
