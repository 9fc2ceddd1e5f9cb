/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw the postures from the front for the HTML report. */
#include <math.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/locale.h"
#include "program/report/comparison.h"
#include "program/view/export/template.h"
#include "program/view/render/render.h"

enum { WIDTH = 360, HEIGHT = 330 };

static supine_scene make_scene(const supine_comparison *c, size_t posture, const double extent[4]) {
  return (supine_scene){.pose = &c->posture[posture].pose,
                        .view = SUPINE_VIEW_ANTERIOR,
                        .width = WIDTH,
                        .height = HEIGHT,
                        .extent = extent};
}

/* Draw a scene and return it as PNG in base64, or NULL on failure. */
static json_t *draw(const supine_basis *basis, const supine_scene *scene, supine_error *error) {
  char *bytes = NULL;
  size_t size = 0;
  FILE *file = open_memstream(&bytes, &size);
  const bool drawn = file != NULL && supine_render_png(basis, scene, file, error) == SUPINE_OK;
  json_t *made = NULL;
  if (file != NULL && fclose(file) == 0 && drawn) {
    made = supine_template_base64(bytes, size);
  }
  free(bytes);
  return made;
}

/* Add the direction of gravity to `shot`, the data of a picture. {{along}} is the angle of gravity
 * in the picture, degrees clockwise from the right. {{turn}} is the clockwise rotation of the
 * picture, degrees, after which gravity points down. If gravity is nearly normal to the picture,
 * {{towards}} or {{away}} replaces both. */
static void set_gravity(const double g[3], json_t *shot) {
  SUPINE_C_LOCALE;
  const double seen[3] = {g[0], g[2], -g[1]}; /* right, up, towards the viewer in front */
  if (hypot(seen[0], seen[1]) > 0.35) {
    (void)json_object_set_new(
        shot, "turn", json_sprintf("%.1f", 90 + atan2(seen[1], seen[0]) * 180.0 / acos(-1.0)));
    (void)json_object_set_new(shot, "along",
                              json_sprintf("%.1f", -atan2(seen[1], seen[0]) * 180.0 / acos(-1.0)));
  } else {
    (void)json_object_set_new(shot, seen[2] > 0.0 ? "towards" : "away", json_true());
  }
}

static json_t *picture(const supine_comparison *c, size_t posture, double largest,
                       const double extent[4], float *value, supine_error *error) {
  const supine_compared_posture *shown = &c->posture[posture];
  supine_scene scene = make_scene(c, posture, extent);
  (void)supine_compare_distances(c->compare, &shown->pose, &c->reference.pose, value);
  scene.value = value;
  scene.largest = largest;
  json_t *png = draw(c->basis, &scene, error);
  if (png == NULL) {
    return NULL;
  }
  json_t *made = json_pack("{s:s, s:o}", "name", shown->label, "png", png);
  set_gravity(shown->item->state.gravity, made);
  return made;
}

/* Return the data of bar.html, a colour bar from 0 to `largest` with the caption `words`. */
static json_t *make_bar(double largest, const char *words) {
  SUPINE_C_LOCALE;
  enum { STOPS = 16 };
  const double step = supine_render_bar_step(largest);
  json_t *stops = json_array();
  json_t *ticks = json_array();
  for (int i = 0; i <= STOPS; ++i) {
    char digits[7];
    supine_render_hex(SUPINE_COLOURS_DISPLACEMENT, i / (double)STOPS, digits);
    (void)json_array_append_new(stops, json_sprintf("#%s", digits));
  }
  for (int i = 0; i * step <= largest * (1.0 + 1e-9); ++i) {
    (void)json_array_append_new(ticks, json_pack("{s:o, s:o}", "at",
                                                 json_sprintf("%.2f", 100.0 * i * step / largest),
                                                 "value", json_sprintf("%g", i * step)));
  }
  return json_pack("{s:o, s:o, s:s}", "stops", stops, "ticks", ticks, "words", words);
}

json_t *supine_report_pictures(const supine_comparison *c, supine_error *error) {
  enum { PER_ROW = 6 }; /* pictures side by side on a printed page */
  const size_t count = c->postures.count;
  const size_t rows = (count + PER_ROW - 1) / PER_ROW;
  double extent[4] = SUPINE_EXTENT_NONE;
  double most = 0.0;
  SUPINE_ARENA arena = {0};
  json_auto_t *cells = json_array();
  float *value =
      supine_arena_take(&arena, supine_basis_get_info(c->basis)->vertex_count, sizeof *value);
  *error = (supine_error){SUPINE_ERROR_MEMORY, "out of memory"};
  if (arena.failed) {
    return NULL;
  }
  for (size_t i = 0; i < count; ++i) {
    const supine_scene scene = make_scene(c, i, NULL);
    supine_render_extent(c->basis, &scene, extent);
    most = fmax(most, c->posture[i].displacement.max);
  }
  const double largest = supine_render_bar_end(most);
  for (size_t i = 0; i < count; ++i) {
    if (json_array_append_new(cells, picture(c, i, largest, extent, value, error)) != 0) {
      return NULL;
    }
  }
  char words[224];
  (void)snprintf(words, sizeof words,
                 "displacement from %s, mm; contour lines at the ticks of the bar",
                 c->reference.name);
  json_t *pictures = make_bar(largest, words);
  (void)json_object_set(pictures, "cells", cells);
  (void)json_object_set_new(pictures, "widest", json_integer(WIDTH));
  (void)json_object_set_new(pictures, "columns",
                            json_integer((json_int_t)((count + rows - 1) / rows)));
  return pictures;
}
