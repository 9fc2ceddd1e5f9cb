/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Move an image by a displacement field: each voxel takes the value from where its tissue was. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/clones.h"
#include "base/parallel.h"
#include "base/remedy.h"
#include "base/vec3.h"

#include "precompute/warp/run.h"
#include "precompute/warp/tissue.h"

/* Sums over the voxels of each lung in the moved image, in fixed point, so that they do not depend
 * on the number of threads. */
typedef struct tally {
  int64_t mass[SUPINE_LUNGS_MAX];    /* HU + 1000 */
  int64_t aerated[SUPINE_LUNGS_MAX]; /* its part that is proportional to the scale */
} tally;

/* To find the scales of densities, every eighth row is enough. */
enum { SAMPLE = 8 };

/* Numbers of a tally for 1 HU. A CT has up to 2^30 voxels of up to 2^12 HU. */
static const double fixed = 256.0;

typedef struct resampling {
  const supine_field *inverse;
  const supine_tissue *tissue; /* NULL: densities are not scaled */
  const supine_image *from;
  supine_image *to;
  bool labels;
  double axes[3][3]; /* [k] a displacement of 1 mm along x, y or z, in voxels of `from` */
  double bin[3];     /* voxels of `from` in a voxel of tissue->air, along each axis */
  double scale[SUPINE_LUNGS_MAX]; /* factor on the density of aerated tissue, beside the change of
                                     volume */
  bool again;          /* whether only runs in the lungs are processed, with other scales */
  bool sampling;       /* whether only some rows are processed, and nothing is stored */
  unsigned char *lung; /* [rows, runs] whether the run has voxels of the lungs */
  tally *sums;         /* [threads] */
} resampling;

/* The x, y and z of a vector, and an unused number; `narrow` as fields store it. */
typedef double vector __attribute__((vector_size(4 * sizeof(double))));
typedef float narrow __attribute__((vector_size(4 * sizeof(float))));

/* Interpolate the displacements, mm. Return whether a voxel moves. */
INLINE bool displace(const supine_image *nodes, const cells *in, double (*shift)[RUN]) {
  double weight[8][RUN];
  size_t offset[8];
  vector corners[8] = {{0.0}};
  bool moves = false; /* whether a corner of the cell moves */
  bool any = false;
  weigh_corners(nodes, in, weight, offset);
  for (size_t i = 0; i < RUN; ++i) {
    if (i == 0 || in->first[i] != in->first[i - 1]) {
      vector squares = {0.0};
      for (size_t corner = 0; corner < 8; ++corner) {
        const float *u = (const float *)nodes->values + in->first[i] + offset[corner];
        corners[corner] = __builtin_convertvector((narrow){u[0], u[1], u[2], 0.0F}, vector);
        squares += corners[corner] * corners[corner];
      }
      moves = squares[0] + squares[1] + squares[2] > 0.0;
    }
    vector u = {0.0, 0.0, 0.0, 0.0};
    if (moves) {
      for (size_t corner = 0; corner < 8; ++corner) {
        u += weight[corner][i] * corners[corner];
      }
    }
    for (size_t k = 0; k < 3; ++k) {
      shift[k][i] = u[k];
    }
    any |= moves;
  }
  return any;
}

/* Compute the volume of the tissue at each voxel y in the lungs before the motion, divided by its
 * volume after it. This is det(I + dv/dy) for the inverse field v; 0 if the field folds at y. */
INLINE void find_ratios(const supine_image *nodes, const cells *in, const unsigned char *kind,
                        double *ratio) {
  const double whole = supine_triple(nodes->step[0], nodes->step[1], nodes->step[2]);
  const supine_image frame = *nodes;
  const size_t stride[3] = {3, 3 * frame.size[0], 3 * frame.size[0] * frame.size[1]};
  vector rise[3][4] = {
      {{0.0}}}; /* along the four edges of the cell in the direction of each axis */
  size_t of = SIZE_MAX;
  for (size_t i = 0; i < RUN; ++i) {
    double edge[3][3];
    if ((kind[i] & SUPINE_TISSUE_LUNG) == 0) {
      continue;
    }
    if (in->first[i] != of) {
      of = in->first[i];
      for (size_t e = 0; e < 12; ++e) {
        const size_t k = e / 4;
        const float *u = (const float *)frame.values + of + (e & 1U) * stride[(k + 1) % 3] +
                         (e >> 1 & 1U) * stride[(k + 2) % 3];
        const float *v = u + stride[k];
        rise[k][e % 4] = __builtin_convertvector((narrow){v[0], v[1], v[2], 0.0F}, vector) -
                         __builtin_convertvector((narrow){u[0], u[1], u[2], 0.0F}, vector);
      }
    }
    for (size_t k = 0; k < 3; ++k) {
      const double a = in->share[(k + 1) % 3][i];
      const double b = in->share[(k + 2) % 3][i];
      const vector mean = (1.0 - b) * ((1.0 - a) * rise[k][0] + a * rise[k][1]) +
                          b * ((1.0 - a) * rise[k][2] + a * rise[k][3]);
      for (size_t axis = 0; axis < 3; ++axis) {
        edge[k][axis] = frame.step[k][axis] + mean[axis];
      }
    }
    const double stretch = supine_triple(edge[0], edge[1], edge[2]) / whole;
    ratio[i] = stretch > 0.0 ? stretch : 0.0;
  }
}

