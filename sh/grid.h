/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file A quadrature rule on the sphere with Gauss-Legendre nodes in latitude. */
#ifndef SUPINE_GRID_H
#define SUPINE_GRID_H

#include <stddef.h>

#include <supine/status.h>

/** Largest number of latitudes, and of longitudes, of a quadrature rule on the sphere. */
#define SUPINE_SH_GRID_MAX 16384

/** A quadrature rule on the sphere. Its node (j, k) is the direction with cos(colatitude) = z[j]
 * and longitude 2 pi k / longitudes. The weight of the node is weight[j] * 2 pi / longitudes. */
typedef struct supine_sh_grid {
  size_t latitudes;
  size_t longitudes;
  double *z;      /**< [latitudes] Gauss-Legendre nodes, descending: from +z to -z */
  double *weight; /**< [latitudes] Gauss-Legendre weights, summing to 2 */
} supine_sh_grid;

/** Create a quadrature rule on the sphere with these numbers of latitudes and longitudes, 1 to
 * SUPINE_SH_GRID_MAX each. It integrates products of two spherical harmonics of degrees up to L
 * exactly if latitudes > L and longitudes > 2 L.
 * @param grid  written, NULL on failure; free it with supine_sh_grid_destroy */
supine_status supine_sh_grid_create(size_t latitudes, size_t longitudes, supine_sh_grid **grid);

/** Create a rule that is fine enough for functions with kinks: 8 latitudes for each degree up to
 * `band`, at least 32, and twice as many longitudes. */
supine_status supine_sh_grid_for_kinks(size_t band, supine_sh_grid **grid);

/** Free a quadrature rule. NULL is allowed. */
void supine_sh_grid_destroy(supine_sh_grid *grid);

/** Compute the unit vector of the quadrature node at latitude j and longitude k. */
void supine_sh_grid_direction(const supine_sh_grid *grid, size_t j, size_t k, double direction[3]);

#endif
