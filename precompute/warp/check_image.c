/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Check that an image shows the lungs that it is to be moved with. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/remedy.h"
#include "precompute/lungs/belong.h"
#include "precompute/warp/check_image.h"

/* Nodes of the grid less deep than this are left out, mm: the lungs' rim is soft. */
static const double rim = 3.0;
/* Voxels of labels may lie so far outside the lungs, mm: the basis may have coarse surfaces. */
static const double label_rim = 15.0;
/* If the labels of a map fill this share of the lungs, it shows the lungs, but not all of these.
 * Its labels are then judged together, and may lie outside by less, mm. */
static const double shown_least = 0.4;
static const double shown_most = 0.96;
static const double lung_rim = 10.0;
/* A label of which less than this share lies in the lungs, not counting what lies between them,
 * does not belong to them. */
static const double label_inside = 0.2;
/* Collapsed and consolidated tissue, and that outside the lungs, is above this density, HU. */
static const double airless = -300.0;
enum { LABELS = 65536 };

/* What an image shows at the nodes inside the lungs. */
typedef struct sight {
  size_t nodes;             /* number of nodes inside the lungs */
  supine_lungs_belong lung; /* the nodes that lie in the image; outside: those without air */
  size_t filled;            /* number of nodes at which the image is above 0 */
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
  for (size_t i = 0; i < supine_image_count(depth); ++i) {
    double point[3];
    double value;
    if (!(supine_image_get(depth, i) > rim)) {
      continue;
    }
    supine_image_place(depth, i, point);
    for (int k = 0; k < 3; ++k) {
      s->low[k] = s->nodes == 0 ? point[k] : fmin(s->low[k], point[k]);
      s->high[k] = s->nodes == 0 ? point[k] : fmax(s->high[k], point[k]);
    }
    ++s->nodes;
    if (look(image, point, &value)) {
      supine_lungs_belong_add(&s->lung, value < airless ? 1.0 : -1.0);
      s->filled += value > 0.0;
    }
  }
  find_image_box(image, s);
}

/* Describe what is wrong with the image; write nothing if it fits. Return the verdict. */
static supine_input_verdict describe(const sight *s, bool ct, bool scaled, char *text,
                                     size_t size) {
  const double share = (double)s->lung.count / (double)s->nodes;
  const supine_input_id frame = scaled ? SUPINE_INPUT_CT_FRAME : SUPINE_INPUT_IMAGE_FRAME;
  supine_input_verdict verdict = supine_input_judge(frame, share);
  if (verdict != SUPINE_INPUT_TAKEN) {
    (void)supine_print_text(
        text, size,
        "only %.0f %% of the lungs lie in the image: the lungs are at x %.0f to %.0f, y %.0f to "
        "%.0f, z %.0f to %.0f mm, the image at x %.0f to %.0f, y %.0f to %.0f, z %.0f to %.0f mm "
        "(LPS); give an image in the frame of the scan",
        100.0 * share, s->low[0], s->high[0], s->low[1], s->high[1], s->low[2], s->high[2],
        s->first[0], s->last[0], s->first[1], s->last[1], s->first[2], s->last[2]);
    return verdict;
  }
  const double other = supine_lungs_belong_share(&s->lung);
  verdict = ct ? supine_input_judge(SUPINE_INPUT_CT_AIR, other) : SUPINE_INPUT_TAKEN;
  if (verdict != SUPINE_INPUT_TAKEN) {
    (void)supine_print_text(
        text, size,
        "%.0f %% of the lungs of the basis hold no air in the image (above %.0f HU): check that it "
        "shows these lungs in this state, and its axes, unless so much of them is consolidated",
        100.0 * other, airless);
  }
  return verdict;
}

/* What is found of a label. */
typedef struct labelled {
  supine_lungs_belong far, near; /* its voxels, with the wide and the narrow rim */
  size_t inside, beside;         /* numbers of voxels inside the lungs, and outside */
} labelled;

/* Warn of labels that lie in the lungs mostly, but far outside in part, as another person's do. A
 * mirrored map of the lungs differs by less, and leaves a part of the lungs empty. */
static void judge_labels(const labelled *found, const sight *s, const char *path,
                         supine_findings *findings) {
  supine_lungs_belong all = {.rim = lung_rim};
  bool taken = true;
  char text[320];
  for (size_t label = 1; label < LABELS; ++label) {
    const supine_lungs_belong *near = &found[label].near;
    const double placed = (double)(found[label].inside + found[label].beside);
    if ((double)found[label].inside > label_inside * placed) {
      (void)snprintf(text, sizeof text, "voxels of label %zu in %.256s", label, path);
      taken = supine_lungs_belong_judge(&found[label].far, SUPINE_INPUT_CONTENT_OUTSIDE, text,
                                        "basis", findings) == SUPINE_INPUT_TAKEN &&
              taken;
      all.count += near->count;
      all.outside += near->outside;
      all.farthest = fmax(all.farthest, near->farthest);
    }
  }
  const double filled = (double)s->filled / (double)s->nodes;
  if (taken && filled > shown_least && filled < shown_most) {
    (void)snprintf(text, sizeof text, "voxels of the lungs in %.256s", path);
    (void)supine_lungs_belong_judge(&all, SUPINE_INPUT_LABELS_LUNGS, text, "basis", findings);
  }
}