/* Find the mean density of aerated tissue around each voxel, HU + 1000.
 * @param corner  lowest corner of its cell, voxels */
INLINE void find_aerated(const resampling *work, const cells *in, double (*corner)[RUN],
                         const unsigned char *kind, double *air) {
  double at[3][RUN];
  cells bins;
  for (size_t a = 0; a < 3; ++a) {
    const double bin = work->bin[a];
    for (size_t i = 0; i < RUN; ++i) {
      at[a][i] = (corner[a][i] + in->share[a][i] - 0.5 * (bin - 1.0)) / bin;
    }
  }
  find_cells(&work->tissue->air, at, &bins);
  for (size_t i = 0; i < RUN; ++i) {
    bins.first[i] += kind[i] & SUPINE_TISSUE_LUNG_INDEX; /* the channel of the lung */
  }
  interpolate(&work->tissue->air, &bins, air);
}

/* Scale the density of a voxel in the lungs, HU + 1000: its soft share keeps its density, and its
 * aerated share changes with the volume. Interpolation cannot make a voxel denser than soft tissue
 * and its source, and nor does this. */
static double scale_density(double density, double air, double ratio, double *aerated) {
  static const double most = 1050.0; /* blood and muscle without contrast agent have up to 50 HU */
  const double share = supine_warp_tissue_soft_share(density, air);
  const double soft = share < 1.0 ? share * supine_warp_tissue_density : density;
  const double cap = density > most ? density : most;
  *aerated = (density - soft) * ratio;
  if (soft + *aerated > cap) {
    *aerated = 0.0;
    return cap;
  }
  return soft + *aerated;
}

/* Scale the densities of the voxels in the lungs, and add them to the sums.
 * @param nodes   cells of the field around the voxels of the moved image
 * @param kind    kind of the voxel nearest to the source of each
 * @param values  HU, replaced */
INLINE void scale_densities(const resampling *work, const cells *nodes, const cells *in,
                            double (*corner)[RUN], const unsigned char *kind, double *values,
                            tally *sum) {
  double air[RUN];
  double ratio[RUN];
  find_ratios(&work->inverse->nodes, nodes, kind, ratio);
  find_aerated(work, in, corner, kind, air);
  for (size_t i = 0; i < RUN; ++i) {
    if ((kind[i] & SUPINE_TISSUE_LUNG) != 0) {
      const size_t lung = kind[i] & SUPINE_TISSUE_LUNG_INDEX;
      double aerated;
      const double scaled =
          scale_density(values[i] + 1000.0, air[i], work->scale[lung] * ratio[i], &aerated);
      values[i] = scaled - 1000.0;
      sum->mass[lung] += llrint(fixed * scaled);
      sum->aerated[lung] += llrint(fixed * aerated);
    }
  }
}

/* Take the kind of the first corner of the cell of each point. Return whether one is in the lungs,
 * or near to their border. */
INLINE bool take_kinds(const resampling *work, const cells *in, unsigned char *kind) {
  const unsigned char *of = work->tissue->kind.values;
  unsigned char any = 0;
  for (size_t i = 0; i < RUN; ++i) {
    kind[i] = of[in->first[i]];
    any |= kind[i];
  }
  return any != 0;
}

/* Interpolate the density of a point at the border of the lungs, HU, only from corners of its cell
 * that are in the lungs, or not, as its nearest corner is. The chest wall thus adds no mass to the
 * lungs. Set `kind` to that of the nearest corner. */
static void interpolate_side(const resampling *work, const cells *in, size_t i, double *value,
                             unsigned char *kind) {
  const unsigned char *of = work->tissue->kind.values;
  double sum[2] = {0.0, 0.0}; /* of the weights, and of the values times their weights */
  size_t at[8];
  size_t nearest = 0;
  for (size_t corner = 0; corner < 8; ++corner) {
    size_t stride = 1;
    at[corner] = in->first[i];
    for (size_t a = 0; a < 3; ++a) {
      at[corner] += (corner >> a & 1U) != 0 && work->from->size[a] > 1 ? stride : 0;
      stride *= work->from->size[a];
    }
  }
  for (size_t a = 0; a < 3; ++a) {
    nearest += in->share[a][i] > 0.5 ? (size_t)1 << a : 0;
  }
  *kind = of[at[nearest]];
  for (size_t corner = 0; corner < 8; ++corner) {
    double weight = ((of[at[corner]] ^ *kind) & SUPINE_TISSUE_LUNG) == 0 ? 1.0 : 0.0;
    for (size_t a = 0; a < 3; ++a) {
      weight *= (corner >> a & 1U) != 0 ? in->share[a][i] : 1.0 - in->share[a][i];
    }
    sum[0] += weight;
    sum[1] += weight * supine_image_get(work->from, at[corner]);
  }
  *value = sum[1] / sum[0];
}

