/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Expand functions of a direction in spherical harmonics, from their values on a grid. */
#include <stdlib.h>
#include <string.h>

#include <supine/sh.h>

#include "sh/expansion.h"
#include "sh/transform.h"

/* Functions with kinks have harmonics of every degree. With 8 latitudes for each degree, those
 * above the band hardly alias. */
enum { LATITUDES_PER_BAND = 8, LATITUDES_MIN = 32 };

void supine_sh_expansion_free(supine_expansion *expansion) {
  free(expansion->columns);
  free(expansion->functions);
  *expansion = (supine_expansion){0};
}

supine_status supine_sh_expansion_grid(size_t band, supine_sh_grid **grid) {
  const size_t least = LATITUDES_PER_BAND * (band + 1);
  const size_t latitudes = least < LATITUDES_MIN ? LATITUDES_MIN : least;
  return supine_sh_grid_create(latitudes, 2 * latitudes, grid);
}

supine_status supine_sh_expand(size_t band, const supine_sh_grid *grid, size_t rank,
                               const double *values, double *functions, supine_error *error) {
  supine_sh_transform *plan = NULL;
  const supine_status status = supine_sh_transform_create(band, grid, rank, &plan, error);
  memset(functions, 0, rank * supine_sh_count(band) * sizeof *functions);
  for (size_t j = 0; j < grid->latitudes && status == SUPINE_OK; ++j) {
    supine_sh_transform_ring(plan, j, values + j * grid->longitudes * rank, functions);
  }
  supine_sh_transform_destroy(plan);
  return status;
}
