/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Any label's surface. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/labels/mask.h"
#include "mesh/labels/shapes.h"

enum { MARGIN = 2, ALL_MOST = 256 }; /* more are no parts that anyone named */

/* Of the cube root of the volume, between vertices of large parts: some 15,000 of a lobe. */
static const double edge_share = 0.02;

/* The voxels of one label, with a margin. */
static supine_status mask_of(const supine_image *image, unsigned label, const labels_tally *tally,
                             labels_mask *mask) {
  uint16_t *row = malloc(image->size[0] * sizeof *row);
  *mask = (labels_mask){.at = NULL};
  for (int k = 0; k < 3; ++k) {
    mask->origin[k] = image->origin[k];
    for (int a = 0; a < 3; ++a) {
      mask->origin[k] += ((double)tally->low[a] - MARGIN) * image->step[a][k];
    }
  }
  for (int a = 0; a < 3; ++a) {
    const double *s = image->step[a];
    mask->size[a] = tally->high[a] - tally->low[a] + 1 + (size_t)2 * MARGIN;
    mask->spacing[a] = sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
    memcpy(mask->step[a], s, sizeof mask->step[a]);
  }
  mask->at = calloc(supine_labels_mask_count(mask), 1);
  if (row == NULL || mask->at == NULL) {
    free(row);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t k = tally->low[2]; k <= tally->high[2]; ++k) {
    for (size_t j = tally->low[1]; j <= tally->high[1]; ++j) {
      double bad;
      (void)supine_labels_row(image, j + image->size[1] * k, row, &bad); /* it went well before */
      uint8_t *out = mask->at + MARGIN +
                     mask->size[0] * (j - tally->low[1] + MARGIN +
                                      mask->size[1] * (k - tally->low[2] + MARGIN));
      for (size_t i = tally->low[0]; i <= tally->high[0]; ++i) {
        out[i - tally->low[0]] = row[i] == label;
      }
    }
  }
  free(row);
  return SUPINE_OK;
}

static supine_status make_part(const supine_image *image, const labels_tally *tally,
                               supine_labels_shape *part) {
  labels_mask mask;
  double held;
  supine_status status = mask_of(image, part->label, tally, &mask);
  if (status == SUPINE_OK) {
    part->mask = supine_labels_voxel_ml(&mask) * (double)tally->count;
    const double edge =
        fmax(cbrt(1e3 * supine_labels_voxel_ml(&mask)), edge_share * cbrt(1e3 * part->mask));
    status = supine_labels_mask_surface(&mask, edge, false, &held, &part->farthest, &part->surface);
  }
  supine_labels_mask_free(&mask);
  return status;
}

/* Which labels, with those that are not there refused. */
static supine_status choose(const char *path, const labels_tally *tally, const unsigned *wanted,
                            size_t wanted_count, supine_labels_shape *parts, size_t *count,
                            supine_error *error) {
  *count = 0;
  for (size_t i = 0; i < wanted_count; ++i) {
    if (wanted[i] == 0 || wanted[i] >= LABELS_MAX || tally[wanted[i]].count == 0) {
      return supine_error_set(error, SUPINE_ERROR_MESH, "%s: no voxel holds the label %u", path,
                              wanted[i]);
    }
    parts[(*count)++].label = wanted[i];
  }
  for (unsigned label = 1; label < LABELS_MAX && wanted_count == 0; ++label) {
    if (tally[label].count > 0 && *count == ALL_MOST) {
      return supine_error_set(error, SUPINE_ERROR_MESH,
                              "%s: more than %d labels: is it a label map? Name those that are "
                              "wanted",
                              path, ALL_MOST);
    }
    if (tally[label].count > 0) {
      parts[(*count)++].label = label;
    }
  }
  return *count > 0 ? SUPINE_OK
                    : supine_error_set(error, SUPINE_ERROR_MESH,
                                       "%s: all voxels hold 0: there is no label", path);
}

supine_status supine_labels_shapes(const char *path, const unsigned *wanted, size_t wanted_count,
                                   supine_labels_shape **parts, size_t *count,
                                   supine_error *error) {
  supine_image image = {0};
  labels_tally *tally = malloc(LABELS_MAX * sizeof *tally);
  supine_labels_shape *made = calloc(wanted_count > 0 ? wanted_count : ALL_MOST, sizeof *made);
  size_t made_count = 0;
  supine_status status =
      tally == NULL || made == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path)
          : supine_image_read(path, &image, error);
  status = status == SUPINE_OK ? supine_labels_count(path, &image, tally, error) : status;
  if (status == SUPINE_OK) {
    status = choose(path, tally, wanted, wanted_count, made, &made_count, error);
  }
  for (size_t i = 0; i < made_count && status == SUPINE_OK; ++i) {
    status = make_part(&image, &tally[made[i].label], &made[i]);
    if (status != SUPINE_OK) {
      (void)supine_error_set(error, status, "%s: no memory for the surface of label %u", path,
                             made[i].label);
    }
  }
  supine_image_free(&image);
  free(tally);
  if (status != SUPINE_OK) {
    supine_labels_shapes_free(made, made_count);
    return status;
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
