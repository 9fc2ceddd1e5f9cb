/* SPDX-License-Identifier: MIT */
/* Extract boxes of voxels from masks and images. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/vec3.h"

#include "mesh/labels/mask.h"

size_t supine_labels_mask_count(const labels_mask *mask) {
  return mask->size[0] * mask->size[1] * mask->size[2];
}

double supine_labels_voxel_ml(const labels_mask *mask) {
  const double *u = mask->step[0];
  const double *v = mask->step[1];
  const double *w = mask->step[2];
  return 1e-3 * fabs(u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) +
                     u[2] * (v[0] * w[1] - v[1] * w[0]));
}

void supine_labels_mask_place(const labels_mask *mask, const double voxel[3], double place[3]) {
  for (int k = 0; k < 3; ++k) {
    place[k] = mask->origin[k] + voxel[0] * mask->step[0][k] + voxel[1] * mask->step[1][k] +
               voxel[2] * mask->step[2][k];
  }
}

/* Find the box of a value; false if it is absent. */
static bool box_of(const labels_mask *mask, uint8_t value, size_t low[3], size_t high[3]) {
  bool any = false;
  for (size_t row = 0; row < mask->size[1] * mask->size[2]; ++row) {
    const uint8_t *at = mask->at + row * mask->size[0];
    const uint8_t *first = memchr(at, value, mask->size[0]);
    if (first == NULL) {
      continue;
    }
    const uint8_t *last = memrchr(at, value, mask->size[0]);
    const size_t from[3] = {(size_t)(first - at), row % mask->size[1], row / mask->size[1]};
    const size_t to[3] = {(size_t)(last - at), from[1], from[2]};
    for (int a = 0; a < 3; ++a) {
      low[a] = !any || from[a] < low[a] ? from[a] : low[a];
      high[a] = !any || to[a] > high[a] ? to[a] : high[a];
    }
    any = true;
  }
  return any;
}

supine_status supine_labels_mask_extract(const labels_mask *from, uint8_t value, size_t margin,
                                         labels_mask *mask) {
  size_t low[3];
  size_t high[3];
  *mask = *from;
  mask->at = NULL;
  if (!box_of(from, value, low, high)) {
    return SUPINE_OK;
  }
  double voxel[3];
  for (int a = 0; a < 3; ++a) {
    mask->size[a] = high[a] - low[a] + 1 + 2 * margin;
    voxel[a] = (double)low[a] - (double)margin;
  }
  supine_labels_mask_place(from, voxel, mask->origin);
  mask->at = calloc(supine_labels_mask_count(mask), 1);
  if (mask->at == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t k = low[2]; k <= high[2]; ++k) {
    for (size_t j = low[1]; j <= high[1]; ++j) {
      const uint8_t *row = from->at + from->size[0] * (j + from->size[1] * k) + low[0];
      uint8_t *out = mask->at + margin +
                     mask->size[0] * (j - low[1] + margin + mask->size[1] * (k - low[2] + margin));
      for (size_t i = 0; i <= high[0] - low[0]; ++i) {
        out[i] = row[i] == value;
      }
    }
  }
  return SUPINE_OK;
}

void supine_labels_mask_offset(const labels_mask *mask, const labels_mask *other, long offset[3]) {
  supine_image frame = {.channels = 1};
  double voxel[3];
  memcpy(frame.origin, other->origin, sizeof frame.origin);
  memcpy(frame.step, other->step, sizeof frame.step);
  supine_image_locate(&frame, mask->origin, voxel);
  for (int a = 0; a < 3; ++a) {
    offset[a] = lround(voxel[a]);
  }
}

supine_status supine_labels_mask_cut(const supine_image *image, const size_t low[3],
                                     const size_t high[3], const uint8_t *value,
                                     labels_mask *mask) {
  uint16_t *row = malloc(image->size[0] * sizeof *row);
  *mask = (labels_mask){.at = NULL};
  for (int k = 0; k < 3; ++k) {
    mask->origin[k] = image->origin[k];
    for (int a = 0; a < 3; ++a) {
      mask->origin[k] += ((double)low[a] - LABELS_MARGIN) * image->step[a][k];
    }
  }
  for (int a = 0; a < 3; ++a) {
    mask->size[a] = high[a] - low[a] + 1 + (size_t)2 * LABELS_MARGIN;
    mask->spacing[a] = supine_length(image->step[a]);
    memcpy(mask->step[a], image->step[a], sizeof mask->step[a]);
  }
  mask->at = calloc(supine_labels_mask_count(mask), 1);
  if (row == NULL || mask->at == NULL) {
    free(row);
    supine_labels_mask_free(mask);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t k = low[2]; k <= high[2]; ++k) {
    for (size_t j = low[1]; j <= high[1]; ++j) {
      double bad;
      (void)supine_labels_row(image, j + image->size[1] * k, row, &bad); /* read before */
      uint8_t *out = mask->at + LABELS_MARGIN +
                     mask->size[0] * (j - low[1] + LABELS_MARGIN +
                                      mask->size[1] * (k - low[2] + LABELS_MARGIN));
      for (size_t i = low[0]; i <= high[0]; ++i) {
        out[i - low[0]] = value[row[i]];
      }
    }
  }
  free(row);
  return SUPINE_OK;
}

void supine_labels_mask_free(labels_mask *mask) {
  free(mask->at);
  mask->at = NULL;
}
