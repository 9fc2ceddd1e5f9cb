/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the charts of the HTML report: the expansion by height, for profile.html, and the outlines
 * of the lungs in four slices, for outline.html. */
#include <math.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/locale.h"
#include "base/number.h"

#include "program/report/comparison.h"
#include "program/view/render/render.h"

/* These colours can be told apart with any colour vision (M. Okabe and K. Ito, 2008). */
const char *supine_report_line(size_t posture) {
  static const char *const lines[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                      "#56b4e9", "#e69f00", "#8c8c8c"};
  return lines[posture % (sizeof lines / sizeof *lines)];
}

/* Return the regional expansion of a slab, %. */
static double percent(const supine_comparison *c, size_t posture, size_t slab) {
  return 100.0 * supine_report_expansion(&c->posture[posture].slab[slab]);
}

/* Edges of the plot in profile.html, SVG units. */
enum { LEFT = 46, RIGHT = 404, TOP = 14, BOTTOM = 286 };

static double across(double value, double low, double high) {
  return LEFT + (RIGHT - LEFT) * (value - low) / (high - low);
}

static double down(double height) {
  return BOTTOM - (BOTTOM - TOP) * height / 100.0;
}

json_t *supine_report_profile(const supine_comparison *c) {
  SUPINE_C_LOCALE;
  double low = 0.0;
  double high = 0.0;
  for (size_t i = 0; i < c->postures.count; ++i) {
    for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
      low = fmin(low, percent(c, i, s));
      high = fmax(high, percent(c, i, s));
    }
  }
  const double step = supine_render_bar_step(high - low);
  low = step * floor(low / step);
  high = step * fmax(1.0 + low / step, ceil(high / step));
  json_t *ticks = json_array();
  json_t *lines = json_array();
  for (int i = 0; low + i * step <= high + 1e-9 * step; ++i) {
    (void)json_array_append_new(
        ticks, json_pack("{s:o, s:o}", "x", json_sprintf("%.1f", across(low + i * step, low, high)),
                         "value", json_sprintf("%g", low + i * step)));
  }
  for (size_t i = 0; i < c->postures.count; ++i) {
    if (!c->posture[i].has_breath) {
      continue;
    }
    json_t *dots = json_array();
    for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
      const double value = percent(c, i, s);
      (void)json_array_append_new(
          dots, json_pack("{s:o, s:o, s:o}", "x", json_sprintf("%.1f", across(value, low, high)),
                          "y", json_sprintf("%.1f", down(95.0 - 10.0 * (double)s)), "value",
                          json_sprintf("%.2f", value)));
    }
    (void)json_array_append_new(lines, json_pack("{s:s, s:s, s:b, s:o}", "line",
                                                 supine_report_line(i), "name", c->posture[i].label,
                                                 "dashed", (int)(i >= 7), "dots", dots));
  }
  return json_pack("{s:s, s:o, s:o}", "axis", "regional expansion, %", "ticks", ticks, "lines",
                   lines);
}

/* A slice, seen from the feet or from the front: the patient's left is on the right. */
typedef struct slice {
  const char *name;
  size_t axis;     /* axis normal to the slice */
  double share;    /* position along `axis`, as a fraction of the lungs' extent */
  size_t vertical; /* axis that is vertical in the picture */
  double sign;     /* 1 if `vertical` points down, -1 if it points up */
} slice;

static const slice slices[] = {{"Axial, upper third", 2, 2.0 / 3, 1, 1},
                               {"Axial, lower third", 2, 1.0 / 3, 1, 1},
                               {"Coronal, front third", 1, 1.0 / 3, 2, -1},
                               {"Coronal, back third", 1, 2.0 / 3, 2, -1}};

/* Compute the point where the edge from `a` to `b` crosses the slice at the coordinate `at`, mm. */
static void cross(const slice *s, double at, const float *a, const float *b, double point[2]) {
  const double t = (at - (double)a[s->axis]) / ((double)b[s->axis] - (double)a[s->axis]);
  point[0] = (double)a[0] + t * ((double)b[0] - (double)a[0]);
  const size_t v = s->vertical;
  point[1] = s->sign * ((double)a[v] + t * ((double)b[v] - (double)a[v]));
}

/* Print the outline as an SVG path, with a line for each triangle that the slice crosses. Return
 * the area inside the outline, mm^2. */
