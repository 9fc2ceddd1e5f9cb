/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Making and destroying plans. */
#include <stdlib.h>

#include <supine/sh.h>

#include "sh/internal.h"

/* Fields in a block: as measured. An odd number of lanes, so that the rows of a block do not fall
 * on the same few cache sets; the least where the rings alone would fill a cache. */
static size_t block_width(size_t longitudes) {
  return longitudes <= 256 ? SUPINE_SH_WIDTH_MAX : SUPINE_SH_LANES;
}

/* FFTW_ESTIMATE: as fast as FFTW_PATIENT here, in microseconds, and the same plan every time. */
static supine_status plan_fft(supine_sh_transform *plan) {
  const int longitudes = (int)plan->longitudes;
  const int width = (int)plan->width;
  const size_t size = 2 * plan->longitudes * plan->width * sizeof(double);
  fftw_complex *in = aligned_alloc(SUPINE_SH_ALIGNMENT, size);
  fftw_complex *out = aligned_alloc(SUPINE_SH_ALIGNMENT, size);
  if (in != NULL && out != NULL) {
    plan->fft = fftw_plan_many_dft(1, &longitudes, width, in, NULL, width, 1, out, NULL, width, 1,
                                   FFTW_BACKWARD, FFTW_ESTIMATE);
  }
  free(in);
  free(out);
  return plan->fft == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
}

supine_status supine_sh_transform_create(size_t band, const supine_sh_grid *grid,
                                         supine_sh_transform **plan, supine_error *error) {
  *plan = NULL;
  if (band > SUPINE_SH_BAND_MAX || grid->latitudes <= band || grid->longitudes <= 2 * band) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a grid of %zu x %zu directions cannot carry band %zu: more than %zu "
                            "latitudes and %zu longitudes are needed, and bands end at %d",
                            grid->latitudes, grid->longitudes, band, band, 2 * band,
                            SUPINE_SH_BAND_MAX);
  }
  supine_sh_transform *made = calloc(1, sizeof *made);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (made == NULL) {
    goto cleanup;
  }
  made->band = band;
  made->count = supine_sh_count(band);
  made->latitudes = grid->latitudes;
  made->longitudes = grid->longitudes;
  made->pairs = (grid->latitudes + 1) / 2;
  made->width = block_width(grid->longitudes);
  status = supine_sh_legendre(made, grid);
  if (status == SUPINE_OK) {
    status = plan_fft(made);
  }
  if (status == SUPINE_OK) {
    *plan = made;
    return SUPINE_OK;
  }

cleanup:
  supine_sh_transform_destroy(made);
  return supine_error_set(error, status, "out of memory for a transform of band %zu", band);
}

void supine_sh_transform_destroy(supine_sh_transform *plan) {
  if (plan != NULL) {
    free(plan->analysis);
    free(plan->position);
    if (plan->fft != NULL) {
      fftw_destroy_plan(plan->fft);
    }
    free(plan);
  }
}
