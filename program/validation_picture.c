/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw the lungs, coloured by the distance between predicted and scanned surface. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "program/validation_picture.h"

#include "base/vec3.h"
#include "program/view/render/render.h"

static void destroy(supine_renderer **renderer) {
  supine_render_destroy(*renderer);
}

supine_status supine_command_draw_errors(const supine_validation *s, const char *path,
                                         supine_error *error) {
  static const supine_view views[2] = {SUPINE_VIEW_ANTERIOR, SUPINE_VIEW_POSTERIOR};
  const size_t n = s->start.vertex_count;
  supine_panel panel[SUPINE_VALIDATION_STATES_MAX] = {{0}};
  char subtitle[SUPINE_VALIDATION_STATES_MAX][96];
  SUPINE_FREED_BY(destroy) supine_renderer *renderer = NULL;
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
    (void)snprintf(subtitle[count], sizeof subtitle[count], "%+.0f mL, RMS %.1f, Hausdorff %.1f mm",
                   outcome->millilitres, off->rms, off->largest);
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
  SUPINE_TRY(supine_render_create(s->basis, &renderer, error));
  return supine_render_picture_save(renderer, &picture, path, error);
}
