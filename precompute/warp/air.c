/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the mean density of aerated tissue around each place in the lungs. */
#include <math.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/parallel.h"

#include "precompute/warp/tissue.h"

/* Aerated tissue is below this density, HU + 1000. Aerated lung has -950 to -500 HU, also at rest
 * and at the back; lung above that is collapsed or consolidated. */
static const double aerated = 500.0;
/* Standard deviation of the Gaussian that weights the neighbourhood, mm: wider than the vessels
 * that are to be told from the tissue around them, and narrow against the lungs, whose density
 * changes along gravity by about 1 HU a mm. Edge of a bin of voxels, mm: half of it. */
static const double deviation = 8.0;
static const double bin_edge = 4.0;

/* Sums over the voxels in one layer of bins, for each lung: over all of its voxels, and over those
 * that are not soft. */
typedef struct sums {
  double mass[SUPINE_LUNGS_MAX];
  double soft[SUPINE_LUNGS_MAX]; /* number of soft voxels */
  double air[SUPINE_LUNGS_MAX], count[SUPINE_LUNGS_MAX];
} sums;

typedef struct binning {
  const supine_image *ct;
  supine_tissue *tissue;
  size_t bin[3]; /* voxels of a bin along each axis */
  float *weight; /* [bins, lungs] weighted number of aerated voxels */
  sums *layers;
} binning;

/* Add a row of voxels to the bins that begin with bin `bins`. */
static void add_row(const binning *work, size_t row, size_t bins, sums *sum) {
  const supine_image *ct = work->ct;
  const size_t first = row * ct->size[0];
  const unsigned char *kind = (const unsigned char *)work->tissue->kind.values + first;
  const size_t lungs = work->tissue->lungs;
  float *air = work->tissue->air.values;
  for (size_t i = work->tissue->span[row].begin; i < work->tissue->span[row].end; ++i) {
    if ((kind[i] & SUPINE_TISSUE_LUNG) == 0) {
      continue;
    }
    const size_t lung = kind[i] & SUPINE_TISSUE_LUNG_INDEX;
    const size_t at = (bins + i / work->bin[0]) * lungs + lung;
    const double density = fmax(supine_image_get(ct, first + i) + 1000.0, 0.0);
    sum->mass[lung] += density;
    if (density < aerated) {
      air[at] += (float)density;
      work->weight[at] += 1.0F;
    }
    if (density < 1000.0 + supine_warp_aerated) {
      sum->air[lung] += density;
      sum->count[lung] += 1.0;
    } else {
      sum->soft[lung] += 1.0;
    }
  }
}

static void add_layers(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const binning *work = context;
  const size_t *size = work->ct->size;
  const supine_image *air = &work->tissue->air;
  for (size_t layer = begin; layer < end; ++layer) {
    for (size_t k = layer * work->bin[2]; k < size[2] && k < (layer + 1) * work->bin[2]; ++k) {
      for (size_t j = 0; j < size[1]; ++j) {
        add_row(work, j + size[1] * k, air->size[0] * (j / work->bin[1] + air->size[1] * layer),
                &work->layers[layer]);
      }
    }
  }
}

/* A pass of the Gaussian along one axis of the bins. */
typedef struct blur {
  const supine_image *bins;
  size_t axis;
  size_t reach;
  const double *weight; /* [reach + 1] */
  const float *from;
  float *to;
} blur;

static void blur_layers(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const blur *pass = context;
  const size_t *size = pass->bins->size;
  const size_t channels = pass->bins->channels;
  const size_t layer = size[0] * size[1];
  const size_t stride = channels * (size_t[]){1, size[0], layer}[pass->axis];
  for (size_t i = begin * layer; i < end * layer; ++i) {
    const size_t at = (size_t[]){i % size[0], i / size[0] % size[1], i / layer}[pass->axis];
    const size_t below = at < pass->reach ? at : pass->reach;
    const size_t left = size[pass->axis] - 1 - at;
    const size_t above = left < pass->reach ? left : pass->reach;
    for (size_t c = channels * i; c < channels * (i + 1); ++c) {
      double sum = pass->weight[0] * (double)pass->from[c];
      for (size_t k = 1; k <= below; ++k) {
        sum += pass->weight[k] * (double)pass->from[c - k * stride];
      }
      for (size_t k = 1; k <= above; ++k) {
        sum += pass->weight[k] * (double)pass->from[c + k * stride];
      }
      pass->to[c] = (float)sum;
    }
  }
}