static double trace(const supine_basis_info *info, const slice *s, double at, const float *xyz,
                    FILE *path) {
  double twice = 0;
  for (size_t t = 0; t < info->triangle_count; ++t) {
    double up[2] = {NAN, NAN}; /* point where the triangle's boundary rises through the plane */
    double down[2] = {0, 0};
    for (size_t i = 0; i < 3; ++i) {
      const float *a = xyz + 3 * (size_t)info->triangles[3 * t + i];
      const float *b = xyz + 3 * (size_t)info->triangles[3 * t + (i + 1) % 3];
      const bool above[2] = {(double)a[s->axis] > at, (double)b[s->axis] > at};
      if (above[0] != above[1]) {
        cross(s, at, a, b, above[1] ? up : down);
      }
    }
    if (!isnan(up[0])) {
      twice += up[0] * down[1] - down[0] * up[1];
      (void)supine_print(path, "M%.1f %.1fL%.1f %.1f", up[0], up[1], down[0], down[1]);
    }
  }
  return fabs(twice) / 2;
}

/* Return the outline of the lungs in a pose as an SVG path; set `area` to the area inside, mm^2. */
static json_t *outline(const supine_comparison *c, const slice *s, double at,
                       const supine_pose *pose, float *xyz, double *area) {
  char *text = NULL;
  size_t size = 0;
  FILE *path = open_memstream(&text, &size);
  if (path == NULL) {
    return json_string("");
  }
  (void)supine_deform(c->basis, pose, xyz);
  *area = trace(supine_basis_get_info(c->basis), s, at, xyz, path);
  json_t *made = fclose(path) == 0 ? json_string(text) : json_string("");
  free(text);
  return made;
}

static json_t *letter(double x, double y, const char *name) {
  SUPINE_C_LOCALE;
  return json_pack("{s:o, s:o, s:s}", "x", json_sprintf("%.0f", x), "y", json_sprintf("%.0f", y),
                   "letter", name);
}

/* Return the chart of a slice; its title states how each posture changes the area. */
static json_t *chart(const supine_comparison *c, const slice *s, const double low[3],
                     const double high[3], float *xyz) {
  SUPINE_C_LOCALE;
  enum { MARGIN = 18, SCALE_BAR = 50 }; /* mm */
  const double at = low[s->axis] + s->share * (high[s->axis] - low[s->axis]);
  const double top = s->sign > 0 ? low[s->vertical] : -high[s->vertical];
  const double bottom = s->sign > 0 ? high[s->vertical] : -low[s->vertical];
  const double middle = (top + bottom) / 2;
  double before = 0;
  json_t *path = outline(c, s, at, &c->reference.pose, xyz, &before);
  json_t *lines = json_array();
  json_t *title = json_sprintf("%s: area", s->name);
  for (size_t i = 0; i < c->postures.count; ++i) {
    const char *name = c->posture[i].label;
    double area = 0;
    json_t *own = outline(c, s, at, &c->posture[i].pose, xyz, &area);
    if (c->posture[i].displacement.max < 0.05) { /* this posture is the reference */
      json_decref(own);
      continue;
    }
    (void)json_array_append_new(lines, json_pack("{s:s, s:s, s:o}", "line", supine_report_line(i),
                                                 "name", name, "path", own));
    json_t *longer =
        json_sprintf("%s%s %s %+.0f %%", json_string_value(title),
                     json_array_size(lines) > 1 ? "," : "", name, 100 * (area / before - 1));
    json_decref(title);
    title = longer;
  }
  return json_pack(
      "{s:o, s:o, s:o, s:o, s:o, s:[o, o, o, o]}", "title", title, "box",
      json_sprintf("%.0f %.0f %.0f %.0f", low[0] - MARGIN, top - MARGIN,
                   high[0] - low[0] + 2 * MARGIN, bottom - top + 2 * MARGIN + 10),
      "before", path, "lines", lines, "mark",
      json_sprintf("M%.0f %.0fh%d", low[0] - MARGIN + 2, bottom + MARGIN + 6, SCALE_BAR), "letters",
      letter(high[0] + 10, middle, "L"), letter(low[0] - 10, middle, "R"),
      letter((low[0] + high[0]) / 2, top - 10, s->axis == 2 ? "A" : "H"),
      letter((low[0] + high[0]) / 2, bottom + 10, s->axis == 2 ? "P" : "F"));
}

json_t *supine_report_outlines(const supine_comparison *c) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  SUPINE_ARENA arena = {0};
  float *xyz = supine_arena_take(&arena, info->vertex_count, 3 * sizeof *xyz);
  json_t *list = json_array();
  if (arena.failed) {
    return list;
  }
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)supine_deform(c->basis, &c->posture[i].pose, xyz);
    supine_render_box(xyz, info->vertex_count, low, high);
  }
  for (size_t i = 0; i < sizeof slices / sizeof *slices; ++i) {
    (void)json_array_append_new(list, chart(c, &slices[i], low, high, xyz));
  }
  return list;
}
