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

#ifdef __cplusplus
}
#endif
#endif
