/* SPDX-License-Identifier: MIT */
/** @file
 * What lungs hold at given weights, as polynomials of the gains, in mL.
 *
 * Thread-safe, without allocation. */
#ifndef SUPINE_VOLUME_H
#define SUPINE_VOLUME_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** What a lung gains beyond its reference, as a polynomial of its three gains at given weights:
 *
 *     V - F = of . (x, y, z, yz, xz, xy, xyz) */
typedef struct supine_volume_form {
  double of[7];
} supine_volume_form;

/** Add the form of K weights to `form`. A determinant takes one x, one y and one z, so that
 *
 *     of[j]     += sum_k L_jk w_k             j = x, y, z
 *     of[3 + j] += sum_kl Q_jkl w_k w_l       of the two axes besides j
 *     of[6]     += sum_klm T_klm w_k w_l w_m
 *
 * @param axes  3; or 1: the forms of one gain for all axes, in the places of x, yz and xyz
 * @param linear [axes, K], quadratic [axes, K, K], third [K, K, K] */
SUPINE_API void supine_volume_contract(size_t count, size_t axes, const double *linear,
                                       const double *quadratic, const double *third,
                                       const double *weights, supine_volume_form *form);

/** The volume gained at three gains. */
SUPINE_API double supine_volume_form_at(const supine_volume_form *form, const double gains[3]);

/** The volume gained where the gains are `scale` times `ratio`: c[0] s + c[1] s^2 + c[2] s^3. */
SUPINE_API void supine_volume_form_along(const supine_volume_form *form, const double ratio[3],
                                         double cubic[3]);

/** The volume gained at a scale. */
SUPINE_API double supine_volume_at(const double cubic[3], double scale);

/** The scale at which the volume is gained, the one that is reached from 0 without the volume
 * turning back.
 * @retval SUPINE_ERROR_NUMERICAL  there is none: the surface folds before, or nothing moves */
SUPINE_API supine_status supine_volume_scale(const double cubic[3], double volume, double *scale,
                                             supine_error *error);

/** The path of the gains from full inflation, sigma 0, to rest, sigma 1, and beyond both, relative
 * to those at rest:
 *
 *     A_j = sigma + 2 bend_j e(sigma)
 *     e = (sigma^3 - sigma) / 2  for sigma <= 1;  (sigma - 1) / sigma^6  for sigma > 1
 *
 * A quiet breath is mostly the diaphragm's, z, one near full inflation the rib cage's
 * (Verschakelen 1995, n 120). Below rest the bend fades, as it would turn triangles over. A bend of
 * 0 is a straight line. */
SUPINE_API void supine_volume_bend(const double bend[3], double sigma, double ratio[3]);

/** The gains at which a lung holds `volume` beyond its reference.
 * @param bend  of the path
 * @param rest  what the lung holds at rest beyond its reference; unused where the bend is 0
 * @retval SUPINE_ERROR_NUMERICAL  there are none: the surface folds before, or nothing moves */
SUPINE_API supine_status supine_volume_form_gains(const supine_volume_form *form,
                                                  const double bend[3], double rest, double volume,
                                                  double gains[3], supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
