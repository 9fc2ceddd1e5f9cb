/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Choose a grid on which functions of a direction are expanded in spherical harmonics. */
#include <stdlib.h>

#include "sh/expansion.h"

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
