/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Images moved by a field: each voxel is taken from where its tissue was. */
#include <math.h>
#include <stdlib.h>

#include "sh/base/parallel.h"

#include "program/field/cell.h"

typedef struct resampling {
  const supine_field *inverse;
  const supine_image *from;
  supine_image *to;
  bool labels;
} resampling;

static void resample_rows(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const resampling *work = context;
  const supine_image *from = work->from;
  for (size_t row = begin; row < end; ++row) {
    for (size_t i = 0; i < from->size[0]; ++i) {
      double point[3];
      double v[3];
      double value;
      supine_field_cell cell;
      for (int k = 0; k < 3; ++k) {
        point[k] = from->origin[k] + (double)i * from->step[0][k] +
                   (double)(row % from->size[1]) * from->step[1][k] +
                   (double)(row / from->size[1]) * from->step[2][k];
      }
      supine_field_at(work->inverse, point, v);
      for (int k = 0; k < 3; ++k) {
        point[k] += v[k];
      }
      supine_field_find_cell(from, point, &cell);
      for (int k = 0; k < 3 && work->labels; ++k) { /* labels have no means */
        cell.share[k] = rint(cell.share[k]);
      }
      supine_field_interpolate(from, &cell, &value, NULL);
      supine_image_set(work->to, row * from->size[0] + i, value);
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