/* Smooth values on the bins by the Gaussian; `spare` is overwritten. */
static void smooth(const supine_image *bins, float *values, float *spare) {
  enum { REACH = 24 };
  double weight[REACH + 1];
  float *from = values;
  float *to = spare;
  const size_t count = supine_image_count(bins) * bins->channels;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double step = supine_image_plane_distance(bins, axis) / deviation; /* in SDs */
    const size_t reach = (size_t)fmin(ceil(3.0 / step), REACH);
    for (size_t k = 0; k <= reach; ++k) {
      weight[k] = exp(-0.5 * (double)k * step * (double)k * step);
    }
    blur pass = {bins, axis, reach, weight, from, to};
    supine_parallel_for(bins->size[2], 1, 0, blur_layers, &pass);
    float *other = from;
    from = to;
    to = other;
  }
  for (size_t i = 0; i < count; ++i) { /* three passes end in `spare` */
    values[i] = spare[i];
  }
}

/* Divide sums of densities by sums of weights. Where no tissue is aerated, the mean of the lung
 * takes over, which counts as a thousandth of a voxel. */
static void divide(const sums *total, supine_image *air, const float *weight) {
  static const double least = 1e-3;
  float *density = air->values;
  for (size_t i = 0; i < supine_image_count(air) * air->channels; ++i) {
    const size_t lung = i % air->channels;
    const double mean = total->count[lung] > 0.0 ? total->air[lung] / total->count[lung] : 0.0;
    density[i] = (float)(((double)density[i] + least * mean) / ((double)weight[i] + least));
  }
}

/* Choose the bins, and the frame of the image whose voxels they are. */
static void choose_bins(const supine_image *ct, size_t lungs, size_t bin[3], supine_image *air) {
  *air = *ct;
  air->voxel = SUPINE_VOXEL_F32;
  air->channels = lungs;
  air->values = NULL;
  for (size_t a = 0; a < 3; ++a) {
    bin[a] = (size_t)fmax(1.0, rint(bin_edge / supine_image_plane_distance(ct, a)));
    air->size[a] = (ct->size[a] + bin[a] - 1) / bin[a];
    for (size_t k = 0; k < 3; ++k) {
      air->origin[k] += 0.5 * ((double)bin[a] - 1.0) * ct->step[a][k];
      air->step[a][k] *= (double)bin[a];
    }
  }
}

supine_status supine_warp_tissue_find_air(const supine_image *ct, supine_tissue *tissue,
                                          supine_error *error) {
  binning work = {.ct = ct, .tissue = tissue};
  supine_image *air = &tissue->air;
  choose_bins(ct, tissue->lungs, work.bin, air);
  const size_t count = supine_image_count(air) * tissue->lungs;
  SUPINE_ARENA arena = {0};
  float *spare = supine_arena_take(&arena, count, sizeof *spare);
  work.weight = supine_arena_zeros(&arena, count, sizeof *work.weight);
  work.layers = supine_arena_zeros(&arena, air->size[2], sizeof *work.layers);
  air->values = calloc(count, sizeof(float));
  if (arena.failed || air->values == NULL) {
    return supine_error_memory(error, "densities of aerated tissue");
  }
  sums total = {{0.0}, {0.0}, {0.0}, {0.0}};
  supine_parallel_for(air->size[2], 1, 0, add_layers, &work);
  for (size_t i = 0; i < air->size[2] * SUPINE_LUNGS_MAX; ++i) {
    const sums *layer = &work.layers[i / SUPINE_LUNGS_MAX];
    const size_t lung = i % SUPINE_LUNGS_MAX;
    tissue->mass[lung] += layer->mass[lung];
    tissue->soft[lung] += layer->soft[lung] * supine_warp_tissue_voxel(ct);
    tissue->volume[lung] += (layer->soft[lung] + layer->count[lung]) * supine_warp_tissue_voxel(ct);
    total.air[lung] += layer->air[lung];
    total.count[lung] += layer->count[lung];
  }
  smooth(air, air->values, spare);
  smooth(air, work.weight, spare);
  divide(&total, air, work.weight);
  return SUPINE_OK;
}
