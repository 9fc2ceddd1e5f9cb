/* SPDX-License-Identifier: GPL-3.0-or-later */
/* States of the lungs for pictures, and the picture around them. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "program/drawing.h"

static const char name[] = "render";
static const double seen_through = 0.35; /* default opacity of the lungs with --inside */

supine_status supine_command_drawn_find(const supine_basis *basis, const supine_compare *compare,
                                        const supine_command_drawing *wanted,
                                        const supine_posture_item *item,
                                        supine_command_drawn *found, supine_error *error) {
  if (wanted->scale == 0.0) {
    return supine_options_pose(basis, name, &wanted->volume, item->gravity, &found->pose, error);
  }
  supine_distance_statistics statistics;
  (void)supine_basis_weights(basis, item->gravity, found->pose.weights); /* a unit vector */
  supine_pose_fill(&found->pose, 1.0);
  supine_compare_distances(compare, &found->pose, NULL, found->value);
  supine_compare_statistics(compare, found->value, &statistics);
  if (!(statistics.max > 0.0)) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "nothing moves in %s, so no --scale gives %g mm: give another posture",
                            item->name, wanted->scale);
  }
  supine_pose_fill(&found->pose, wanted->scale / statistics.max);
  return SUPINE_OK;
}

void supine_command_drawn_value(const supine_basis *basis, const supine_compare *compare,
                                const supine_pose *from, supine_command_drawn *shown,
                                double ends[2]) {
  supine_distance_statistics statistics;
  supine_compare_distances(compare, &shown->pose, from, shown->value);
  supine_compare_statistics(compare, shown->value, &statistics);
  ends[0] = fmax(ends[0], statistics.p95);
  ends[1] = fmax(ends[1], statistics.max);
  size_t used = 0;
  if (supine_basis_get_info(basis)->has_volume) {
    double held[SUPINE_LUNGS_MAX];
    double volume = 0.0;
    supine_basis_volumes(basis, &shown->pose, held);
    for (size_t lung = 0; lung < supine_basis_get_info(basis)->lung_count; ++lung) {
      volume += held[lung];
    }
    used = (size_t)snprintf(shown->subtitle, sizeof shown->subtitle, "%.0f mL, ", volume);
  }
  (void)snprintf(shown->subtitle + used, sizeof shown->subtitle - used, "mean %.1f, max %.1f mm",
                 statistics.mean, statistics.max);
}

static void choose_size(const supine_command_drawing *wanted, supine_picture *picture) {
  picture->width = wanted->width != 0 ? wanted->width : 20 + 440 * picture->panel_count;
  picture->height = wanted->height != 0 ? wanted->height : 120 + 480 * picture->view_count;
}

supine_panel supine_command_drawn_panel(const supine_command_drawing *wanted,
                                        const supine_command_drawn *shown, const char *title,
                                        const double gravity[3]) {
  supine_panel panel = {.title = title,
                        .subtitle = shown->subtitle,
                        .pose = &shown->pose,
                        .value = shown->value,
                        .marks = wanted->inside != NULL ? &shown->marks.marks : NULL};
  memcpy(panel.gravity, gravity, sizeof panel.gravity);
  return panel;
}

supine_picture supine_command_drawing_picture(const supine_command_drawing *wanted,
                                              const char *from, const double ends[2], size_t panels,
                                              char *label) {
  (void)snprintf(label, 128, "displacement from %s, mm", from);
  const double opacity = wanted->opacity > 0.0    ? wanted->opacity
                         : wanted->inside != NULL ? seen_through
                                                  : 1.0;
  supine_picture picture = {.panel_count = panels,
                            .view = wanted->view,
                            .view_count = wanted->view_count,
                            .heading = wanted->title,
                            .bar_label = label,
                            .colours = SUPINE_COLOURS_DISPLACEMENT,
                            .largest = wanted->largest > 0.0 ? wanted->largest
                                                             : supine_render_bar_end(ends[0]),
                            .transparency = 1.0 - opacity,
                            .dark = wanted->theme == 1};
  picture.beyond = ends[1] > picture.largest;
  choose_size(wanted, &picture);
  return picture;
}
