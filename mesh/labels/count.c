/* SPDX-License-Identifier: MIT */
/* Count the voxels of each label in an image. */
#include <math.h>
#include <stdlib.h>

#include "mesh/labels/mask.h"

bool supine_labels_row(const supine_image *image, size_t row, uint16_t *labels, double *bad) {
  const size_t size = image->size[0];
  for (size_t i = 0; i < size; ++i) {
    const double value = supine_image_get(image, row * size + i);
    if (!(value >= 0.0 && value < (double)LABELS_MAX) || value != floor(value)) {
      *bad = value;
      return false;
    }
    labels[i] = (uint16_t)value;
  }
  return true;
}

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
      t->low[a] = t->count == 0 || from[a] < t->low[a] ? (uint32_t)from[a] : t->low[a];
      t->high[a] = t->count == 0 || to[a] > t->high[a] ? (uint32_t)to[a] : t->high[a];
      t->sum[a] += a == 0 ? length * (begin + i - 1) / 2 : length * place[a];
    }
    t->count += length;
  }
}

supine_status supine_labels_count(const char *path, const supine_image *image, labels_tally *tally,
                                  supine_error *error) {
  uint16_t *labels = malloc(image->size[0] * sizeof *labels);
  if (labels == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
  }
  for (size_t i = 0; i < LABELS_MAX; ++i) {
    tally[i] = (labels_tally){0};
  }
  double bad = 0.0;
  bool well = true;
  for (size_t row = 0; row < image->size[1] * image->size[2] && well; ++row) {
    well = supine_labels_row(image, row, labels, &bad);
    if (well) {
      count_row(image, row, labels, tally);
    }
  }
  free(labels);
  if (well) {
    return SUPINE_OK;
  }
  return supine_error_set(error, SUPINE_ERROR_FORMAT,
                          bad < 0.0 ? "%s: a voxel holds %g, but labels are 0 to 65535: if this is "
                                      "the CT itself, segment it first"
                                    : "%s: a voxel holds %g, but labels are whole numbers, 0 to "
                                      "65535: threshold probabilities into a mask first",
                          path, bad);
}
