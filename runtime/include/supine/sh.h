/* SPDX-License-Identifier: MIT */
/** @file
 * Real spherical harmonics of a direction.
 *
 * Convention: orthonormal on the unit sphere, no Condon-Shortley phase, z the polar axis,
 * index l*l + l + m, m < 0 the sine terms:
 *
 *     Y(0, 0) = 0.28209479        Y(1,-1) = 0.48860251 y
 *     Y(1, 0) = 0.48860251 z      Y(1, 1) = 0.48860251 x
 *
 * Every function is thread-safe, allocates nothing and needs libm alone. */
#ifndef SUPINE_SH_H
#define SUPINE_SH_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The highest band: the recurrences are tested up to it. */
#define SUPINE_SH_BAND_MAX 64

/** Return the number of harmonics with l <= band: (band + 1)^2. */
SUPINE_API size_t supine_sh_count(size_t band);

/** Return the index of Y(l, m) in a vector of coefficients: l*l + l + m. Requires |m| <= l. */
SUPINE_API size_t supine_sh_index(size_t l, int m);

/** Compute every Y(l, m) with l <= band at one direction.
 *
 * @param band       0 to SUPINE_SH_BAND_MAX
 * @param direction  [3], any length but 0; normalised here
 * @param y          [(band + 1)^2], written
 * @retval SUPINE_ERROR_ARGUMENT  band too high, or a direction that is zero or not finite */
SUPINE_API supine_status supine_sh_evaluate(size_t band, const double direction[3], double *y);

/** Compute supine_sh_evaluate for `count` directions [count, 3] into y [count, (band + 1)^2]. */
SUPINE_API supine_status supine_sh_evaluate_many(size_t band, size_t count,
                                                 const double *directions, double *y);

#ifdef __cplusplus
}
#endif
#endif
