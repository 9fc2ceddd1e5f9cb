/* SPDX-License-Identifier: MIT */
/* Access an image in memory: get and set voxels, and convert positions between voxels and mm. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/clones.h"
#include "base/vec3.h"

#include "mesh/image/image_formats.h"

void supine_image_free(supine_image *image) {
  free(image->values);
  *image = (supine_image){0};
}

size_t supine_image_voxel_size(supine_image_voxel voxel) {
  static const size_t sizes[SUPINE_VOXEL_COUNT] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[voxel];
}

size_t supine_image_bytes(const supine_image *image) {
  return supine_image_count(image) * image->channels * supine_image_voxel_size(image->voxel);
}

double supine_image_get(const supine_image *image, size_t index) {
  double value = 0.0;
  supine_image_gather(image, index, &(size_t){0}, 1, &value);
  return value;
}

#define GATHER(type)                                                                               \
  for (size_t i = 0; i < count; ++i) {                                                             \
    values[i] = (double)((const type *)image->values)[from + index[i]];                            \
  }                                                                                                \
  break

SUPINE_CLONES void supine_image_gather(const supine_image *image, size_t from, const size_t *index,
                                       size_t count, double *restrict values) {
  switch (image->voxel) {
  case SUPINE_VOXEL_I8:
    GATHER(int8_t);
  case SUPINE_VOXEL_U8:
    GATHER(uint8_t);
  case SUPINE_VOXEL_I16:
    GATHER(int16_t);
  case SUPINE_VOXEL_U16:
    GATHER(uint16_t);
  case SUPINE_VOXEL_I32:
    GATHER(int32_t);
  case SUPINE_VOXEL_U32:
    GATHER(uint32_t);
  case SUPINE_VOXEL_F32:
    GATHER(float);
  case SUPINE_VOXEL_F64:
  case SUPINE_VOXEL_COUNT:
    GATHER(double);
  }
}

static double clip(double value, double low, double high) {
  const double whole = rint(value);
  if (!(whole > low)) { /* also NaN */
    return low;
  }
  return whole < high ? whole : high;
}

#define PUT(type, number)                                                                          \
  for (size_t i = 0; i < count; ++i) {                                                             \
    ((type *)image->values)[begin + i] = (type)(number);                                           \
  }                                                                                                \
  break

SUPINE_CLONES void supine_image_put(supine_image *image, size_t begin, size_t count,
                                    const double *restrict values) {
  switch (image->voxel) {
  case SUPINE_VOXEL_I8:
    PUT(int8_t, clip(values[i], INT8_MIN, INT8_MAX));
  case SUPINE_VOXEL_U8:
    PUT(uint8_t, clip(values[i], 0, UINT8_MAX));
  case SUPINE_VOXEL_I16:
    PUT(int16_t, clip(values[i], INT16_MIN, INT16_MAX));
  case SUPINE_VOXEL_U16:
    PUT(uint16_t, clip(values[i], 0, UINT16_MAX));
  case SUPINE_VOXEL_I32:
    PUT(int32_t, clip(values[i], INT32_MIN, INT32_MAX));
  case SUPINE_VOXEL_U32:
    PUT(uint32_t, clip(values[i], 0, UINT32_MAX));
  case SUPINE_VOXEL_F32:
    PUT(float, values[i]);
  case SUPINE_VOXEL_F64:
  case SUPINE_VOXEL_COUNT:
    PUT(double, values[i]);
  }
}

void supine_image_set_axes(supine_image *image, supine_axes axes) {
  if (axes == SUPINE_AXES_AUTO) {
    return;
  }
  double from[3][3];
  double *vectors[4] = {image->step[0], image->step[1], image->step[2], image->origin};
  supine_mesh_axes_matrix(image->axes, from);
  for (int v = 0; v < 4; ++v) {
    const double p[3] = {vectors[v][0], vectors[v][1], vectors[v][2]};
    for (int k = 0; k < 3; ++k) {
      vectors[v][k] = from[0][k] * p[0] + from[1][k] * p[1] + from[2][k] * p[2];
    }
    supine_mesh_axes_apply(axes, 1.0, vectors[v]);
  }
  image->axes = axes;
}

