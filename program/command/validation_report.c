/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print the distances that a validation found, and draw those of the surface. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "program/command/validation_report.h"

#include "base/number.h"
#include "base/vec3.h"
#include "program/options/command.h"
#include "program/view/render/render.h"

static json_t *encode(const supine_validation_distance of[SUPINE_PATIENT_MAP_COUNT]) {
  json_t *all = json_object();
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT; ++k) {
    json_t *explained = isnan(of[k].explained) ? json_null() : json_real(100.0 * of[k].explained);
    (void)json_object_set_new(all, supine_validation_map_names[k],
                              json_pack("{s:f, s:f, s:f, s:f, s:o}", "mean_mm", of[k].mean,
                                        "rms_mm", of[k].rms, "p95_mm", of[k].p95, "largest_mm",
                                        of[k].largest, "explained_percent", explained));
  }
  return all;
}

static json_t *encode_state(const supine_validation_state *state,
                            const supine_validation_outcome *outcome) {
  json_t *root = json_object();
  if (state->path != NULL) {
    (void)json_object_set_new(root, "file", supine_options_json_text(state->path));
  }
  (void)json_object_update_new(root, json_pack("{s:o, s:f, s:f}", "gravity",
                                               supine_options_json_numbers(3, state->state.gravity),
                                               "scale", outcome->scale, "volume_ml",
                                               outcome->millilitres));
  if (outcome->has_surface) {
    (void)json_object_set_new(root, "surface", encode(outcome->surface));
  }
  if (outcome->has_points) {
    const supine_validation_distance *own = &outcome->points[SUPINE_PATIENT_MAP_PREDICTED];
    (void)json_object_set_new(root, "landmarks", encode(outcome->points));
    if (own->expected > 0.0) {
      (void)json_object_update_new(
          root, json_pack("{s:f, s:f, s:f}", "expected_rms_mm", own->expected, "expected_over_true",
                          own->expected / own->rms, "within_band_percent", 100.0 * own->within));
    }
  }
  if (outcome->has_best) {
    (void)json_object_update_new(root, json_pack("{s:f, s:f}", "nearest_scale", outcome->best_scale,
                                                 "nearest_rms", outcome->best_rms));
  }
  return root;
}

void supine_command_print_validation(const supine_validation *s) {
  json_t *states = json_array();
  for (size_t i = 0; i < s->count; ++i) {
    (void)json_array_append_new(states, encode_state(&s->state[i], &s->outcome[i]));
  }
  json_t *root = json_pack("{s:f, s:{s:f, s:f}, s:o}", "from_scale", s->from_scale, "paper",
                           "surface_mm", 2.0, "constants_percent", 1.0, "states", states);
  if (s->line_count > 1) {
    (void)json_object_set_new(root, "linearity",
                              json_pack("{s:i, s:f, s:f}", "states", (int)s->line_count,
                                        "scale_per_litre", 1e3 * s->line_slope, "off_percent",
                                        100.0 * s->line_off));
  }
  supine_options_print(root);
}

supine_status supine_command_draw_errors(const supine_validation *s, const char *path,
                                         supine_error *error) {
  static const supine_view views[2] = {SUPINE_VIEW_ANTERIOR, SUPINE_VIEW_POSTERIOR};
  const size_t n = s->start.vertex_count;
  supine_panel panel[SUPINE_VALIDATION_STATES_MAX] = {{0}};
  char subtitle[SUPINE_VALIDATION_STATES_MAX][96];
  double largest = 0.0;
  double bar_end = 1.0; /* the least upper end of the colour bar, mm */
  size_t count = 0;
  SUPINE_ARENA arena = {0};
  float *values = supine_arena_take(&arena, SUPINE_VALIDATION_STATES_MAX * n, sizeof *values);
  if (values == NULL) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  for (size_t i = 0; i < s->count; ++i) {
    const supine_validation_outcome *outcome = &s->outcome[i];
    if (!outcome->has_surface) {
      continue;
    }
    float *value = values + count * n; /* distance of each vertex from the scanned surface, mm */
    for (size_t k = 0; k < n; ++k) {
      const double off = supine_distance(outcome->predicted + 3 * k, outcome->nearest + 3 * k);
      value[k] = (float)off;
      largest = fmax(largest, off);
    }
    const supine_validation_distance *off = &outcome->surface[SUPINE_PATIENT_MAP_PREDICTED];
    bar_end = fmax(bar_end, off->p95);
    (void)supine_print_text(subtitle[count], sizeof subtitle[count],
                            "%+.0f mL, RMS %.1f, Hausdorff %.1f mm", outcome->millilitres, off->rms,
                            off->largest);
    panel[count] =
        (supine_panel){.title = s->state[i].text[0] != '\0' ? s->state[i].text : s->state[i].path,
                       .subtitle = subtitle[count],
                       .pose = &outcome->pose,
                       .value = value};
    memcpy(panel[count].gravity, s->state[i].state.gravity, sizeof panel[count].gravity);
    ++count;
  }
  supine_picture picture = {.panel = panel,
                            .panel_count = count,
                            .view = views,
                            .view_count = 2,
                            .bar_label = "distance of the prediction from the scan, mm",
                            .colours = SUPINE_COLOURS_DIFFERENCE,
                            .largest = supine_render_bar_end(bar_end),
                            .width = 20 + 440 * count,
                            .height = 120 + 480 * 2};
  picture.beyond = largest > picture.largest;
  return supine_render_picture_save(s->basis, &picture, path, error);
}
