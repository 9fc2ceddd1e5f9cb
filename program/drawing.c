/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the states of the lungs that pictures show, and fill the pictures. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "program/drawing.h"

static const char name[] = "render";
static const double inside_opacity = 0.35; /* default opacity of the lungs with --inside */

supine_status supine_command_studio_open(supine_command_studio *studio, supine_error *error) {
  supine_status status = supine_compare_create(studio->basis, &studio->compare, error);
  if (status == SUPINE_OK) {
    status = supine_render_create(studio->basis, &studio->renderer, error);
  }
  if (status == SUPINE_OK && studio->wanted->inside != NULL) {
    status = supine_command_inside_open(studio->basis, studio->wanted->inside, &studio->inside,
                                        &studio->names, error);
  }
  return status;
}

void supine_command_studio_close(supine_command_studio *studio) {
  supine_command_names_close(&studio->names);
  supine_basis_close(studio->inside);
  supine_render_destroy(studio->renderer);
  supine_compare_destroy(studio->compare);
}

supine_status supine_command_drawn_find(supine_command_studio *studio,
                                        const supine_posture_item *item,
                                        supine_command_drawn *found, supine_error *error) {
  const supine_status status = supine_options_pose(studio->basis, name, &studio->wanted->volume,
                                                   item->gravity, &found->pose, error);
  if (status != SUPINE_OK) {
    return status;
  }
  supine_distance_statistics statistics;
  supine_compare_distances(studio->compare, &found->pose, &studio->from->pose, found->value);
  supine_compare_statistics(studio->compare, found->value, &statistics);
  studio->ends[0] = fmax(studio->ends[0], statistics.p95);
  studio->ends[1] = fmax(studio->ends[1], statistics.max);
  double held[SUPINE_LUNGS_MAX];
  double volume = 0.0;
  supine_basis_volumes(studio->basis, &found->pose, held);
  for (size_t lung = 0; lung < supine_basis_get_info(studio->basis)->lung_count; ++lung) {
    volume += held[lung];
  }
  (void)snprintf(found->subtitle, sizeof found->subtitle, "%.0f mL, mean %.1f, max %.1f mm", volume,
                 statistics.mean, statistics.max);
  return SUPINE_OK;
}

supine_status supine_command_drawn_mark(const supine_command_studio *studio,
                                        supine_command_drawn *found, supine_error *error) {
  return studio->inside == NULL
             ? SUPINE_OK
             : supine_command_marks_make(studio->inside, &studio->names, &found->pose,
                                         &studio->from->pose, &found->marks, error);
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

supine_picture supine_command_drawing_picture(const supine_command_studio *studio,
                                              const supine_panel *panels, size_t count,
                                              char *label) {
  const supine_command_drawing *wanted = studio->wanted;
  const double opacity = wanted->opacity > 0.0    ? wanted->opacity
                         : wanted->inside != NULL ? inside_opacity
                                                  : 1.0;
  const double largest =
      wanted->largest > 0.0 ? wanted->largest : supine_render_bar_end(studio->ends[0]);
  (void)snprintf(label, 128, "displacement from %s, mm", studio->from->name);
  return (supine_picture){.panel = panels,
                          .panel_count = count,
                          .view = wanted->view,
                          .view_count = wanted->view_count,
                          .bar_label = label,
                          .colours = SUPINE_COLOURS_DISPLACEMENT,
                          .largest = largest,
                          .beyond = studio->ends[1] > largest,
                          .transparency = 1.0 - opacity,
                          .dark = wanted->theme == 1,
                          .width = wanted->width != 0 ? wanted->width : 20 + 440 * count,
                          .height = wanted->height != 0 ? wanted->height
                                                        : 120 + 480 * wanted->view_count};
}
