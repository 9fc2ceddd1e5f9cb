/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read what is to move with the lungs, and check its axes and units. */
#include "base/arena.h"
#include "mesh/io/points.h"
#include "mesh/labels/labels.h"
#include "precompute/warp/field.h"

#include "program/embed_content.h"
#include "program/options/command.h"

static const char name[] = "embed";

static supine_status read_labelled(const supine_embed_content *wanted, const char *path,
                                   supine_inside_content *content, supine_error *error) {
  supine_labels_shape *parts = NULL;
  size_t count = 0;
  const supine_embed_labels *list = &wanted->labels;
  supine_status status =
      supine_labels_shapes(path, list->label, list->count, &parts, &count, error);
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    char text[32];
    (void)snprintf(text, sizeof text, "label %u", parts[i].label);
    const char *part = list->count > 0 ? list->name[i] : text;
    if (parts[i].surface.triangle_count == 0) {
      supine_options_say(name, "%s: %s is left out, as it is thinner than half a voxel everywhere",
                         path, part);
      continue;
    }
    supine_options_say(name, "%s: %s, %.3g mL of voxels; its surface encloses %.3g mL", path, part,
                       parts[i].mask, 1e-3 * supine_mesh_volume(&parts[i].surface));
    status = supine_inside_content_surface(part, &parts[i].surface, content, error);
  }
  supine_labels_shapes_free(parts, count);
  return status;
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
  if (reading.options[0] == '\0') {
    return SUPINE_OK;
  }
  (void)snprintf(text, sizeof text, "%zu of %zu points are inside the lungs, but %zu with %s",
                 reading.as_read, reading.tested, reading.inside, reading.options);
  SUPINE_REFUSE_IF(reading.as_read == 0 && reading.tested > 2 && reading.other_units &&
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
  return supine_inside_content_grid(shells, like, spacing, supine_field_fade(largest), content,
                                    error);
}

supine_status supine_command_embed_read(const supine_inside_shells *shells,
                                        const supine_embed_content *wanted, char **paths,
                                        size_t count, supine_inside_content *content,
                                        supine_error *error) {
  if (count == 0) {
    return make_grid(shells, NULL, wanted->grid_spacing, content, error);
  }
  if (!wanted->labels.given && supine_image_is_named(paths[0])) {
    SUPINE_FREED_BY(supine_image_free) supine_image image = {0};
    SUPINE_TRY(supine_image_read(paths[0], &image, error));
    return make_grid(shells, &image, wanted->grid_spacing, content, error);
  }
  for (size_t i = 0; i < count; ++i) {
    SUPINE_TRY(supine_image_is_named(paths[i]) ? read_labelled(wanted, paths[i], content, error)
               : supine_mesh_points_named(paths[i])
                   ? supine_inside_content_points(paths[i], &wanted->load, content, error)
                   : supine_inside_content_mesh(paths[i], &wanted->load, content, error));
  }
  return check_content(shells, wanted, content, error);
}
