/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read what is to move with the lungs, and check its axes and units. */
#include <string.h>

#include "base/arena.h"
#include "mesh/io/points.h"
#include "mesh/labels/labels.h"
#include "precompute/lobes.h"
#include "precompute/warp/field.h"

#include "program/command/embed_content.h"
#include "program/options/command.h"

static const char name[] = "embed";

enum { PART_NAME_SIZE = 64 };

/* Name a part that nobody named: "label 7" or, if there are several maps, by the name of the file
 * ("tumour" of tumour.nii.gz, "tumour 7" if the file has several labels). */
static void name_part(const char *path, bool several_maps, bool several_labels, unsigned label,
                      char text[PART_NAME_SIZE]) {
  const char *slash = strrchr(path, '/');
  const char *base = slash != NULL ? slash + 1 : path;
  const int length = (int)strcspn(base, ".");
  if (!several_maps) {
    (void)snprintf(text, PART_NAME_SIZE, "label %u", label);
  } else if (several_labels) {
    (void)snprintf(text, PART_NAME_SIZE, "%.*s %u", length, base, label);
  } else {
    (void)snprintf(text, PART_NAME_SIZE, "%.*s", length, base);
  }
}

/* Read the surfaces of the labels of a map.
 * @param several_maps  whether other maps are embedded too */
static supine_status read_labelled(const supine_embed_content *wanted, const char *path,
                                   bool several_maps, supine_inside_content *content,
                                   supine_error *error) {
  supine_labels_shape *parts = NULL;
  size_t count = 0;
  const supine_embed_labels *list = &wanted->labels;
  supine_status status =
      supine_labels_shapes(path, list->label, list->count, &parts, &count, error);
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    char text[PART_NAME_SIZE];
    name_part(path, several_maps, count > 1, parts[i].label, text);
    const char *part = list->count > 0 ? list->name[i] : text;
    if (parts[i].surface.triangle_count == 0) {
      supine_options_say(
          name, "warning: %s: %s is left out, as it is thinner than half a voxel everywhere", path,
          part);
      continue;
    }
    supine_options_note(name, "%s: %s, %.3g mL of voxels; its surface encloses %.3g mL", path, part,
                        parts[i].mask, 1e-3 * supine_mesh_volume(&parts[i].surface));
    status = supine_inside_content_surface(part, &parts[i].surface, content, error);
  }
  supine_labels_shapes_free(parts, count);
  return status;
}

/* Read the surfaces of the masks of lobes in a folder. */
static supine_status read_folder(const supine_embed_content *wanted, const char *path,
                                 supine_inside_content *content, supine_error *error) {
  supine_lobe_files lobes;
  SUPINE_TRY(supine_precompute_lobes_find(path, &lobes, error));
  for (size_t i = 0; i < lobes.left + lobes.right; ++i) {
    SUPINE_TRY(read_labelled(wanted, lobes.path[i], true, content, error));
  }
  return SUPINE_OK;
}

/* Tell if the points lie inside the lungs only in other units or axes. Refuse points of which none
 * is inside as read if no unit was given. */
static supine_status check_content(const supine_inside_shells *shells,
                                   const supine_embed_content *wanted,
                                   const supine_inside_content *content, supine_error *error) {
  supine_inside_reading reading;
  char text[160];
  supine_status status = supine_inside_content_check_names(content, error);
  if (status != SUPINE_OK || content->part_count == 0) {
    return status;
  }
  supine_inside_shells_reading(shells, &wanted->load, content->points, content->count, &reading);
  const bool other_unit = reading.unit[0] != '\0';
  const bool other_axes = reading.axes[0] != '\0';
  if (!other_unit && !other_axes) {
    return SUPINE_OK;
  }
  (void)snprintf(text, sizeof text,
                 "%zu of %zu points are inside the lungs, but %zu with %s%s%s%s%s", reading.as_read,
                 reading.tested, reading.inside, other_unit ? "--units " : "", reading.unit,
                 other_unit && other_axes ? " " : "", other_axes ? "--axes " : "", reading.axes);
  SUPINE_REFUSE_IF(reading.as_read == 0 && reading.tested > 2 && other_unit &&
                       !(wanted->load.millimetres_per_unit > 0.0),
                   error, SUPINE_ERROR_MESH,
                   "%s: give that, or --units mm to embed the points as they are", text);
  supine_options_say(name, "warning: %s: check the axes and units of the points", text);
  return SUPINE_OK;
}

/* Make a grid that extends so far beyond the lungs that displacements fall to 0 within it. */
static supine_status make_grid(const supine_inside_shells *shells, const supine_image *like,
                               double spacing, supine_inside_content *content,
                               supine_error *error) {
  double largest = 0.0;
  SUPINE_TRY(supine_inside_shells_reach(shells, &largest, error));
  return supine_inside_content_grid(shells, like, spacing, supine_warp_fade(largest), content,
                                    error);
}

supine_status supine_command_embed_read(const supine_inside_shells *shells,
                                        const supine_embed_content *wanted, char **paths,
                                        size_t count, supine_inside_content *content,
                                        supine_error *error) {
  size_t maps = 0; /* label maps and folders of masks */
  if (count == 0) {
    return make_grid(shells, NULL, wanted->grid_spacing, content, error);
  }
  if (!wanted->labels.given && supine_image_is_named(paths[0])) {
    SUPINE_FREED_BY(supine_image_free) supine_image image = {0};
    SUPINE_TRY(supine_image_read(paths[0], &image, error));
    return make_grid(shells, &image, wanted->grid_spacing, content, error);
  }
  for (size_t i = 0; i < count; ++i) {
    maps += supine_image_is_named(paths[i]) || supine_precompute_is_folder(paths[i]);
  }
  for (size_t i = 0; i < count; ++i) {
    if (supine_image_is_named(paths[i])) {
      SUPINE_TRY(read_labelled(wanted, paths[i], maps > 1, content, error));
    } else if (supine_precompute_is_folder(paths[i])) {
      SUPINE_TRY(read_folder(wanted, paths[i], content, error));
    } else if (supine_io_points_named(paths[i])) {
      SUPINE_TRY(supine_inside_content_points(paths[i], &wanted->load, content, error));
    } else {
      SUPINE_TRY(supine_inside_content_mesh(paths[i], &wanted->load, content, error));
    }
  }
  return check_content(shells, wanted, content, error);
}
