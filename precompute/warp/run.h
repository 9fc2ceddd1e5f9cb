/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Internal: process runs of voxels of a row together, with vector instructions. */
#ifndef SUPINE_WARP_RUN_H
#define SUPINE_WARP_RUN_H

#include <math.h>
#include <string.h>

#include "mesh/image/image.h"

/* Number of voxels of a row that are processed together. */
enum { RUN = 128 };

#define INLINE static inline __attribute__((always_inline))

/* For each of RUN points, the cell of an image that contains it. */
typedef struct cells {
  size_t first[RUN];    /* index of the first channel of the voxel at the cell's lowest corner */
  double share[3][RUN]; /* position of each point in its cell, 0 to 1 along each axis */
} cells;

/* Find the cells that contain points, given in voxels. */
INLINE void find_cells(const supine_image *image, double (*at)[RUN], cells *found) {
  const supine_image frame = *image; /* a local copy, so that stores cannot alias it */
  for (size_t a = 0; a < 3; ++a) {
    const double last = (double)frame.size[a] - 1.0;
    const double top = last > 1.0 ? last - 1.0 : 0.0;
    for (size_t i = 0; i < RUN; ++i) {
      const double above = at[a][i] > 0.0 ? at[a][i] : 0.0; /* NaN becomes 0 */
      const double voxel = above < last ? above : last;
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

/* Find the nodes around RUN voxels of a row of `from`, which are evenly spaced. */
INLINE void find_nodes(const supine_image *from, size_t row, size_t begin,
                       const supine_image *nodes, cells *found) {
  double at[3][RUN];
  double point[3];
  double start[3];
  double next[3];
  supine_image_place(from, row * from->size[0] + begin, point);
  supine_image_locate(nodes, point, start);
  for (size_t k = 0; k < 3; ++k) {
    point[k] += from->step[0][k];
  }
  supine_image_locate(nodes, point, next);
  for (size_t a = 0; a < 3; ++a) {
    for (size_t i = 0; i < RUN; ++i) {
      at[a][i] = start[a] + (double)i * (next[a] - start[a]);
    }
  }
  find_cells(nodes, at, found);
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

#endif
