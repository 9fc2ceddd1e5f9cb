/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute ventilation from the change of volume that a displacement field makes. */
#include "precompute/warp/ventilation.h"

#include <math.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "base/vec3.h"

typedef struct work {
  const supine_field *field;
  supine_image *made;
} work;

/* Return the index of the node nearest to a point in a cell. */
static size_t nearest_node(const supine_image *nodes, const supine_warp_cell *cell) {
  size_t node = 0;
  for (size_t a = 3; a-- > 0;) {
    const size_t at = cell->corner[a] + (cell->share[a] > 0.5 ? 1 : 0);
    node = node * nodes->size[a] + at;
  }
  return node;
}

static void fill_rows(void *context, size_t begin, size_t end, size_t thread) {
  const work *w = context;
  const size_t width = w->made->size[0];
  float *values = w->made->values;
  (void)thread;
  for (size_t i = begin * width; i < end * width; ++i) {
    double point[3];
    double depth;
    supine_warp_cell cell;
    supine_image_place(w->made, i, point);
    supine_warp_find_cell(&w->field->nodes, point, &cell);
    supine_warp_interpolate(&w->field->depth, &cell, &depth, NULL);
    values[i] =
        depth > 0.0 ? (float)(supine_warp_stretch(&w->field->nodes, &cell) - 1.0) : (float)NAN;
  }
}

/* Return the volume of a voxel, mL. */
static double voxel_volume(const supine_image *image) {
  return 1e-3 * fabs(supine_triple(image->step[0], image->step[1], image->step[2]));
}

supine_status supine_warp_ventilation(const supine_field *field, const supine_image *frame,
                                      supine_image *made, supine_ventilated *lungs,
                                      supine_error *error) {
  const size_t rows = frame->size[1] * frame->size[2];
  const size_t count = frame->size[0] * rows;
  *made = *frame;
  made->voxel = SUPINE_VOXEL_F32;
  made->values = malloc(count * sizeof(float));
  if (made->values == NULL) {
    return supine_error_memory(error, "an image of %zu voxels", count);
  }
  work w = {.field = field, .made = made};
  supine_parallel_for(rows, 1, 0, fill_rows, &w);
  for (size_t lung = 0; lung < SUPINE_LUNGS_MAX; ++lung) {
    lungs[lung] = (supine_ventilated){.label = (double)lung};
  }
  const float *values = made->values;
  const unsigned char *nearest = field->lung.values;
  const double size = voxel_volume(made);
  for (size_t i = 0; i < count; ++i) {
    if (!isnan(values[i])) {
      double point[3];
      supine_warp_cell cell;
      supine_image_place(made, i, point);
      supine_warp_find_cell(&field->nodes, point, &cell);
      supine_ventilated *lung = &lungs[nearest[nearest_node(&field->lung, &cell)]];
      lung->held += size;
      lung->taken += size * (double)values[i];
    }
  }
  return SUPINE_OK;
}

static int compare_labels(const void *a, const void *b) {
  const double left = ((const supine_ventilated *)a)->label;
  const double right = ((const supine_ventilated *)b)->label;
  return (left > right) - (left < right);
}

/* Return the part of a label, which is added if it is new, or NULL if there are too many. */
static supine_ventilated *find_part(supine_ventilated *parts, size_t *count, double label) {
  for (size_t i = 0; i < *count; ++i) {
    if (parts[i].label == label) {
      return &parts[i];
    }
  }
  if (*count == SUPINE_VENTILATED_MOST) {
    return NULL;
  }
  parts[*count] = (supine_ventilated){.label = label};
  return &parts[(*count)++];
}

supine_status supine_warp_ventilated_labels(const supine_image *ventilation,
                                            const supine_image *labels, supine_ventilated *parts,
                                            size_t *count, supine_error *error) {
  const float *values = ventilation->values;
  const double size = voxel_volume(labels);
  *count = 0;
  for (size_t i = 0; i < supine_image_count(labels); ++i) {
    const double label = supine_image_get(labels, i);
    if (label != 0.0 && !isnan(values[i])) {
      supine_ventilated *part = find_part(parts, count, label);
      SUPINE_REFUSE_IF(part == NULL, error, SUPINE_ERROR_ARGUMENT,
                       "more than %d labels lie in the lungs: give a map of lobes",
                       SUPINE_VENTILATED_MOST);
      part->held += size;
      part->taken += size * (double)values[i];
    }
  }
  qsort(parts, *count, sizeof *parts, compare_labels);
  return SUPINE_OK;
}
