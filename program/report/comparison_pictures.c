/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Heat-map pictures of each lung for the HTML report. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/export/base64.h"
#include "program/options/basis_input.h"
#include "program/render/render.h"
#include "program/report/comparison_parts.h"

enum { WIDTH = 360, HEIGHT = 330, VIEWS_MAX = 1 + SUPINE_LUNGS_MAX };

/* A row of pictures: both lungs from the front, or one from its own side. */
typedef struct look {
  supine_view view;
  bool one_lung;
  size_t lung;
  char title[64];
  double extent[4];
} look;

static size_t choose_looks(const supine_comparison *c, look *looks) {
  const size_t lungs = supine_basis_get_info(c->basis)->lung_count;
  looks[0] = (look){.view = SUPINE_VIEW_ANTERIOR, .title = "from the front"};
  for (size_t lung = 0; lung < lungs; ++lung) {
    const char *name = supine_basis_get_info(c->basis)->lung_names[lung];
    look *own = &looks[1 + lung];
    *own = (look){.view = strcmp(name, "right") == 0 ? SUPINE_VIEW_RIGHT : SUPINE_VIEW_LEFT,
                  .one_lung = true,
                  .lung = lung};
    (void)snprintf(own->title, sizeof own->title, "%s lung from %s", name,
                   own->view == SUPINE_VIEW_RIGHT ? "the right" : "the left");
  }
  return 1 + lungs;
}

static supine_scene make_scene(const supine_comparison *c, const look *from, size_t posture) {
  return (supine_scene){.pose = &c->posture[posture].pose,
                        .view = from->view,
                        .one_lung = from->one_lung,
                        .lung = from->lung,
                        .width = WIDTH,
                        .height = HEIGHT,
                        .extent = from->extent};
}

static json_t *encoded(const void *bytes, size_t size) {
  char *text = NULL;
  size_t length = 0;
  FILE *file = open_memstream(&text, &length);
  if (file == NULL) {
    return NULL;
  }
  supine_export_base64_write(bytes, size, file);
  json_t *made = fclose(file) == 0 ? json_stringn_nocheck(text, length) : NULL;
  free(text);
  return made;
}

/* Names of the picture's four sides. */
static json_t *ends(supine_view view) {
  static const char *const letters[3][2] = {{"L", "R"}, {"P", "A"}, {"H", "F"}};
  static const char *const sides[2][2] = {{"right", "left"}, {"top", "bottom"}};
  double axes[3][3];
  json_t *list = json_array();
  supine_render_view_axes(view, axes);
  for (int row = 0; row < 2; ++row) {
    for (int axis = 0; axis < 3; ++axis) {
      for (int end = 0; end < 2 && fabs(axes[row][axis]) > 0.5; ++end) {
        const int letter = axes[row][axis] > 0 ? end : 1 - end;
        (void)json_array_append_new(list, json_pack("{s:s, s:s}", "side", sides[row][end], "letter",
                                                    letters[axis][letter]));
      }
    }
  }
  return list;
}

/* Gravity relative to the viewer: an arrow at `along` degrees, `towards` the viewer, or `away`. */
static void set_gravity(supine_view view, const double g[3], json_t *shot) {
  double axes[3][3];
  double seen[3] = {0.0, 0.0, 0.0};
  supine_render_view_axes(view, axes);
  for (int row = 0; row < 3; ++row) {
    for (int axis = 0; axis < 3; ++axis) {
      seen[row] += axes[row][axis] * g[axis];
    }
  }
  if (hypot(seen[0], seen[1]) > 0.35) { /* turned so that it points down */
    (void)json_object_set_new(
        shot, "turn", json_sprintf("%.1f", 90 + atan2(seen[1], seen[0]) * 180.0 / acos(-1.0)));
    (void)json_object_set_new(shot, "along",
                              json_sprintf("%.1f", -atan2(seen[1], seen[0]) * 180.0 / acos(-1.0)));
  } else {
    (void)json_object_set_new(shot, seen[2] > 0.0 ? "towards" : "away", json_true());
  }
}

