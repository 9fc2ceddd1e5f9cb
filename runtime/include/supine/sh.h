/* SPDX-License-Identifier: MIT */
/** @file
 * Real spherical harmonics of a direction.
 *
 * They are orthonormal on the unit sphere, without the Condon-Shortley phase; the polar axis is z.
 * The index of Y(l, m) is l*l + l + m, and m < 0 denotes the sine terms.
 *
 *     Y(0, 0) = 0.28209479        Y(1,-1) = 0.48860251 y
 *     Y(1, 0) = 0.48860251 z      Y(1, 1) = 0.48860251 x
 *
 * Functions of a direction and of a volume are sums of products of these harmonics and Chebyshev
 * polynomials T_n(t), -1 <= t <= 1: T_0 = 1, T_1 = t, T_n = 2 t T_(n - 1) - T_(n - 2).
 *
 * Every function is thread-safe, allocates nothing and needs only libm.
 *
 * Stability: stable. A change before 1.0 needs a new minor version, and CHANGELOG.md says how to
 * move over. */
#ifndef SUPINE_SH_H
#define SUPINE_SH_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The highest band. Tests confirm that the recurrences are accurate up to this band. */
#define SUPINE_SH_BAND_MAX 64

/** Return the number of harmonics with l <= band: (band + 1)^2. */
SUPINE_API size_t supine_sh_count(size_t band);

/** Return the index of Y(l, m) in a vector of coefficients: l*l + l + m. Requires |m| <= l. */
SUPINE_API size_t supine_sh_index(size_t l, int m);

/** Compute every Y(l, m) with l <= band at one direction.
 * @param band       0 to SUPINE_SH_BAND_MAX
 * @param direction  [3], any length but 0
 * @param y          [(band + 1)^2], written
 * @retval SUPINE_ERROR_ARGUMENT  the band is too high, or the direction is zero or not finite */
SUPINE_API supine_status supine_sh_evaluate(size_t band, const double direction[3], double *y);

/** The highest order of the Chebyshev polynomials. */
#define SUPINE_SH_ORDER_MAX 7

/** Compute every product Y(l, m)(direction) T_n(t) with l <= band and n <= order. The index of a
 * product is n + (order + 1) times the index of Y(l, m); order 0 gives the harmonics alone.
 * @param t         -1 to 1
 * @param products  [(band + 1)^2, order + 1], written
 * @retval SUPINE_ERROR_ARGUMENT  as supine_sh_evaluate, or the order is too high */
SUPINE_API supine_status supine_sh_evaluate_products(size_t band, size_t order,
                                                     const double direction[3], double t,
                                                     double *products);

#ifdef __cplusplus
}
#endif
#endif
