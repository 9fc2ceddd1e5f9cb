/* SPDX-License-Identifier: MIT */
/* Make the surface of each label. */
#include <math.h>
#include <stdlib.h>

#include "mesh/labels/mask.h"

enum { PARTS_MAX = 256 }; /* an image with more labels is probably no label map */

/* Distance between the vertices of a large structure, divided by the cube root of its volume. With
 * this value, a lobe of a lung gets about 15,000 vertices. */
static const double edge_share = 0.02;

/* Make the surface of one label.
 * @param value  [LABELS_MAX] work space, zero before and after the call */
static supine_status make_part(const supine_image *image, const labels_tally *tally, uint8_t *value,
                               supine_labels_shape *part) {
  SUPINE_FREED_BY(supine_labels_mask_free) labels_mask mask;
  value[part->label] = 1;
  SUPINE_TRY(supine_labels_mask_cut(image, tally->low, tally->high, LABELS_MARGIN, value, &mask));
  value[part->label] = 0;
  part->mask = supine_labels_voxel_ml(&mask) * (double)tally->count;
  const double edge =
      fmax(cbrt(1e3 * supine_labels_voxel_ml(&mask)), edge_share * cbrt(1e3 * part->mask));
  return supine_labels_mask_surface(&mask, edge, false, &part->surface);
}

static supine_status choose(const char *path, const labels_tally *tally, const unsigned *wanted,
                            size_t wanted_count, supine_labels_shape *parts, size_t *count,
                            supine_error *error) {
  *count = 0;
  for (size_t i = 0; i < wanted_count; ++i) {
    SUPINE_REFUSE_IF(wanted[i] == 0 || wanted[i] >= LABELS_MAX || tally[wanted[i]].count == 0,
                     error, SUPINE_ERROR_MESH, "%s: no voxel holds the label %u: correct the label",
                     path, wanted[i]);
    parts[(*count)++].label = wanted[i];
  }
  if (wanted_count == 0) {
    for (unsigned label = 1; label < LABELS_MAX; ++label) {
      SUPINE_REFUSE_IF(tally[label].count > 0 && *count == PARTS_MAX, error, SUPINE_ERROR_MESH,
                       "%s: more than %d labels: if this is a label map, name the labels to use",
                       path, PARTS_MAX);
      if (tally[label].count > 0) {
        parts[(*count)++].label = label;
      }
    }
  }
  return SUPINE_OK;
}

static supine_status make_parts(const char *path, const unsigned *wanted, size_t wanted_count,
                                supine_labels_shape *parts, size_t *count, supine_error *error) {
  SUPINE_ARENA arena = {0};
  labels_tally *tally = supine_arena_take(&arena, LABELS_MAX, sizeof *tally);
  uint8_t *value = supine_arena_zeros(&arena, LABELS_MAX, 1);
  SUPINE_FREED_BY(supine_image_free) supine_image image = {0};
  SUPINE_TRY(supine_arena_status(&arena));
  SUPINE_TRY(supine_image_read(path, &image, error));
  SUPINE_TRY(supine_labels_settle(path, &image, error));
  SUPINE_TRY(supine_labels_count(path, &image, tally, error));
  SUPINE_TRY(choose(path, tally, wanted, wanted_count, parts, count, error));
  for (size_t i = 0; i < *count; ++i) {
    SUPINE_TRY(make_part(&image, &tally[parts[i].label], value, &parts[i]));
  }
  return SUPINE_OK;
}

supine_status supine_labels_shapes(const char *path, const unsigned *wanted, size_t wanted_count,
                                   supine_labels_shape **parts, size_t *count,
                                   supine_error *error) {
  supine_labels_shape *made = calloc(wanted_count > 0 ? wanted_count : PARTS_MAX, sizeof *made);
  size_t made_count = 0;
  const supine_status status =
      made != NULL ? make_parts(path, wanted, wanted_count, made, &made_count, error)
                   : SUPINE_ERROR_MEMORY;
  if (status != SUPINE_OK) {
    supine_labels_shapes_free(made, made_count);
    return status == SUPINE_ERROR_MEMORY ? supine_error_memory(error, "the labels of %s", path)
                                         : status;
  }
  *parts = made;
  *count = made_count;
  return SUPINE_OK;
}

void supine_labels_shapes_free(supine_labels_shape *parts, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    supine_mesh_free(&parts[i].surface);
  }
  free(parts);
}
