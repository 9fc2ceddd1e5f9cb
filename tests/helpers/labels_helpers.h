/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Synthetic label maps: a voxelised phantom and two ellipsoids. */
#ifndef SUPINE_LABELS_HELPERS_H
#define SUPINE_LABELS_HELPERS_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "mesh/image/image.h"
#include "mesh/mesh.h"

/* largest number of times that a straight line crosses one surface */
enum { HELPER_CROSSINGS = 32 };

/* Return an image of zeros that covers a mesh, with margins of unequal width. The image axes are
 * LPS, and voxels have the sides `spacing`, mm. */
static inline supine_image helper_image_over(const supine_mesh *mesh, const double spacing[3]) {
  supine_image image = {.voxel = SUPINE_VOXEL_U8, .channels = 1};
  double low[3];
  double high[3];
  supine_mesh_box(mesh, low, high);
  for (int a = 0; a < 3; ++a) {
    image.origin[a] = low[a] - (2.37 + 0.11 * a) * spacing[a];
    image.step[a][a] = spacing[a];
    image.size[a] = (size_t)((high[a] - image.origin[a]) / spacing[a]) + 4;
  }
  image.values = calloc(image.size[0] * image.size[1] * image.size[2], 1);
  return image;
}

static inline int helper_compare_doubles(const void *a, const void *b) {
  const double x = *(const double *)a;
  const double y = *(const double *)b;
  return (x > y) - (x < y);
}

/* Return the x at which the line parallel to the x axis through (y, z) crosses the triangle p, q,
 * r, or NAN if the line misses the triangle. */
static inline double helper_crossing(const double *p, const double *q, const double *r, double y,
                                     double z) {
  const double whole = (q[1] - p[1]) * (r[2] - p[2]) - (r[1] - p[1]) * (q[2] - p[2]);
  const double v = ((y - p[1]) * (r[2] - p[2]) - (r[1] - p[1]) * (z - p[2])) / whole;
  const double w = ((q[1] - p[1]) * (z - p[2]) - (y - p[1]) * (q[2] - p[2])) / whole;
  return v >= 0.0 && w >= 0.0 && v + w <= 1.0 ? p[0] + v * (q[0] - p[0]) + w * (r[0] - p[0]) : NAN;
}

/* Set all voxels whose centres are inside the surface of triangles begin <= t < end to `label`. The
 * image must have 8-bit voxels and LPS axes. */
static inline void helper_voxelise(const supine_mesh *mesh, size_t begin, size_t end, uint8_t label,
                                   supine_image *image) {
  const size_t rows = image->size[1] * image->size[2];
  double(*at)[HELPER_CROSSINGS] = malloc(rows * sizeof *at);
  size_t *count = calloc(rows, sizeof *count);
  for (size_t t = begin; t < end; ++t) {
    const double *corner[3];
    double low[2] = {INFINITY, INFINITY};
    double high[2] = {-INFINITY, -INFINITY};
    for (int c = 0; c < 3; ++c) {
      corner[c] = mesh->vertices + 3 * (size_t)mesh->triangles[3 * t + (size_t)c];
      for (int a = 0; a < 2; ++a) {
        const double voxel = (corner[c][a + 1] - image->origin[a + 1]) / image->step[a + 1][a + 1];
        low[a] = fmin(low[a], voxel);
        high[a] = fmax(high[a], voxel);
      }
    }
    for (size_t k = (size_t)ceil(low[1]); (double)k <= high[1]; ++k) {
      for (size_t j = (size_t)ceil(low[0]); (double)j <= high[0]; ++j) {
        const size_t row = j + image->size[1] * k;
        const double x = helper_crossing(corner[0], corner[1], corner[2],
                                         image->origin[1] + (double)j * image->step[1][1],
                                         image->origin[2] + (double)k * image->step[2][2]);
        if (!isnan(x) && count[row] < HELPER_CROSSINGS) {
          at[row][count[row]++] = (x - image->origin[0]) / image->step[0][0];
        }
      }
    }
  }
  for (size_t row = 0; row < rows; ++row) {
    qsort(at[row], count[row], sizeof(double), helper_compare_doubles);
    for (size_t c = 0; c + 1 < count[row]; c += 2) {
      for (size_t i = (size_t)ceil(at[row][c]); (double)i < at[row][c + 1]; ++i) {
        ((uint8_t *)image->values)[row * image->size[0] + i] = label;
      }
    }
  }
  free(at);
  free(count);
}

/* Return a label map of two ellipsoids side by side, with LPS axes and voxels with sides of
 * `spacing` mm. Label 1 is the right lung and label 2 the left lung, like in maps by lungmask. The
 * right ellipsoid is larger. Towards the feet, both ellipsoids become wider and lie further
 * back. */
static inline supine_image helper_two_lungs(double spacing) {
  const double size[3] = {280.0, 180.0, 240.0};
  supine_image image = {.voxel = SUPINE_VOXEL_U8, .channels = 1};
  for (int a = 0; a < 3; ++a) {
    image.origin[a] = -0.5 * size[a] + 1.7;
    image.step[a][a] = spacing;
    image.size[a] = (size_t)(size[a] / spacing);
  }
  uint8_t *at = calloc(image.size[0] * image.size[1] * image.size[2], 1);
  image.values = at;
  for (size_t i = 0; i < image.size[0] * image.size[1] * image.size[2]; ++i) {
    const size_t index[3] = {i % image.size[0], i / image.size[0] % image.size[1],
                             i / image.size[0] / image.size[1]};
    double p[3];
    for (int a = 0; a < 3; ++a) {
      p[a] = image.origin[a] + (double)index[a] * spacing;
    }
    const double half = p[0] < 0.0 ? 58.0 : 53.0;
    const double relative_width = 1.0 - 0.2 * p[2] / 100.0;
    const double x = (fabs(p[0]) - 66.0) / (half * relative_width);
    const double y = (p[1] + 0.25 * p[2]) / 60.0;
    const double z = p[2] / 100.0;
    at[i] = x * x + y * y + z * z < 1.0 ? (p[0] < 0.0 ? 1 : 2) : 0;
  }
  return image;
}

#endif
