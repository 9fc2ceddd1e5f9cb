/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Move an image by a displacement field: each voxel takes the value from where its tissue was. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/clones.h"
#include "base/parallel.h"
#include "base/vec3.h"

#include "precompute/warp/field.h"

/* Number of voxels of a row that are processed together, with vector instructions. */
enum { RUN = 128 };

/* Kinds of voxels when densities are scaled: 0 and 1 outside the lungs, LUNG and LUNG + 1 inside
 * them; odd ones are aerated. */
enum { LUNG = 2 };

#define INLINE static inline __attribute__((always_inline))

typedef struct resampling {
  const supine_field *inverse;
  const supine_image *depth; /* depth below the lungs' surface, mm; NULL: densities not scaled */
  supine_image kind;         /* kind of each voxel of `from`; for scaling densities */
  const supine_image *from;
  supine_image *to;
  bool labels;
} resampling;

/* For each of RUN points, the cell of an image that contains it. */
typedef struct cells {
  size_t first[RUN];    /* index of the first channel of the voxel at the cell's lowest corner */
  double share[3][RUN]; /* position of each point in its cell, 0 to 1 along each axis */
} cells;

/* Find the cells that contain points, mm. The operations and their order are those of
 * supine_field_find_cell, so that both give the same bits. */
INLINE void find_cells(const supine_image *image, double (*point)[RUN], cells *found) {
  const supine_image frame = *image; /* a local copy, so that stores cannot alias it */
  double at[3][RUN];
  double across[3];
  supine_cross(frame.step[1], frame.step[2], across);
  const double whole = supine_dot(frame.step[0], across);
  for (size_t i = 0; i < RUN; ++i) { /* Cramer's rule */
    const double from[3] = {point[0][i] - frame.origin[0], point[1][i] - frame.origin[1],
                            point[2][i] - frame.origin[2]};
    at[0][i] = supine_dot(from, across) / whole;
    at[1][i] = supine_triple(frame.step[0], from, frame.step[2]) / whole;
    at[2][i] = supine_triple(frame.step[0], frame.step[1], from) / whole;
  }
  for (size_t a = 0; a < 3; ++a) {
    const double last = (double)frame.size[a] - 1.0;
    const double top = last > 1.0 ? last - 1.0 : 0.0;
    for (size_t i = 0; i < RUN; ++i) {
      const double voxel = at[a][i] > 0.0 ? (at[a][i] < last ? at[a][i] : last) : 0.0;
      const double below = floor(voxel);
      at[a][i] = below < top ? below : top;
      found->share[a][i] = voxel - at[a][i];
    }
  }
  const double row = (double)frame.size[0];
  const double slice = row * (double)frame.size[1];
  for (size_t i = 0; i < RUN; ++i) {
    /* The sum is exact, as its terms are whole numbers. */
    found->first[i] = frame.channels * (size_t)(at[0][i] + row * at[1][i] + slice * at[2][i]);
  }
}

/* Compute the weights of the corners of each cell, and the offset of each corner's value from the
 * value of the lowest corner. On an axis of one voxel, the upper corner has weight 0. */
INLINE void weigh_corners(const supine_image *image, const cells *in, double (*weight)[RUN],
                          size_t *offset) {
  for (size_t corner = 0; corner < 8; ++corner) {
    size_t stride = image->channels;
    offset[corner] = 0;
    for (size_t a = 0; a < 3; ++a) {
      offset[corner] += (corner >> a & 1U) != 0 && image->size[a] > 1 ? stride : 0;
      stride *= image->size[a];
    }
    for (size_t i = 0; i < RUN; ++i) {
      weight[corner][i] = 1.0;
      for (size_t a = 0; a < 3; ++a) {
        weight[corner][i] *= (corner >> a & 1U) != 0 ? in->share[a][i] : 1.0 - in->share[a][i];
      }
    }
  }
}

/* Add to each point its displacement, mm. The operations and their order are those of
 * supine_field_interpolate, so that both give the same bits. */