static json_t *picture(const supine_comparison *c, supine_renderer *renderer, const look *from,
                       size_t posture, double largest, float *value, supine_error *error) {
  const supine_compared_posture *shown = &c->posture[posture];
  unsigned char *png = NULL;
  size_t size = 0;
  supine_scene scene = make_scene(c, from, posture);
  supine_compare_distances(c->compare, &shown->pose, &c->reference.pose, value);
  scene.value = value;
  scene.largest = largest;
  scene.line_step = supine_render_bar_step(largest);
  json_t *made = NULL;
  if (supine_render_png(renderer, &scene, &png, &size, error) == SUPINE_OK) {
    made = json_pack("{s:s, s:o, s:o, s:o}", "name",
                     supine_options_posture_label(c->postures.item[posture].name), "png",
                     encoded(png, size), "ends", ends(from->view), "points",
                     supine_report_direction(c->postures.item[posture].gravity));
    set_gravity(from->view, c->postures.item[posture].gravity, made);
  }
  free(png);
  return made;
}

/* Draw every posture from one side on one scale; NULL on failure. */
static json_t *row(const supine_comparison *c, supine_renderer *renderer, look *from,
                   double largest, float *value, supine_error *error) {
  static const double none[4] = SUPINE_EXTENT_NONE;
  json_t *images = json_array();
  memcpy(from->extent, none, sizeof none);
  for (size_t i = 0; i < c->postures.count; ++i) {
    const supine_scene scene = make_scene(c, from, i);
    supine_render_extent(renderer, &scene, from->extent);
  }
  for (size_t i = 0; i < c->postures.count; ++i) {
    if (json_array_append_new(images, picture(c, renderer, from, i, largest, value, error)) != 0) {
      json_decref(images);
      return NULL;
    }
  }
  return json_pack("{s:s, s:o}", "view", from->title, "cells", images);
}

json_t *supine_report_pictures(const supine_comparison *c, supine_error *error) {
  look looks[VIEWS_MAX];
  const size_t count = choose_looks(c, looks);
  double p95 = 0.0;
  double most = 0.0;
  supine_renderer *renderer = NULL;
  json_t *rows = json_array();
  json_t *pictures = NULL;
  float *value = malloc(supine_basis_get_info(c->basis)->vertex_count * sizeof *value);
  *error = (supine_error){SUPINE_ERROR_MEMORY, "out of memory"};
  if (value == NULL || supine_render_create(c->basis, &renderer, error) != SUPINE_OK) {
    goto cleanup;
  }
  for (size_t i = 0; i < c->postures.count; ++i) {
    const double here = c->posture[i].displacement.p95;
    p95 = here > p95 ? here : p95;
    most = c->posture[i].displacement.max > most ? c->posture[i].displacement.max : most;
  }
  const double largest = supine_render_bar_end(p95);
  for (size_t i = 0; i < count; ++i) {
    if (json_array_append_new(rows, row(c, renderer, &looks[i], largest, value, error)) != 0) {
      goto cleanup;
    }
  }
  char words[192];
  (void)snprintf(words, sizeof words, "displacement from %s, mm; lines at the ticks%s",
                 c->reference.name,
                 most > largest ? "; the last colour also shows what lies beyond" : "");
  pictures = supine_report_bar(SUPINE_COLOURS_DISPLACEMENT, largest, most > largest, words);
  (void)json_object_set_new(pictures, "widest", json_integer(WIDTH));
  json_t *front = json_pack("[O]", json_array_get(rows, 0));
  (void)json_array_remove(rows, 0);
  (void)json_object_set_new(pictures, "parts", supine_report_parts(c, front));
  (void)json_object_set_new(pictures, "sides", supine_report_parts(c, json_incref(rows)));
cleanup:
  json_decref(rows);
  supine_render_destroy(renderer);
  free(value);
  return pictures;
}