void supine_image_place(const supine_image *image, size_t index, double point[3]) {
  const double at[3] = {(double)(index % image->size[0]),
                        (double)(index / image->size[0] % image->size[1]),
                        (double)(index / image->size[0] / image->size[1])};
  for (int k = 0; k < 3; ++k) {
    point[k] = image->origin[k] + at[0] * image->step[0][k] + at[1] * image->step[1][k] +
               at[2] * image->step[2][k];
  }
}

double supine_image_plane_distance(const supine_image *image, size_t axis) {
  double normal[3];
  supine_cross(image->step[(axis + 1) % 3], image->step[(axis + 2) % 3], normal);
  return fabs(supine_dot(image->step[axis], normal)) / supine_length(normal);
}

bool supine_image_same_grid(const supine_image *a, const supine_image *b) {
  if (memcmp(a->size, b->size, sizeof a->size) != 0) {
    return false;
  }
  for (size_t corner = 0; corner < 8; ++corner) {
    const size_t at[3] = {(corner & 1U) * (a->size[0] - 1), (corner >> 1 & 1U) * (a->size[1] - 1),
                          (corner >> 2) * (a->size[2] - 1)};
    double place[3];
    double voxel[3];
    supine_image_place(b, at[0] + a->size[0] * (at[1] + a->size[1] * at[2]), place);
    supine_image_locate(a, place, voxel);
    for (int x = 0; x < 3; ++x) {
      if (fabs(voxel[x] - (double)at[x]) > 0.01) {
        return false;
      }
    }
  }
  return true;
}

double supine_image_cell_diagonal(const supine_image *image) {
  double longest = 0.0;
  for (unsigned signs = 0; signs < 4; ++signs) {
    double diagonal[3];
    for (size_t k = 0; k < 3; ++k) {
      diagonal[k] = image->step[0][k] + (signs & 1U ? -1.0 : 1.0) * image->step[1][k] +
                    (signs & 2U ? -1.0 : 1.0) * image->step[2][k];
    }
    longest = fmax(longest, supine_length(diagonal));
  }
  return longest;
}

bool supine_image_is_left_handed(const supine_image *image) {
  return supine_triple(image->step[0], image->step[1], image->step[2]) < 0.0;
}

static void swap_bytes(unsigned char *a, unsigned char *b, size_t size) {
  for (size_t k = 0; k < size; ++k) {
    const unsigned char kept = a[k];
    a[k] = b[k];
    b[k] = kept;
  }
}

void supine_image_reverse(supine_image *image, size_t axis) {
  const size_t each = image->channels * supine_image_voxel_size(image->voxel);
  const size_t last = image->size[axis] - 1;
  size_t stride = 1;
  for (size_t a = 0; a < axis; ++a) {
    stride *= image->size[a];
  }
  for (size_t k = 0; k < 3; ++k) {
    image->origin[k] += (double)last * image->step[axis][k];
    image->step[axis][k] = -image->step[axis][k];
  }
  if (image->values == NULL) {
    return;
  }
  unsigned char *bytes = image->values;
  for (size_t i = 0; i < supine_image_count(image); ++i) {
    const size_t at = i / stride % image->size[axis];
    if (2 * at < last) {
      swap_bytes(bytes + i * each, bytes + (i + (last - 2 * at) * stride) * each, each);
    }
  }
}

void supine_image_locate(const supine_image *image, const double point[3], double voxel[3]) {
  const double whole = supine_triple(image->step[0], image->step[1], image->step[2]);
  double from[3];
  for (int k = 0; k < 3; ++k) {
    from[k] = point[k] - image->origin[k];
  }
  for (int a = 0; a < 3; ++a) { /* solve for voxel[a] by Cramer's rule */
    double replaced[3][3];
    memcpy(replaced, image->step, sizeof replaced);
    memcpy(replaced[a], from, sizeof from);
    voxel[a] = supine_triple(replaced[0], replaced[1], replaced[2]) / whole;
  }
}