/* Interpolate and scale densities, HU. Return whether a point is in the lungs or at their
 * border. */
INLINE bool take_densities(const resampling *work, const cells *nodes, const cells *in,
                           double (*corner)[RUN], size_t count, double *values, tally *sum) {
  unsigned char kind[RUN];
  const bool lung = take_kinds(work, in, kind);
  if (work->sampling && !lung) {
    return false;
  }
  interpolate(work->from, in, values);
  if (lung) {
    for (size_t i = 0; i < RUN; ++i) {
      if ((kind[i] & SUPINE_TISSUE_BORDER) != 0) {
        interpolate_side(work, in, i, &values[i], &kind[i]);
      }
    }
    memset(kind + count, 0, RUN - count); /* the sums are over voxels of the image only */
    scale_densities(work, nodes, in, corner, kind, values, sum);
  }
  return lung;
}

/* Return whether one of `count` voxels of the image belongs to the lungs. */
static bool has_lung(const supine_tissue *tissue, size_t first, size_t count) {
  const unsigned char *kind = (const unsigned char *)tissue->kind.values + first;
  unsigned char any = 0;
  for (size_t i = 0; i < count; ++i) {
    any |= kind[i];
  }
  return (any & SUPINE_TISSUE_LUNG) != 0;
}

/* Resample RUN voxels of a row from `begin` on; do not store voxels past the end of the row.
 * Copy voxels that do not move, unless they are in the lungs. */
SUPINE_CLONES static bool resample_run(const resampling *work, size_t row, size_t begin,
                                       tally *sum) {
  const supine_image *from = work->from;
  const double line[2] = {(double)(row % from->size[1]), (double)(row / from->size[1])};
  const size_t first = row * from->size[0] + begin;
  const size_t left = from->size[0] - begin;
  const size_t count = left < RUN ? left : RUN;
  double at[3][RUN];
  double shift[3][RUN];
  double values[RUN];
  bool lung = false;
  cells nodes;
  cells in;
  find_nodes(from, row, begin, &work->inverse->nodes, &nodes);
  const bool moves = displace(&work->inverse->nodes, &nodes, shift);
  if (!moves && (work->tissue == NULL || !has_lung(work->tissue, first, count))) {
    const size_t size = supine_image_voxel_size(from->voxel);
    memcpy((char *)work->to->values + first * size, (const char *)from->values + first * size,
           count * size);
    return false;
  }
  for (size_t a = 0; a < 3; ++a) {
    for (size_t i = 0; i < RUN; ++i) {
      at[a][i] = (a == 0 ? (double)(begin + i) : line[a - 1]) + shift[0][i] * work->axes[0][a] +
                 shift[1][i] * work->axes[1][a] + shift[2][i] * work->axes[2][a];
    }
  }
  find_cells(from, at, &in);
  if (work->labels) {
    take_nearest(from, in, values);
  } else if (work->tissue != NULL) {
    lung = take_densities(work, &nodes, &in, at, count, values, sum);
  } else {
    interpolate(from, &in, values);
  }
  if (!work->sampling) {
    supine_image_put(work->to, first, count, values);
  }
  return lung;
}

/* Return whether a row is one of the SAMPLE-th part of all that stands for them: of a lattice
 * across the rows in which each has neighbours at about the same distance on all sides. */
static bool is_sample(const supine_image *image, size_t row) {
  return (row % image->size[1] + 3 * (row / image->size[1])) % SAMPLE == 0;
}

static void resample_rows(void *context, size_t begin, size_t end, size_t thread) {
  const resampling *work = context;
  const size_t runs = (work->from->size[0] + RUN - 1) / RUN;
  tally unused;
  tally *sum = work->sums != NULL ? &work->sums[thread] : &unused;
  for (size_t row = begin; row < end; ++row) {
    if (work->sampling && !is_sample(work->from, row)) {
      continue;
    }
    for (size_t i = 0; i < runs; ++i) {
      if (!work->again || work->lung[row * runs + i] != 0) {
        const bool lung = resample_run(work, row, RUN * i, sum);
        if (work->lung != NULL) {
          work->lung[row * runs + i] = lung ? 1 : 0;
        }
      }
    }
  }
}

