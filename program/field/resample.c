/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Images moved by a field: each voxel is taken from where its tissue was. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/clones.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"

#include "program/field/field.h"

/* Voxels of a row that go through each step together, in vector units. */
enum { RUN = 128 };

#define INLINE static inline __attribute__((always_inline))

typedef struct resampling {
  const supine_field *inverse;
  const supine_image *from;
  supine_image *to;
  bool labels;
} resampling;

/* The cells of a run of points: the first number of each one's first voxel, and by axis how far in
 * the point lies, 0 to 1. */
typedef struct cells {
  size_t first[RUN];
  double share[3][RUN];
} cells;

/* Find the cells of points, mm: the operations of supine_field_find_cell in the same order. */
INLINE void find_cells(const supine_image *image, double (*point)[RUN], cells *found) {
  const supine_image frame = *image; /* which no store below can change */
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
    found->first[i] =
        frame.channels * (size_t)(at[0][i] + row * at[1][i] + slice * at[2][i]); /* exact */
  }
}

/* Weights of the cells' corners, and where each corner's first number lies behind the cell's. */
INLINE void weigh_corners(const supine_image *image, const cells *in, double (*weight)[RUN],
                          size_t *behind) {
  for (size_t corner = 0; corner < 8; ++corner) {
    size_t stride = image->channels;
    behind[corner] = 0;
    for (size_t a = 0; a < 3; ++a) { /* where there is one slice, the next one's weight is 0 */
      behind[corner] += (corner >> a & 1U) != 0 && image->size[a] > 1 ? stride : 0;
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

/* Add the displacements there to points: the operations of supine_field_interpolate in its order.
 */
INLINE void displace(const supine_image *nodes, const cells *in, double (*point)[RUN]) {
  double weight[8][RUN];
  size_t behind[8];
  weigh_corners(nodes, in, weight, behind);
  for (size_t i = 0; i < RUN; ++i) {
    const float *first = (const float *)nodes->values + in->first[i];
    double u[3] = {0.0, 0.0, 0.0};
    for (size_t corner = 0; corner < 8; ++corner) {
      for (size_t k = 0; k < 3; ++k) {
        u[k] += weight[corner][i] * (double)first[behind[corner] + k];
      }
    }
    for (size_t k = 0; k < 3; ++k) {
      point[k][i] += u[k];
    }
  }
}

/* The values of an image there, likewise. */
INLINE void interpolate(const supine_image *image, const cells *in, double *values) {
  double weight[8][RUN];
  double value[RUN];
  size_t behind[8];
  weigh_corners(image, in, weight, behind);
  memset(values, 0, RUN * sizeof *values);
  for (size_t corner = 0; corner < 8; ++corner) {
    supine_image_gather(image, behind[corner], in->first, RUN, value);
    for (size_t i = 0; i < RUN; ++i) {
      values[i] += weight[corner][i] * value[i];
    }
  }
}

/* Take the nearest voxels: labels have no means. */
INLINE void take_nearest(const supine_image *image, cells *in, double *values) {
  size_t stride = 1;
  for (size_t a = 0; a < 3; ++a) {
    for (size_t i = 0; i < RUN; ++i) {
      in->first[i] += in->share[a][i] > 0.5 ? stride : 0; /* as rint has it */
    }
    stride *= image->size[a];
  }
  supine_image_gather(image, 0, in->first, RUN, values);
}

/* Resample voxels `begin` to begin + RUN of a row; those past its end are not stored. */
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
    take_nearest(from, &in, values);
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

supine_status supine_field_resample(const supine_field *inverse, bool labels, supine_image *image,
                                    supine_error *error) {
  const size_t count = image->size[0] * image->size[1] * image->size[2];
  supine_image moved = *image;
  moved.values = malloc(count * supine_image_voxel_size(image->voxel));
  if (moved.values == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for an image of %zu voxels",
                            count);
  }
  resampling work = {inverse, image, &moved, labels};
  supine_parallel_for(image->size[1] * image->size[2], 1, 0, resample_rows, &work);
  free(image->values);
  image->values = moved.values;
  return SUPINE_OK;
}
