/* SPDX-License-Identifier: MIT */
/* Make surfaces from a label map. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/remedy.h"
#include "base/text.h"
#include "base/vec3.h"

#include "mesh/labels/mask.h"

static const double least_edge = 0.2; /* mm; makes about ten million vertices */
static const double most_edge = 20.0; /* mm; with larger cubes, little of a lung remains */
static const double most_closing_radius = 20.0; /* mm; half the width of the widest closed gaps */
static const double least_volume = 1.0;         /* mL; smaller lungs are refused */
static const double longest_lung = 1000.0; /* mm; if a lung seems longer, the voxel size is wrong */

typedef struct work {
  const char *path; /* path of the first file, for messages */
  const supine_labels_options *options;
  supine_labels_report *report;
  double edge;
  supine_image image; /* the label map; freed when the lungs have been copied to `both` */
  int bordered; /* number of axes, from the first, along which the image ends where the scan does */
  labels_mask both;
  labels_choice choice;
} work;

static supine_status advance(work *w, double fraction, supine_error *error) {
  const supine_labels_options *options = w->options;
  bool goes_on = true;
  if (options->progress != NULL) {
    goes_on = options->progress(options->progress_context, fraction);
  }
  SUPINE_REFUSE_IF(!goes_on, error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
  return SUPINE_OK;
}

static supine_status read_image(const work *w, const char *path, supine_image *image,
                                supine_error *error) {
  SUPINE_TRY(supine_image_read(path, image, error));
  SUPINE_TRY(supine_labels_settle(path, image, error));
  supine_image_set_axes(image, w->options->axes);
  return SUPINE_OK;
}

/* Join masks into one map with the labels 1, 2, ... Where masks overlap, the first one counts. */
static supine_status join_images(work *w, const char *const *paths, size_t count,
                                 supine_error *error) {
  const size_t voxels = supine_image_count(&w->image);
  const supine_image first = w->image;
  uint8_t *joined = calloc(voxels, 1);
  SUPINE_FREED_BY(supine_image_free) supine_image image = first;
  w->image.values = joined;
  w->image.voxel = SUPINE_VOXEL_U8;
  if (joined == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t f = 0; f < count; ++f) {
    if (f > 0) {
      supine_image_free(&image);
      SUPINE_TRY(read_image(w, paths[f], &image, error));
    }
    SUPINE_REFUSE_IF(!supine_image_same_grid(&first, &image), error, SUPINE_ERROR_FORMAT,
                     "%s: size, position or axes differ from %s: give masks of one scan", paths[f],
                     paths[0]);
    for (size_t i = 0; i < voxels; ++i) {
      joined[i] =
          joined[i] == 0 && supine_image_get(&image, i) != 0.0 ? (uint8_t)(f + 1) : joined[i];
    }
  }
  return SUPINE_OK;
}

/* Copy the bounding box of the lungs from the label map to w->both. Its voxels become 0,
 * LABELS_LEFT, LABELS_RIGHT or LABELS_EITHER. */
static supine_status make_mask(work *w, const labels_tally *tally, const uint8_t *side) {
  size_t low[3] = {SIZE_MAX, SIZE_MAX, SIZE_MAX};
  size_t high[3] = {0, 0, 0};
  for (size_t label = 1; label < LABELS_MAX; ++label) {
    if (side[label] != 0 && tally[label].count > 0) {
      for (int a = 0; a < 3; ++a) {
        low[a] = tally[label].low[a] < low[a] ? tally[label].low[a] : low[a];
        high[a] = tally[label].high[a] > high[a] ? tally[label].high[a] : high[a];
      }
    }
  }
  return supine_labels_mask_cut(&w->image, low, high, LABELS_MARGIN, side, &w->both);
}

/* Return the area of a lung in a layer of its mask across an axis, mm^2. */
static double area_of_layer(const labels_mask *lung, int axis, size_t layer) {
  const size_t stride[3] = {1, lung->size[0], lung->size[0] * lung->size[1]};
  size_t voxels = 0;
  for (size_t i = 0; i < supine_labels_mask_count(lung); ++i) {
    voxels += lung->at[i] != 0 && i / stride[axis] % lung->size[axis] == layer;
  }
  return 1e3 * supine_labels_voxel_ml(lung) / lung->spacing[axis] * (double)voxels;
}

/* Return about the volume that the border of the image cuts off a lung, mL: a half ball on the
 * largest section of the lung there. */
static double find_cut(const work *w, const labels_mask *lung, size_t margin) {
  static const double half_ball = 0.37613; /* volume of a half ball / area^1.5: 2 / (3 sqrt(pi)) */
  double area = 0.0;
  for (int a = 0; a < w->bordered; ++a) {
    const long size = (long)w->report->size[a];
    const long first = w->both.from[a] + lung->from[a] + (long)margin;
    const long last = first + (long)(lung->size[a] - 2 * margin) - 1;
    if (size > 1 && first == 0) {
      area = fmax(area, area_of_layer(lung, a, margin));
    }
    if (size > 1 && last + 1 == size) {
      area = fmax(area, area_of_layer(lung, a, lung->size[a] - margin - 1));
    }
  }
  return 1e-3 * half_ball * area * sqrt(area);
}

/* Describe an image's axes, as "i to the left, j to the back, k to the head". */
static void describe_axes(const double step[3][3], char *text, size_t size) {
  static const char *const ways[3][2] = {{"right", "left"}, {"front", "back"}, {"feet", "head"}};
  text[0] = '\0';
  for (int a = 0; a < 3; ++a) {
    int most = 0;
    for (int k = 1; k < 3; ++k) {
      most = fabs(step[a][k]) > fabs(step[a][most]) ? k : most;
    }
    supine_text_add(text, size, "%s%c to the %s", a == 0 ? "" : ", ", "ijk"[a],
                    ways[most][step[a][most] > 0.0]);
  }
}

static supine_status read_map(work *w, const char *const *paths, size_t count,
                              supine_error *error) {
  supine_labels_report *report = w->report;
  SUPINE_TRY(read_image(w, paths[0], &w->image, error));
  if (count > 1) {
    SUPINE_TRY(join_images(w, paths, count, error));
  }
  memcpy(report->size, w->image.size, sizeof report->size);
  for (int a = 0; a < 3; ++a) {
    report->spacing[a] = supine_length(w->image.step[a]);
  }
  describe_axes((const double(*)[3])w->image.step, report->axes, sizeof report->axes);
  report->source = w->image.frame_source;
  w->bordered = w->image.is_segmentation ? 2 : 3; /* its slices may be those with lung only */
  report->frames_differ = w->image.frames_differ;
  report->coordinates = w->image.axes;
  SUPINE_ARENA arena = {0};
  labels_tally *tally = supine_arena_take(&arena, LABELS_MAX, sizeof *tally);
  uint8_t *side = supine_arena_take(&arena, LABELS_MAX, 1);
  SUPINE_TRY(supine_arena_status(&arena));
  SUPINE_TRY(advance(w, 0.2, error));
  SUPINE_TRY(supine_labels_count(w->path, &w->image, tally, error));
  w->choice.taken = report->taken;
  SUPINE_TRY(supine_labels_choose(w->path, &w->image, tally, w->options, side, &w->choice, error));
  SUPINE_TRY(advance(w, 0.3, error));
  return make_mask(w, tally, side);
}

/* After gaps of a lung were closed, clear in its mask the voxels that belong to the other lung. */
static void leave_other(const labels_mask *both, uint8_t value, labels_mask *mask) {
  for (size_t i = 0; i < supine_labels_mask_count(mask); ++i) {
    size_t there = 0; /* index of the voxel in `both` */
    bool within = true;
    for (size_t a = 0, rest = i, stride = 1; a < 3; ++a) {
      const long at = (long)(rest % mask->size[a]) + mask->from[a];
      within = within && at >= 0 && at < (long)both->size[a];
      there += stride * (size_t)at;
      stride *= both->size[a];
      rest /= mask->size[a];
    }
    if (within && both->at[there] != 0 && both->at[there] != value) {
      mask->at[i] = 0;
    }
  }
}

/* Close gaps in a lung if the options say so. Then always keep only its largest connected piece,
 * and fill the cavities in it. If pieces were dropped, cut the mask to the bounding box of the lung
 * without them. */
static supine_status clean(const work *w, uint8_t value, size_t margin, labels_mask *mask,
                           supine_labels_lung *lung) {
  const double ml = supine_labels_voxel_ml(mask);
  size_t voxels = 0;
  if (w->options->close > 0.0) {
    SUPINE_TRY(supine_labels_close(mask, w->options->close, &voxels));
    leave_other(&w->both, value, mask);
    lung->closed = ml * (double)voxels;
  }
  SUPINE_TRY(supine_labels_keep_one(mask, false, &lung->islands, &voxels));
  lung->dropped = ml * (double)voxels;
  SUPINE_TRY(supine_labels_keep_one(mask, true, &lung->cavities, &voxels));
  lung->filled = ml * (double)voxels;
  if (lung->islands > 0) {
    labels_mask kept;
    SUPINE_TRY(supine_labels_mask_extract(mask, 1, margin, &kept));
    for (int a = 0; a < 3; ++a) {
      kept.from[a] += mask->from[a];
    }
    supine_labels_mask_free(mask);
    *mask = kept;
  }
  voxels = 0;
  for (size_t i = 0; i < supine_labels_mask_count(mask); ++i) {
    voxels += mask->at[i];
  }
  lung->mask = ml * (double)voxels;
  return SUPINE_OK;
}

/* Move the surface of a lung along its smoothed normals until it encloses the volume of its voxels,
 * mm^3: averaging over cubes and smoothing lose some 0.5 %. Leave it alone if that takes more than
 * half an edge, as in a lung of a few cubes. */
static supine_status hold_mask(const supine_topology *topology, double volume, double edge,
                               supine_mesh *mesh) {
  SUPINE_ARENA arena = {0};
  const size_t size = 3 * mesh->vertex_count;
  double *normals = supine_arena_take(&arena, 2 * size, sizeof *normals);
  double change[3];
  double h = 0.0;
  if (arena.failed) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_mesh_smooth_normals(mesh, topology, normals, normals + size);
  supine_mesh_volume_along(mesh, normals, change);
  const bool found = supine_mesh_offset_to(change, volume - supine_mesh_volume(mesh), &h);
  if (found && fabs(h) <= 0.5 * edge) {
    for (size_t i = 0; i < size; ++i) {
      mesh->vertices[i] += h * normals[i];
    }
  }
  return SUPINE_OK;
}

/* Make the surface of one lung; do nothing if the lung has no voxels. */
static supine_status make_lung(work *w, uint8_t value, supine_labels_lung *lung, supine_mesh *mesh,
                               supine_error *error) {
  SUPINE_FREED_BY(supine_labels_mask_free) labels_mask mask;
  const char *name = value == LABELS_LEFT ? "left" : "right";
  const double least = fmin(w->both.spacing[0], fmin(w->both.spacing[1], w->both.spacing[2]));
  const size_t margin = LABELS_MARGIN + (size_t)ceil(w->options->close / least);
  SUPINE_TRY(supine_labels_mask_extract(&w->both, value, margin, &mask));
  if (mask.at == NULL) {
    return SUPINE_OK;
  }
  lung->side = value == LABELS_LEFT ? 1 : -1;
  SUPINE_TRY(clean(w, value, margin, &mask, lung));
  lung->cut = find_cut(w, &mask, margin);
  double longest = 0.0;
  for (int a = 0; a < 3; ++a) {
    longest = fmax(longest, (double)(mask.size[a] - 2 * margin) * mask.spacing[a]);
  }
  const bool fits = lung->mask >= least_volume && longest <= longest_lung;
  supine_remedy advice[SUPINE_REMEDIES_MAX] = {
      supine_remedy_change("labels", "if they are not those of the lung")};
  if (longest > SUPINE_MESH_ANIMAL_LEAST) {
    advice[1] = supine_remedy_give("units", "mm", "to use this size all the same");
  }
  SUPINE_REFUSE_ADVISE(!fits && !w->options->any_size, error, advice, SUPINE_ERROR_MESH,
                       "%s: the %s lung holds %.4g mL in a box %.4g mm long, which is impossible "
                       "for a lung: check the voxel size in the header",
                       w->path, name, lung->mask, longest);
  const supine_status meshed = supine_labels_mask_surface(&mask, w->edge, true, mesh);
  const supine_remedy other_edge[SUPINE_REMEDIES_MAX] = {supine_remedy_change("edge", "")};
  SUPINE_REFUSE_ADVISE(meshed == SUPINE_ERROR_NUMERICAL, error, other_edge, meshed,
                       "%s: the %s lung keeps changing while it is made one piece", w->path, name);
  SUPINE_TRY(meshed);
  supine_labels_mask_free(&mask);
  SUPINE_REFUSE_IF(
      mesh->triangle_count == 0, error, SUPINE_ERROR_MESH,
      "%s: the %s lung is thinner than half of the edge of %g mm everywhere: give a smaller edge",
      w->path, name, w->edge);
  SUPINE_FREED_BY(supine_mesh_topology_free) supine_topology topology = {0};
  SUPINE_TRY(supine_mesh_topology_create(mesh, &topology));
  lung->tunnels = topology.genus;
  SUPINE_TRY(hold_mask(&topology, 1e3 * lung->mask, w->edge, mesh));
  lung->surface = 1e-3 * supine_mesh_volume(mesh);
  return SUPINE_OK;
}

/* Refuse a header whose axes contradict labels that name the sides of the lungs: the left lung is
 * not on the left, or the lungs' shape is mirrored otherwise and the user did not give the axes.
 * Find by the shape whether the labels or the axes are wrong. */
static supine_status check_sides(const work *w, const supine_mesh *surfaces, supine_error *error) {
  const bool doubted = w->choice.doubted;
  const supine_mesh_anatomy found = supine_mesh_anatomy_find(surfaces, w->report->lung_count);
  char letters[4];
  supine_mesh_axes_letters(found.axes, letters);
  const bool mirrored = letters[0] == 'L' && supine_mesh_axes_mirrored(found.axes) &&
                        w->choice.named && w->options->axes == SUPINE_AXES_AUTO;
  if (!doubted && !mirrored) {
    return SUPINE_OK;
  }
  supine_mesh_axes_letters(supine_mesh_axes_after(w->report->coordinates, found.axes), letters);
  (void)supine_error_set(
      error, SUPINE_ERROR_MESH, "%s: by its header, %s (labels %s)%s", w->path,
      doubted ? "the left lung does not lie left of the right lung" : "the lungs are mirrored",
      w->report->taken, found.axes == SUPINE_AXES_LPS ? "" : ". The lungs' shape fits other axes");
  supine_remedy advice[SUPINE_REMEDIES_MAX] = {
      supine_remedy_change("labels", "if left and right are exchanged"),
      supine_remedy_change("axes", "if those of the header are wrong")};
  if (found.axes != SUPINE_AXES_LPS) {
    char header[4];
    supine_mesh_axes_letters(w->report->coordinates, header);
    advice[0] = supine_remedy_give("axes", letters, "if the labels are correct");
    advice[1] = supine_remedy_give("axes", header, "if the header is correct");
    advice[1].kind = doubted ? SUPINE_REMEDY_NONE : SUPINE_REMEDY_GIVE;
  }
  supine_error_advise(error, advice);
  return SUPINE_ERROR_MESH;
}

/* Return whether two labels can be the two lungs of a person. */
static bool can_be_lungs(const work *w, const supine_mesh *surfaces) {
  const supine_labels_lung *lung = w->report->lung;
  const double ratio = fmax(lung[0].mask, lung[1].mask) / fmin(lung[0].mask, lung[1].mask);
  bool can = supine_input_judge(SUPINE_INPUT_LABELS_RATIO, ratio) == SUPINE_INPUT_TAKEN;
  double low[2][3];
  double high[2][3];
  double centre[2];
  for (int i = 0; i < 2; ++i) {
    can = can && supine_input_judge(SUPINE_INPUT_LABELS_PIECES, lung[i].dropped / lung[i].mask) ==
                     SUPINE_INPUT_TAKEN;
    (void)supine_mesh_box(&surfaces[i], low[i], high[i]);
    centre[i] = 0.5 * (low[i][0] + high[i][0]);
  }
  /* the left lung comes first, and x grows to the left */
  const double reach = fmax(high[1][0] - centre[0], centre[1] - low[0][0]);
  const bool apart = supine_input_judge(SUPINE_INPUT_LABELS_SIDES, reach) == SUPINE_INPUT_TAKEN;
  return can && (apart || w->choice.doubted); /* check_sides refuses doubted sides */
}

/* Refuse two labels that were assumed to be the two lungs if they hardly are. */
static supine_status check_guess(const work *w, const supine_mesh *surfaces, supine_error *error) {
  const supine_labels_lung *lung = w->report->lung;
  const bool can = !w->choice.guessed || can_be_lungs(w, surfaces);
  SUPINE_REFUSE_IF(!can, error, SUPINE_ERROR_MESH,
                   "%s: its two labels are hardly the two lungs: the left one would hold %.0f mL, "
                   "and %.0f mL apart from that, the right one %.0f and %.0f mL (labels %s). Say "
                   "which labels are lung: left=LABEL+...,right=LABEL+..., or 'one' if all are",
                   w->path, lung[0].mask, lung[0].dropped, lung[1].mask, lung[1].dropped,
                   w->report->taken);
  return SUPINE_OK;
}

static supine_status make_surfaces(work *w, const char *const *paths, size_t count,
                                   supine_mesh *surfaces, supine_error *error) {
  supine_labels_report *report = w->report;
  SUPINE_TRY(read_map(w, paths, count, error));
  supine_image_free(&w->image);
  if (memchr(w->both.at, LABELS_EITHER, supine_labels_mask_count(&w->both)) != NULL) {
    SUPINE_TRY(supine_labels_split(w->path, &w->both, &report->neck, error));
  }
  for (uint8_t value = LABELS_LEFT; value <= LABELS_RIGHT; ++value) {
    supine_labels_lung *lung = &report->lung[report->lung_count];
    SUPINE_TRY(advance(w, value == LABELS_LEFT ? 0.5 : 0.75, error));
    SUPINE_TRY(make_lung(w, value, lung, &surfaces[report->lung_count], error));
    report->lung_count += lung->side != 0;
  }
  supine_labels_mask_free(&w->both);
  if (report->lung_count == 2) {
    SUPINE_TRY(check_guess(w, surfaces, error));
    SUPINE_TRY(check_sides(w, surfaces, error));
  }
  return advance(w, 1.0, error);
}

supine_status supine_labels_surfaces(const char *const *paths, size_t count,
                                     const supine_labels_options *options, supine_mesh *surfaces,
                                     supine_labels_report *report, supine_error *error) {
  enum { FILES_MAX = 255 };
  work w = {.path = paths[0], .options = options, .report = report};
  w.edge = options->edge != 0.0 ? options->edge : SUPINE_LABELS_EDGE;
  *report = (supine_labels_report){.lung_count = 0};
  SUPINE_REFUSE_IF(
      !(w.edge >= least_edge && w.edge <= most_edge) ||
          !(options->close >= 0.0 && options->close <= most_closing_radius) || count > FILES_MAX,
      error, SUPINE_ERROR_ARGUMENT,
      "give an edge from %g to %g mm, close gaps of 0 to %g mm, and give at most %d images",
      least_edge, most_edge, most_closing_radius, FILES_MAX);
  const supine_status status = make_surfaces(&w, paths, count, surfaces, error);
  supine_image_free(&w.image);
  supine_labels_mask_free(&w.both);
  if (status != SUPINE_OK) {
    supine_mesh_free(&surfaces[0]);
    supine_mesh_free(&surfaces[1]);
  }
  return status == SUPINE_ERROR_MEMORY ? supine_error_memory(error, "the labels of %s", w.path)
                                       : status;
}
