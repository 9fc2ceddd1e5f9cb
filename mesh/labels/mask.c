/* SPDX-License-Identifier: MIT */
/* Count the voxels of each label in an image, and cut boxes of voxels out of images and masks. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "mesh/labels/mask.h"

size_t supine_labels_mask_count(const labels_mask *mask) {
  return mask->size[0] * mask->size[1] * mask->size[2];
}

double supine_labels_voxel_ml(const labels_mask *mask) {
  return 1e-3 * fabs(supine_triple(mask->step[0], mask->step[1], mask->step[2]));
}

void supine_labels_mask_place(const labels_mask *mask, const double voxel[3], double place[3]) {
  for (int k = 0; k < 3; ++k) {
    place[k] = mask->origin[k] + voxel[0] * mask->step[0][k] + voxel[1] * mask->step[1][k] +
               voxel[2] * mask->step[2][k];
  }
}

static const double label_error = 1e-3; /* of a probability that is 0 or 1 but for rounding */

static bool is_label(double value) {
  const double nearest = fmin(LABELS_MAX - 1.0, fmax(0.0, rint(value)));
  return supine_input_judge(SUPINE_INPUT_LABEL_VALUE, fabs(value - nearest)) == SUPINE_INPUT_TAKEN;
}

typedef struct voxels {
  bool labels;        /* whether every voxel is a label */
  bool probabilities; /* whether every voxel is a number from 0 to 1 */
  double other;       /* value of the first voxel that is not a label */
} voxels;

static voxels inspect(const supine_image *image) {
  voxels found = {.labels = true, .probabilities = true};
  for (size_t i = 0; i < supine_image_count(image); ++i) {
    const double value = supine_image_get(image, i);
    if (!is_label(value)) {
      found.other = found.labels ? value : found.other;
      found.labels = false;
    }
    found.probabilities =
        found.probabilities && value >= -label_error && value <= 1.0 + label_error;
  }
  return found;
}

supine_status supine_labels_settle(const char *path, supine_image *image, supine_error *error) {
  static const double threshold = 0.5;
  if (image->voxel == SUPINE_VOXEL_U8 || image->voxel == SUPINE_VOXEL_U16) {
    return SUPINE_OK;
  }
  const voxels found = inspect(image);
  SUPINE_REFUSE_IF(!found.labels && !found.probabilities, error, SUPINE_ERROR_FORMAT,
                   found.other < 0.0
                       ? "%s: a voxel holds %g, but labels are 0 to 65535: if this is the CT "
                         "itself, segment it first"
                       : "%s: a voxel holds %g, but labels are whole numbers, 0 to 65535, and "
                         "probabilities are 0 to 1: give labels or a mask",
                   path, found.other);
  if (image->voxel != SUPINE_VOXEL_F32 && image->voxel != SUPINE_VOXEL_F64) {
    return SUPINE_OK;
  }
  for (size_t i = 0; i < supine_image_count(image); ++i) {
    const double value = supine_image_get(image, i);
    const double share = value >= threshold ? 1.0 : 0.0;
    const double label = found.labels ? rint(value) : share;
    supine_image_put(image, i, 1, &label);
  }
  return SUPINE_OK;
}

/* Read the labels of a row. */
static void read_row(const supine_image *image, size_t row, uint16_t *labels) {
  const size_t size = image->size[0];
  for (size_t i = 0; i < size; ++i) {
    labels[i] = (uint16_t)supine_image_get(image, row * size + i);
  }
}

/* Add the voxels of one row to the tallies of their labels. */
static void count_row(const supine_image *image, size_t row, const uint16_t *labels,
                      labels_tally *tally) {
  const size_t size = image->size[0];
  const size_t place[3] = {0, row % image->size[1], row / image->size[1]};
  for (size_t i = 0; i < size;) {
    const size_t begin = i;
    while (i < size && labels[i] == labels[begin]) {
      ++i;
    }
    labels_tally *t = &tally[labels[begin]];
    const size_t from[3] = {begin, place[1], place[2]};
    const size_t to[3] = {i - 1, place[1], place[2]};
    const uint64_t length = i - begin;
    for (int a = 0; a < 3; ++a) {
      t->low[a] = t->count == 0 || from[a] < t->low[a] ? from[a] : t->low[a];
      t->high[a] = t->count == 0 || to[a] > t->high[a] ? to[a] : t->high[a];
      t->sum[a] += a == 0 ? length * (begin + i - 1) / 2 : length * place[a];
    }
    t->count += length;
  }
}