INLINE void displace(const supine_image *nodes, const cells *in, double (*point)[RUN]) {
  double weight[8][RUN];
  size_t offset[8];
  weigh_corners(nodes, in, weight, offset);
  for (size_t i = 0; i < RUN; ++i) {
    const float *first = (const float *)nodes->values + in->first[i];
    double u[3] = {0.0, 0.0, 0.0};
    for (size_t corner = 0; corner < 8; ++corner) {
      for (size_t k = 0; k < 3; ++k) {
        u[k] += weight[corner][i] * (double)first[offset[corner] + k];
      }
    }
    for (size_t k = 0; k < 3; ++k) {
      point[k][i] += u[k];
    }
  }
}

/* Interpolate an image of one channel at points. */
INLINE void interpolate(const supine_image *image, const cells *in, double *values) {
  double weight[8][RUN];
  double value[RUN];
  size_t offset[8];
  weigh_corners(image, in, weight, offset);
  memset(values, 0, RUN * sizeof *values);
  for (size_t corner = 0; corner < 8; ++corner) {
    supine_image_gather(image, offset[corner], in->first, RUN, value);
    for (size_t i = 0; i < RUN; ++i) {
      values[i] += weight[corner][i] * value[i];
    }
  }
}

/* Take the value of the voxel nearest to each point. */
INLINE void take_nearest(const supine_image *image, cells in, double *values) {
  size_t stride = 1;
  for (size_t a = 0; a < 3; ++a) {
    for (size_t i = 0; i < RUN; ++i) {
      in.first[i] += in.share[a][i] > 0.5 ? stride : 0;
    }
    stride *= image->size[a];
  }
  supine_image_gather(image, 0, in.first, RUN, values);
}

/* Return the volume of the tissue at a voxel y before the motion, divided by its volume after it.
 * This is det(I + dv/dy) for the inverse field v; return 0 if the field folds at y. */
static double volume_ratio(const supine_image *nodes, const supine_image *image, size_t index) {
  double point[3];
  supine_field_cell cell;
  supine_image_place(image, index, point);
  supine_field_find_cell(nodes, point, &cell);
  return fmax(0.0, supine_field_stretch(nodes, &cell));
}

/* Interpolate densities, and multiply those inside the lungs by volume_ratio(). A point is
 * interpolated only from corners of its cell that are of the same kind as its nearest corner. The
 * chest wall thus adds no mass to the lungs, and vessels none to the tissue around them.
 * @param first  index of the first of the RUN voxels in the moved image */
INLINE void interpolate_density(const resampling *work, const cells *in, size_t first,
                                double *values) {
  double weight[8][RUN];
  double value[RUN];
  double nearest[RUN];
  double kind[RUN];
  double sum[RUN] = {0.0};
  size_t offset[8];
  weigh_corners(work->from, in, weight, offset);
  take_nearest(&work->kind, *in, nearest);
  memset(values, 0, RUN * sizeof *values);
  for (size_t corner = 0; corner < 8; ++corner) {
    supine_image_gather(work->from, offset[corner], in->first, RUN, value);
    supine_image_gather(&work->kind, offset[corner], in->first, RUN, kind);
    for (size_t i = 0; i < RUN; ++i) {
      const double part = kind[i] == nearest[i] ? weight[corner][i] : 0.0;
      values[i] += part * (value[i] + 1000.0);
      sum[i] += part;
    }
  }
  for (size_t i = 0; i < RUN; ++i) {
    const bool scaled = nearest[i] >= LUNG;
    values[i] = values[i] / sum[i] *
                    (scaled ? volume_ratio(&work->inverse->nodes, work->from, first + i) : 1.0) -
                1000.0;
  }
}

/* Find the kind of each voxel in the rows `begin` to `end` - 1. Smoothing of the surface, and the
 * nodes between which its depth is interpolated, displace it by up to the diagonal of a cell. This
 * close to the surface, the density of a voxel decides whether it belongs to the lungs. */
