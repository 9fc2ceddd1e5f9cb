/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Heat-map pictures of each lung for the HTML report. */
#include <stdlib.h>
#include <string.h>

#include "runtime/export/base64.h"
#include "runtime/options/basis_input.h"
#include "runtime/render/render.h"
#include "runtime/report/comparison_html.h"

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
    char name[32];
    supine_options_basis_lung_name(c->basis, lung, name, sizeof name);
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
  return (supine_scene){.weights = c->posture[posture].weights,
                        .scales = c->posture[posture].scales,
                        .view = from->view,
                        .one_lung = from->one_lung,
                        .lung = from->lung,
                        .width = WIDTH,
                        .height = HEIGHT,
                        .extent = from->extent};
}

static supine_status picture(const supine_comparison *c, supine_renderer *renderer,
                             const look *from, size_t posture, double largest, const float *value,
                             FILE *file, supine_error *error) {
  unsigned char *png = NULL;
  size_t size = 0;
  supine_scene scene = make_scene(c, from, posture);
  scene.value = value;
  scene.largest = largest;
  scene.line_step = supine_render_bar_step(largest);
  const supine_status status = supine_render_png(renderer, &scene, &png, &size, error);
  if (status == SUPINE_OK) {
    (void)fputs("<img alt=\"", file);
    supine_report_html_text(c->postures.item[posture].name, file);
    (void)fputs(", ", file);
    supine_report_html_text(from->title, file);
    (void)fputs("\" src=\"data:image/png;base64,", file);
    supine_export_base64_write(png, size, file);
    (void)fputs("\"/>\n", file);
  }
  free(png);
  return status;
}

static void bar(double largest, FILE *file) {
  const double step = supine_render_bar_step(largest);
  (void)fputs("<div style=\"max-width:520px;margin:14px auto 0\"><div class=\"bar\" "
              "style=\"background:linear-gradient(90deg",
              file);
  for (int i = 0; i <= 16; ++i) {
    char hex[8];
    supine_report_html_colour(i / 16.0, hex);
    (void)fprintf(file, ",%s", hex);
  }
  (void)fputs(")\"></div><div class=\"ticks\">", file);
  for (int i = 0; i * step <= largest * (1.0 + 1e-9); ++i) {
    (void)fprintf(file, "<span>%g</span>", i * step);
  }
  (void)fputs(
      "</div><p class=\"note\" style=\"text-align:center\">displacement from rest, mm; lines "
      "at the ticks; the last colour also shows what lies beyond</p></div>\n",
      file);
}

static supine_status pictures(const supine_comparison *c, supine_renderer *renderer, float *value,
                              FILE *file, supine_error *error) {
  look looks[VIEWS_MAX];
  const size_t count = choose_looks(c, looks);
  double p95 = 0.0;
  supine_status status = SUPINE_OK;
  for (size_t i = 0; i < c->postures.count; ++i) {
    const double here = c->posture[i].displacement.p95;
    p95 = here > p95 ? here : p95;
  }
  const double largest = supine_render_bar_end(p95);
  (void)fprintf(file,
                "<div class=\"pictures\" style=\"grid-template-columns:repeat(%zu,"
                "minmax(130px,1fr))\">\n",
                c->postures.count);
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)fputs("<b>", file);
    supine_report_html_text(c->postures.item[i].name, file);
    (void)fputs("</b>\n", file);
  }
  for (size_t row = 0; row < count && status == SUPINE_OK; ++row) {
    static const double none[4] = SUPINE_EXTENT_NONE;
    memcpy(looks[row].extent, none, sizeof none);
    for (size_t i = 0; i < c->postures.count; ++i) {
      const supine_scene scene = make_scene(c, &looks[row], i);
      supine_render_extent(renderer, &scene, looks[row].extent);
    }
    (void)fputs("<span class=\"note\" style=\"grid-column:1/-1\">", file);
    supine_report_html_text(looks[row].title, file);
    (void)fputs("</span>\n", file);
    for (size_t i = 0; i < c->postures.count && status == SUPINE_OK; ++i) {
      supine_compare_distances(c->compare, c->posture[i].weights, c->posture[i].scales, NULL, NULL,
                               value);
      status = picture(c, renderer, &looks[row], i, largest, value, file, error);
    }
  }
  (void)fputs("</div>\n", file);
  bar(largest, file);
  return status;
}

void supine_report_html_pictures(const supine_comparison *c, FILE *file) {
  supine_renderer *renderer = NULL;
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  float *value = malloc(supine_basis_get_info(c->basis)->vertex_count * sizeof *value);
  if (value == NULL || supine_render_create(c->basis, &renderer, &error) != SUPINE_OK ||
      pictures(c, renderer, value, file, &error) != SUPINE_OK) {
    (void)fputs("<p class=\"note\">No pictures: ", file);
    supine_report_html_text(error.message, file);
    (void)fputs(".</p>\n", file);
  }
  supine_render_destroy(renderer);
  free(value);
}