supine_status supine_labels_count(const char *path, const supine_image *image, labels_tally *tally,
                                  supine_error *error) {
  SUPINE_ARENA arena = {0};
  uint16_t *labels = supine_arena_take(&arena, image->size[0], sizeof *labels);
  SUPINE_TRY(supine_arena_status(&arena));
  memset(tally, 0, LABELS_MAX * sizeof *tally);
  for (size_t row = 0; row < image->size[1] * image->size[2]; ++row) {
    read_row(image, row, labels);
    count_row(image, row, labels, tally);
  }
  const size_t count = supine_image_count(image);
  SUPINE_REFUSE_IF(tally[0].count == count, error, SUPINE_ERROR_MESH,
                   "%s: every voxel is 0: give an image with labels", path);
  return SUPINE_OK;
}

supine_status supine_labels_mask_cut(const supine_image *image, const size_t low[3],
                                     const size_t high[3], size_t margin, const uint8_t *value,
                                     labels_mask *mask) {
  SUPINE_ARENA arena = {0};
  uint16_t *row = supine_arena_take(&arena, image->size[0], sizeof *row);
  *mask = (labels_mask){.at = NULL};
  for (int k = 0; k < 3; ++k) {
    mask->origin[k] = image->origin[k];
    for (int a = 0; a < 3; ++a) {
      mask->origin[k] += ((double)low[a] - (double)margin) * image->step[a][k];
    }
  }
  for (int a = 0; a < 3; ++a) {
    mask->size[a] = high[a] - low[a] + 1 + 2 * margin;
    mask->from[a] = (long)low[a] - (long)margin;
    mask->spacing[a] = supine_length(image->step[a]);
    memcpy(mask->step[a], image->step[a], sizeof mask->step[a]);
  }
  mask->at = calloc(supine_labels_mask_count(mask), 1);
  if (arena.failed || mask->at == NULL) {
    supine_labels_mask_free(mask);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t k = low[2]; k <= high[2]; ++k) {
    for (size_t j = low[1]; j <= high[1]; ++j) {
      read_row(image, j + image->size[1] * k, row);
      uint8_t *out = mask->at + margin +
                     mask->size[0] * (j - low[1] + margin + mask->size[1] * (k - low[2] + margin));
      for (size_t i = low[0]; i <= high[0]; ++i) {
        out[i - low[0]] = value[row[i]];
      }
    }
  }
  return SUPINE_OK;
}

supine_status supine_labels_mask_extract(const labels_mask *from, uint8_t value, size_t margin,
                                         labels_mask *mask) {
  uint8_t kept[UINT8_MAX + 1] = {0};
  supine_image image = {.voxel = SUPINE_VOXEL_U8, .values = from->at};
  SUPINE_ARENA arena = {0};
  labels_tally *tally = supine_arena_take(&arena, LABELS_MAX, sizeof *tally);
  *mask = (labels_mask){.at = NULL};
  SUPINE_TRY(supine_arena_status(&arena));
  memcpy(image.size, from->size, sizeof image.size);
  memcpy(image.origin, from->origin, sizeof image.origin);
  memcpy(image.step, from->step, sizeof image.step);
  SUPINE_TRY(supine_labels_count("", &image, tally, NULL));
  kept[value] = 1;
  return tally[value].count > 0 ? supine_labels_mask_cut(&image, tally[value].low,
                                                         tally[value].high, margin, kept, mask)
                                : SUPINE_OK;
}

void supine_labels_mask_free(labels_mask *mask) {
  free(mask->at);
  mask->at = NULL;
}
