/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute a quadrature rule on the sphere with Gauss-Legendre nodes in latitude. */
#include <math.h>
#include <stdlib.h>

#include <gsl/gsl_integration.h>
#include <gsl/gsl_sf_legendre.h>

#include "base/arena.h"
#include "sh/expansion.h"

/* Functions with kinks have harmonics of every degree. With 8 latitudes for each degree, those
 * above the band hardly alias. */
enum { LATITUDES_PER_BAND = 8, LATITUDES_MIN = 32 };

/* Refine the n nodes z and the weights w to rounding error by one Newton step on the Legendre
 * polynomial P_n. GSL tabulates some rules, and computes the others with errors up to about 1e-11.
 * One step squares such an error.
 *
 *     w = 2 / ((1 - z^2) P_n'(z)^2)
 *
 * `work` has room for 2 (n + 1) numbers. */
static void refine(supine_sh_grid *grid, double *work) {
  const size_t n = grid->latitudes;
  double *p = work;
  double *slope = work + n + 1;
  for (size_t j = 0; j < n; ++j) {
    double z = grid->z[j];
    (void)gsl_sf_legendre_Pl_deriv_array((int)n, z, p, slope);
    z -= p[n] / slope[n];
    (void)gsl_sf_legendre_Pl_deriv_array((int)n, z, p, slope);
    grid->z[j] = z;
    grid->weight[j] = 2 / ((1 - z) * (1 + z) * slope[n] * slope[n]);
  }
}

supine_status supine_sh_grid_create(size_t latitudes, size_t longitudes, supine_sh_grid **grid) {
  *grid = NULL;
  if (latitudes < 1 || latitudes > SUPINE_SH_GRID_MAX || longitudes < 1 ||
      longitudes > SUPINE_SH_GRID_MAX) {
    return SUPINE_ERROR_ARGUMENT;
  }
  SUPINE_ARENA arena = {0};
  supine_sh_grid *made = calloc(1, sizeof *made);
  double *work = supine_arena_take(&arena, 2 * (latitudes + 1), sizeof *work);
  gsl_integration_glfixed_table *table = gsl_integration_glfixed_table_alloc(latitudes);
  if (made != NULL) {
    *made = (supine_sh_grid){latitudes, longitudes, malloc(latitudes * sizeof *made->z),
                             malloc(latitudes * sizeof *made->weight)};
  }
  if (made == NULL || work == NULL || table == NULL || made->z == NULL || made->weight == NULL) {
    supine_sh_grid_destroy(made);
    made = NULL;
  } else {
    for (size_t j = 0; j < latitudes; ++j) { /* GSL's nodes ascend, these descend */
      const size_t south = latitudes - 1 - j;
      (void)gsl_integration_glfixed_point(-1, 1, j, &made->z[south], &made->weight[south], table);
    }
    if (table->precomputed == 0) {
      refine(made, work);
    }
  }
  if (table != NULL) { /* GSL 2.7 does not accept NULL here */
    gsl_integration_glfixed_table_free(table);
  }
  *grid = made;
  return made != NULL ? SUPINE_OK : SUPINE_ERROR_MEMORY;
}

supine_status supine_sh_grid_for_kinks(size_t band, supine_sh_grid **grid) {
  const size_t least = LATITUDES_PER_BAND * (band + 1);
  const size_t latitudes = least < LATITUDES_MIN ? LATITUDES_MIN : least;
  return supine_sh_grid_create(latitudes, 2 * latitudes, grid);
}

void supine_sh_grid_destroy(supine_sh_grid *grid) {
  if (grid != NULL) {
    free(grid->z);
    free(grid->weight);
    free(grid);
  }
}

void supine_sh_grid_direction(const supine_sh_grid *grid, size_t j, size_t k, double direction[3]) {
  const double z = grid->z[j];
  const double sine = sqrt((1 - z) * (1 + z));
  const double longitude = 2 * M_PI * (double)k / (double)grid->longitudes;
  direction[0] = sine * cos(longitude);
  direction[1] = sine * sin(longitude);
  direction[2] = z;
}
