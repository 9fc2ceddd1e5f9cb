/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The Gauss-Legendre x equispaced quadrature rule on the sphere. */
#ifndef SUPINE_GRID_H
#define SUPINE_GRID_H

#include <stddef.h>

#include <supine/status.h>

/** The most latitudes or longitudes of a rule. */
#define SUPINE_SH_GRID_MAX 16384

/** A rule of latitudes x longitudes directions. Direction (j, k) has cos(colatitude) = z[j] and
 * longitude 2 pi k / longitudes; its weight is weight[j] * 2 pi / longitudes. */
typedef struct supine_sh_grid {
  size_t latitudes;
  size_t longitudes;
  double *z;      /**< [latitudes] Gauss-Legendre nodes, descending: from +z to -z */
  double *weight; /**< [latitudes] Gauss-Legendre weights, summing to 2 */
} supine_sh_grid;

/** Makes the rule with the given numbers of latitudes and longitudes (1 to SUPINE_SH_GRID_MAX
 * each). It integrates products of two functions of band L exactly where latitudes > L and
 * longitudes > 2 L.
 * @retval SUPINE_ERROR_ARGUMENT  a number out of range
 * @retval SUPINE_ERROR_MEMORY    (GSL's error handler is called first if it is GSL that lacks it)
 */
supine_status supine_sh_grid_create(size_t latitudes, size_t longitudes, supine_sh_grid **grid);

/** How many latitudes and longitudes to sample fields on whose coefficients to `band` are wanted.
 *
 * @param oversampling  1 or more: 1 is the least grid that the transform takes; 0 means 1.5
 * @param latitudes     oversampling (band + 1), rounded up
 * @param longitudes    2 band + 2, times oversampling / 1.5 where that is more than 1, rounded up
 *                      to even numbers without a prime factor above 5, which suit the FFT
 *
 * A field with kinks is of no finite band; what lies beyond `band` folds back into the
 * coefficients. Longitudes need less oversampling than latitudes: 2 band + 2 of them only confuse
 * orders beyond the band, of which a ring near a pole has next to nothing. For heights along
 * gravity (0 to 1 between the lowest and the highest of a cloud of 60 points), band 15:
 *
 *     grid      directions   folded back, against what      error at other directions, against
 *                            the band leaves out anyway     the exact coefficients' error
 *     16 x 32       512            0.69                             1.24
 *     16 x 48       768            0.63                             1.22
 *     24 x 32       768            0.35                             1.05      <- default
 *     20 x 40       800            0.32                             1.05
 *     24 x 48      1152            0.19                             1.01
 *     32 x 64      2048            0.11                             1.00
 *
 * (tests/test_aliasing.c prints it.) Each direction is a solve; the two errors add as squares.
 *
 * @retval SUPINE_ERROR_ARGUMENT  oversampling below 1 or not a number, or a grid too large */
supine_status supine_sh_grid_size(size_t band, double oversampling, size_t *latitudes,
                                  size_t *longitudes);

/** Frees a rule; NULL is legal. */
void supine_sh_grid_destroy(supine_sh_grid *grid);

/** Unit direction (j, k). */
void supine_sh_grid_direction(const supine_sh_grid *grid, size_t j, size_t k, double direction[3]);

#endif
