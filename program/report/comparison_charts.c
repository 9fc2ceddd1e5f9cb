/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the chart of the expansion by height, for profile.html. */
#include <math.h>

#include "base/locale.h"
#include "program/report/comparison.h"
#include "program/view/render/render.h"

json_t *supine_report_line(const supine_comparison *c, size_t posture) {
  static const char *const dashes[] = {"none", "7 3", "2 3", "9 3 2 3"}; /* as stroke-dasharray */
  return json_pack("{s:s, s:o, s:s}", "name", c->posture[posture].label, "line",
                   json_sprintf("#%06x", supine_render_palette(SUPINE_PALETTE_POSTURES, posture)),
                   "dash", dashes[posture % (sizeof dashes / sizeof *dashes)]);
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
    json_t *line = supine_report_line(c, i);
    (void)json_object_set_new(line, "dots", dots);
    (void)json_array_append_new(lines, line);
  }
  return json_pack("{s:s, s:o, s:o}", "axis", "regional expansion, %", "ticks", ticks, "lines",
                   lines);
}