/* Choose the scales anew so that each lung keeps its mass. Return whether one changes by more than
 * a thousandth. */
static bool correct_scales(resampling *work, size_t threads) {
  static const double enough = 1e-3;
  /* Bounds of the scale. It was 1.03 to 1.06 in trials with vessels, and is larger if much
   * consolidated lung is compressed; beyond, the image does not contain the whole lung. */
  static const double low = 0.8;
  static const double high = 1.25;
  const double parts = work->sampling ? SAMPLE : 1.0;
  bool changed = false;
  for (size_t lung = 0; lung < work->tissue->lungs; ++lung) {
    double mass = 0.0;
    double aerated = 0.0;
    for (size_t t = 0; t < threads; ++t) {
      mass += parts * (double)work->sums[t].mass[lung] / fixed;
      aerated += parts * (double)work->sums[t].aerated[lung] / fixed;
    }
    if (aerated > 0.0) {
      const double missing = (work->tissue->mass[lung] - mass) / aerated;
      const double next = fmin(fmax(work->scale[lung] * (1.0 + missing), low), high);
      changed = changed || fabs(next - work->scale[lung]) > enough;
      work->scale[lung] = next;
    }
  }
  return changed;
}

/* Resample an image of densities. A pass computes the lungs' masses, from which the scales of the
 * next follow. The first passes take a sample of the rows, until the scales have settled. */
static supine_status resample_densities(resampling *work, supine_error *error) {
  enum { PASSES = 3 };
  const size_t rows = work->from->size[1] * work->from->size[2];
  const size_t runs = (work->from->size[0] + RUN - 1) / RUN;
  const size_t threads = supine_thread_count();
  SUPINE_ARENA arena = {0};
  work->lung = supine_arena_zeros(&arena, rows * runs, 1);
  work->sums = supine_arena_take(&arena, threads, sizeof *work->sums);
  SUPINE_TRY(supine_arena_check(&arena, error, "an image of %zu rows", rows));
  for (size_t a = 0; a < 3; ++a) {
    work->bin[a] = supine_length(work->tissue->air.step[a]) / supine_length(work->from->step[a]);
  }
  for (int sampling = 1; sampling >= 0; --sampling) {
    work->sampling = sampling == 1;
    for (int pass = 0; pass < PASSES; ++pass) {
      memset(work->sums, 0, threads * sizeof *work->sums);
      work->again = pass > 0;
      supine_parallel_for(rows, 1, threads, resample_rows, work);
      if (!correct_scales(work, threads)) {
        break;
      }
    }
  }
  return SUPINE_OK;
}

supine_status supine_warp_resample(const supine_field *inverse, const supine_tissue *tissue,
                                   bool labels, const supine_image *image, supine_image *moved,
                                   supine_error *error) {
  const size_t count = supine_image_count(image);
  const bool densities = tissue != NULL && tissue->kind.values != NULL;
  resampling work = {.inverse = inverse,
                     .tissue = densities ? tissue : NULL,
                     .from = image,
                     .to = moved,
                     .labels = labels};
  supine_image steps = *image;
  memset(steps.origin, 0, sizeof steps.origin);
  for (size_t k = 0; k < 3; ++k) {
    supine_image_locate(&steps, (const double[]){k == 0, k == 1, k == 2}, work.axes[k]);
  }
  for (size_t lung = 0; lung < SUPINE_LUNGS_MAX; ++lung) {
    work.scale[lung] = 1.0;
  }
  *moved = *image;
  moved->values = malloc(count * supine_image_voxel_size(image->voxel));
  supine_status status = SUPINE_OK;
  if (moved->values == NULL) {
    status = supine_error_memory(error, "an image of %zu voxels", count);
  } else if (densities) {
    status = resample_densities(&work, error);
  } else {
    supine_parallel_for(image->size[1] * image->size[2], 1, 0, resample_rows, &work);
  }
  if (status != SUPINE_OK) {
    supine_image_free(moved);
  }
  return status;
}

bool supine_warp_is_hounsfield(const supine_image *image) {
  for (size_t i = 0; i < supine_image_count(image); ++i) {
    if (supine_image_get(image, i) < supine_warp_aerated) {
      return true;
    }
  }
  return false;
}

supine_status supine_warp_check_hounsfield(const supine_image *image, const char *path,
                                           supine_error *error) {
  const bool aerated = supine_warp_is_hounsfield(image);
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_omit("density")};
  SUPINE_REFUSE_ADVISE(
      !aerated, error, advice, SUPINE_ERROR_FORMAT,
      "%s: no voxel is below %g, so the image is not in Hounsfield units: convert it", path,
      supine_warp_aerated);
  return SUPINE_OK;
}