/* Find what each label is, and judge it. */
static supine_status check_labels(const supine_field *field, const supine_image *image,
                                  const sight *s, const char *path, supine_findings *findings,
                                  supine_error *error) {
  SUPINE_ARENA arena = {0};
  labelled *found = supine_arena_zeros(&arena, LABELS, sizeof *found);
  SUPINE_TRY(supine_arena_check(&arena, error, "%d labels", (int)LABELS));
  for (size_t i = 0; i < supine_image_count(image); ++i) {
    const double label = supine_image_get(image, i);
    double point[3];
    double depth = 0.0;
    supine_warp_cell cell;
    const double off = label > 0.0 && label < 1.0 ? 0.0 : fabs(label - rint(label));
    const supine_input_verdict verdict = supine_input_judge(SUPINE_INPUT_LABEL_VALUE, off);
    SUPINE_REFUSE_IF(verdict == SUPINE_INPUT_REFUSED, error, SUPINE_ERROR_FORMAT,
                     "%s: a voxel holds %g, but labels are whole numbers, 0 to 65535, and "
                     "probabilities are 0 to 1: give labels or probabilities",
                     path, label);
    if (!(label >= 1.0 && label < LABELS)) {
      continue;
    }
    supine_image_place(image, i, point);
    labelled *here = &found[(size_t)label];
    if (!supine_lungs_is_between(s->low, s->high, 0, point)) {
      supine_warp_find_cell(&field->depth, point, &cell);
      supine_warp_interpolate(&field->depth, &cell, &depth, NULL);
      here->inside += depth >= 0.0;
      here->beside += depth < 0.0;
    }
    here->far.rim = label_rim;
    here->near.rim = lung_rim;
    supine_lungs_belong_add(&here->far, depth);
    supine_lungs_belong_add(&here->near, depth);
  }
  judge_labels(found, s, path, findings);
  return SUPINE_OK;
}

/* Warn of a label map that is given as an image: all values are whole numbers from 0, and few. */
static supine_status check_no_labels(const supine_image *image, const char *path,
                                     supine_findings *findings, supine_error *error) {
  SUPINE_ARENA arena = {0};
  bool *found = supine_arena_zeros(&arena, LABELS, sizeof *found);
  size_t count = 0;
  SUPINE_TRY(supine_arena_check(&arena, error, "%d labels", (int)LABELS));
  for (size_t i = 0; i < supine_image_count(image); ++i) {
    const double value = supine_image_get(image, i);
    if (!(value >= 0.0 && value < LABELS && value == rint(value))) {
      return SUPINE_OK;
    }
    count += !found[(size_t)value];
    found[(size_t)value] = true;
    if (supine_input_judge(SUPINE_INPUT_IMAGE_LABELS, (double)count) == SUPINE_INPUT_TAKEN) {
      return SUPINE_OK;
    }
  }
  if (count > 1) {
    const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
        supine_remedy_give("labels", "", "if it is a label map")};
    supine_findings_warn(findings,
                         "%s: it holds %zu different whole numbers, as a label map does, and is "
                         "interpolated, which makes labels that the map lacks",
                         path, count);
    supine_findings_advise(findings, advice);
  }
  return SUPINE_OK;
}

supine_status supine_warp_check_image(const supine_field *field, const supine_image *image,
                                      const char *path, supine_warp_image_kind kind,
                                      supine_findings *findings, supine_error *error) {
  char text[512] = "";
  sight s = {.nodes = 0};
  look_at_nodes(&field->depth, image, &s);
  if (s.nodes == 0) {
    return SUPINE_OK;
  }
  const bool ct =
      kind == SUPINE_FIELD_CT || (kind == SUPINE_FIELD_IMAGE && supine_warp_is_hounsfield(image));
  const supine_input_verdict verdict = describe(&s, ct, kind == SUPINE_FIELD_CT, text, sizeof text);
  SUPINE_REFUSE_IF(verdict == SUPINE_INPUT_REFUSED && kind == SUPINE_FIELD_CT, error,
                   SUPINE_ERROR_FORMAT, "%s: %s", path, text);
  if (verdict != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(findings, "%s: %s", path, text);
  } else if (kind == SUPINE_FIELD_LABELS) {
    SUPINE_TRY(check_labels(field, image, &s, path, findings, error));
  }
  if (kind == SUPINE_FIELD_IMAGE) {
    SUPINE_TRY(check_no_labels(image, path, findings, error));
  }
  return SUPINE_OK;
}

void supine_warp_check_soft(const supine_tissue *tissue, const char *path,
                            supine_findings *findings) {
  for (size_t lung = 0; lung < tissue->lungs; ++lung) {
    const double share = tissue->soft[lung] / tissue->volume[lung];
    if (tissue->volume[lung] > 0.0 &&
        supine_input_judge(SUPINE_INPUT_CT_SOFT, share) != SUPINE_INPUT_TAKEN) {
      supine_findings_warn(
          findings,
          "%s: %.0f mL of soft tissue are %.0f %% of a lung of %.0f mL, where vessels and nodules "
          "are less: check that the CT shows these lungs in this state, unless so much of them is "
          "consolidated",
          path, tissue->soft[lung], 100.0 * share, tissue->volume[lung]);
    }
  }
}
