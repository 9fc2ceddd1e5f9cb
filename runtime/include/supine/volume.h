/* SPDX-License-Identifier: MIT */
/** @file
 * Volume against breath scale: V(s) - V(0) = c[0] s + c[1] s^2 + c[2] s^3, in mL.
 *
 * Thread-safe, without allocation. */
#ifndef SUPINE_VOLUME_H
#define SUPINE_VOLUME_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Adds the cubic of K weights to `cubic` [3], from the volume's forms:
 *
 *     c[0] += sum_k L_k w_k    c[1] += sum_kl Q_kl w_k w_l    c[2] += sum_klm T_klm w_k w_l w_m
 *
 * @param linear [K], quadratic [K, K], third [K, K, K] */
SUPINE_API void supine_volume_add(size_t count, const double *linear, const double *quadratic,
                                  const double *third, const double *weights, double cubic[3]);

/** The volume gained at a scale. */
SUPINE_API double supine_volume_at(const double cubic[3], double scale);

/** The scale at which the volume is gained, the one that is reached from 0 without the volume
 * turning back.
 * @retval SUPINE_ERROR_NUMERICAL  there is none: the surface folds before, or nothing moves */
SUPINE_API supine_status supine_volume_scale(const double cubic[3], double volume, double *scale,
                                             supine_error *error);

/** What a lung gains beyond its reference, as a polynomial of the three gains (x, y, z) at given
 * weights, mL:
 *
 *     of . (x, y, z, yz, xz, xy, xyz) */
typedef struct supine_volume_form {
  double of[7];
} supine_volume_form;

/** The volume gained at three gains. */
SUPINE_API double supine_volume_form_at(const supine_volume_form *form, const double gains[3]);

/** The one gain, on all three axes, at which the volume is gained. Statuses as supine_volume_scale.
 */
SUPINE_API supine_status supine_volume_form_scale(const supine_volume_form *form, double volume,
                                                  double *scale, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