static void mark_rows(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const resampling *work = context;
  unsigned char *kind = work->kind.values;
  static const double air = -950.0; /* air outside the lungs is below this density, HU */
  double rim = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    rim += supine_length(work->depth->step[k]);
  }
  for (size_t i = begin * work->from->size[0]; i < end * work->from->size[0]; ++i) {
    supine_field_cell cell;
    double point[3];
    double depth;
    supine_image_place(work->from, i, point);
    supine_field_find_cell(work->depth, point, &cell);
    supine_field_interpolate(work->depth, &cell, &depth, NULL);
    const double value = supine_image_get(work->from, i);
    const bool aerated = value < supine_field_aerated;
    const bool near = depth > -rim && aerated && (depth > 0.0 || value > air);
    kind[i] = (unsigned char)((depth > rim || near ? LUNG : 0) + (aerated ? 1 : 0));
  }
}

/* Resample RUN voxels of a row from `begin` on; do not store voxels past the end of the row. */
SUPINE_CLONES static void resample_run(const resampling *work, size_t row, size_t begin) {
  const supine_image *from = work->from;
  const double at[2] = {(double)(row % from->size[1]), (double)(row / from->size[1])};
  const size_t left = from->size[0] - begin;
  double point[3][RUN];
  double values[RUN];
  cells in;
  for (size_t k = 0; k < 3; ++k) {
    const double step[3] = {from->step[0][k], from->step[1][k], from->step[2][k]};
    for (size_t i = 0; i < RUN; ++i) {
      point[k][i] =
          from->origin[k] + (double)(begin + i) * step[0] + at[0] * step[1] + at[1] * step[2];
    }
  }
  find_cells(&work->inverse->nodes, point, &in);
  displace(&work->inverse->nodes, &in, point);
  find_cells(from, point, &in);
  if (work->labels) {
    take_nearest(from, in, values);
  } else if (work->depth != NULL) {
    interpolate_density(work, &in, row * from->size[0] + begin, values);
  } else {
    interpolate(from, &in, values);
  }
  supine_image_put(work->to, row * from->size[0] + begin, left < RUN ? left : RUN, values);
}

static void resample_rows(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const resampling *work = context;
  for (size_t row = begin; row < end; ++row) {
    for (size_t i = 0; i < work->from->size[0]; i += RUN) {
      resample_run(work, row, i);
    }
  }
}

supine_status supine_field_resample(const supine_field *inverse, const supine_image *depth,
                                    bool labels, const supine_image *image, supine_image *moved,
                                    supine_error *error) {
  const size_t count = image->size[0] * image->size[1] * image->size[2];
  resampling work = {inverse, depth, *image, image, moved, labels};
  work.kind.voxel = SUPINE_VOXEL_U8;
  work.kind.values = depth == NULL ? NULL : malloc(count);
  *moved = *image;
  moved->values = malloc(count * supine_image_voxel_size(image->voxel));
  if (moved->values == NULL || (depth != NULL && work.kind.values == NULL)) {
    supine_image_free(moved);
    supine_image_free(&work.kind);
    return supine_error_memory(error, "an image of %zu voxels", count);
  }
  if (depth != NULL) {
    supine_parallel_for(image->size[1] * image->size[2], 1, 0, mark_rows, &work);
  }
  supine_parallel_for(image->size[1] * image->size[2], 1, 0, resample_rows, &work);
  supine_image_free(&work.kind);
  return SUPINE_OK;
}

supine_status supine_field_check_hounsfield(const supine_image *image, const char *path,
                                            supine_error *error) {
  double least = INFINITY;
  for (size_t i = 0; i < image->size[0] * image->size[1] * image->size[2]; ++i) {
    least = fmin(least, supine_image_get(image, i));
  }
  return least < supine_field_aerated
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%s: no voxel is below %g, so the image is not in "
                                "Hounsfield units: convert it, or leave --density out",
                                path, supine_field_aerated);
}
