/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Check that an image shows the lungs that it is to be moved with. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/number.h"
#include "precompute/warp/check_image.h"
#include "precompute/warp/field.h"

/* Nodes of the grid less deep than this are left out, mm: the lungs' rim is soft. */
static const double rim = 3.0;

/* What an image shows at the nodes inside the lungs. */
typedef struct sight {
  size_t nodes, seen;       /* number of nodes inside the lungs, and of those in the image */
  double *value;            /* [nodes] values of the image at the nodes seen */
  double low[3], high[3];   /* box of the nodes, mm */
  double first[3], last[3]; /* box of the image, mm */
} sight;

static void find_image_box(const supine_image *image, sight *s) {
  for (size_t corner = 0; corner < 8; ++corner) {
    double point[3];
    const size_t at[3] = {(corner & 1U) * (image->size[0] - 1),
                          (corner >> 1 & 1U) * (image->size[1] - 1),
                          (corner >> 2) * (image->size[2] - 1)};
    supine_image_place(image, at[0] + image->size[0] * (at[1] + image->size[1] * at[2]), point);
    for (int k = 0; k < 3; ++k) {
      s->first[k] = corner == 0 ? point[k] : fmin(s->first[k], point[k]);
      s->last[k] = corner == 0 ? point[k] : fmax(s->last[k], point[k]);
    }
  }
}

/* Look at the voxel nearest to a point; return false if the point is outside the image. */
static bool look(const supine_image *image, const double point[3], double *value) {
  double voxel[3];
  size_t at[3];
  supine_image_locate(image, point, voxel);
  for (int a = 0; a < 3; ++a) {
    if (!(voxel[a] > -0.5 && voxel[a] < (double)image->size[a] - 0.5)) {
      return false;
    }
    at[a] = (size_t)rint(fmax(0.0, voxel[a]));
  }
  *value = supine_image_get(image, at[0] + image->size[0] * (at[1] + image->size[1] * at[2]));
  return true;
}

static void look_at_nodes(const supine_image *depth, const supine_image *image, sight *s) {
  for (size_t i = 0; i < depth->size[0] * depth->size[1] * depth->size[2]; ++i) {
    double point[3];
    if (!(supine_image_get(depth, i) > rim)) {
      continue;
    }
    supine_image_place(depth, i, point);
    for (int k = 0; k < 3; ++k) {
      s->low[k] = s->nodes == 0 ? point[k] : fmin(s->low[k], point[k]);
      s->high[k] = s->nodes == 0 ? point[k] : fmax(s->high[k], point[k]);
    }
    ++s->nodes;
    s->seen += look(image, point, &s->value[s->seen]);
  }
  find_image_box(image, s);
}

static int compare(const void *a, const void *b) {
  const double x = *(const double *)a;
  const double y = *(const double *)b;
  return (x > y) - (x < y);
}

/* Describe what is wrong with the image; write nothing if it fits. */
static void describe(const sight *s, bool ct, bool scaled, char *text, size_t size) {
  const double share = (double)s->seen / (double)s->nodes;
  const supine_input_id frame = scaled ? SUPINE_INPUT_CT_FRAME : SUPINE_INPUT_IMAGE_FRAME;
  if (supine_input_judge(frame, share) != SUPINE_INPUT_TAKEN) {
    (void)supine_print_text(
        text, size,
        "only %.0f %% of the lungs lie in the image: the lungs are at x %.0f to %.0f, y %.0f to "
        "%.0f, z %.0f to %.0f mm, the image at x %.0f to %.0f, y %.0f to %.0f, z %.0f to %.0f mm "
        "(LPS); give an image in the frame of the scan",
        100.0 * share, s->low[0], s->high[0], s->low[1], s->high[1], s->low[2], s->high[2],
        s->first[0], s->last[0], s->first[1], s->last[1], s->first[2], s->last[2]);
    return;
  }
  const double median = s->value[s->seen / 2];
  if (ct && supine_input_judge(SUPINE_INPUT_CT_AIR, median) != SUPINE_INPUT_TAKEN) {
    (void)supine_print_text(
        text, size,
        "half of the voxels inside the lungs are above %.0f HU, so that they hold no air: check "
        "the axes of the image, and that it shows these lungs",
        median);
  }
}

supine_status supine_warp_check_image(const supine_image *depth, const supine_image *image,
                                      const char *path, supine_warp_image_kind kind,
                                      supine_findings *findings, supine_error *error) {
  SUPINE_ARENA arena = {0};
  char text[512] = "";
  const size_t most = depth->size[0] * depth->size[1] * depth->size[2];
  sight s = {.value = supine_arena_take(&arena, most, sizeof *s.value)};
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu nodes", most));
  look_at_nodes(depth, image, &s);
  if (s.nodes == 0) {
    return SUPINE_OK;
  }
  qsort(s.value, s.seen, sizeof *s.value, compare);
  describe(&s,
           kind == SUPINE_FIELD_CT ||
               (kind == SUPINE_FIELD_IMAGE && supine_warp_is_hounsfield(image)),
           kind == SUPINE_FIELD_CT, text, sizeof text);
  SUPINE_REFUSE_IF(kind == SUPINE_FIELD_CT && text[0] != '\0', error, SUPINE_ERROR_FORMAT, "%s: %s",
                   path, text);
  if (text[0] != '\0') {
    supine_findings_warn(findings, "%s: %s", path, text);
  }
  return SUPINE_OK;
}
