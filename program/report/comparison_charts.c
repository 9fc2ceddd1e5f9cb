/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the charts of the report: coordinates of lines, dots and cells for the templates
 * profile.html and map.html. */
#include <math.h>

#include <supine/posture.h>

#include "base/vec3.h"

#include "program/report/comparison_parts.h"
#include "program/view/render/render.h"

static const double pi = 3.14159265358979323846;

/* Return a slab's share of the breath, %, if `share` is true; otherwise its expansion, %. */
static double percent(const supine_comparison *c, bool share, size_t posture, size_t slab) {
  const supine_compared_posture *p = &c->posture[posture];
  return 100.0 * (share ? p->share : p->expansion)[slab];
}

/* Edges of the plot in profile.html, SVG units. */
enum { LEFT = 46, RIGHT = 404, TOP = 14, BOTTOM = 286 };

static double across(double value, double low, double high) {
  return LEFT + (RIGHT - LEFT) * (value - low) / (high - low);
}

static double down(double height) {
  return BOTTOM - (BOTTOM - TOP) * height / 100.0;
}

static json_t *profile(const supine_comparison *c, const char *axis, bool share) {
  double low = 0.0;
  double high = 0.0;
  for (size_t i = 0; i < c->postures.count; ++i) {
    for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
      low = fmin(low, percent(c, share, i, s));
      high = fmax(high, percent(c, share, i, s));
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
      const double value = percent(c, share, i, s);
      (void)json_array_append_new(
          dots, json_pack("{s:o, s:o, s:o}", "x", json_sprintf("%.1f", across(value, low, high)),
                          "y", json_sprintf("%.1f", down(95.0 - 10.0 * (double)s)), "value",
                          json_sprintf("%.2f", value)));
    }
    (void)json_array_append_new(
        lines, json_pack("{s:s, s:s, s:b, s:o}", "line", supine_report_line(i), "name",
                         supine_options_posture_label(c->postures.item[i].name), "dashed",
                         (int)(i >= 7), "dots", dots));
  }
  return json_pack("{s:s, s:o, s:o, s:o}", "axis", axis, "title",
                   supine_report_profile_finding(c, share), "ticks", ticks, "lines", lines);
}

json_t *supine_report_profiles(const supine_comparison *c) {
  return json_pack("[o, o]", profile(c, "regional expansion, %", false),
                   profile(c, "share of the volume gained, %", true));
}

/* Size of the map in cells; side of a cell and position of the map in map.html, SVG units. */
enum { COLUMNS = 60, ROWS = 30, CELL = 13, MAP_LEFT = 66, MAP_TOP = 8 };

/* Compute the position of a direction of gravity on the map, SVG units. The roll increases from
 * left to right: prone, right side, supine, left side, prone. The tilt changes from head down at
 * the top to feet down at the bottom. */
static void place(const double g[3], double *x, double *y) {
  const double roll = atan2(g[0], g[1]) / pi; /* in half turns: 0 supine, 1/2 left side */
  const double tilt = asin(fmin(1.0, fmax(-1.0, g[2]))) / pi;
  *x = MAP_LEFT + COLUMNS * CELL * (0.5 + roll / 2.0);
  *y = MAP_TOP + ROWS * CELL * (0.5 - tilt);
}

static json_t *map_cells(const supine_comparison *c) {
  json_t *cells = json_array();
  for (int row = 0; row < ROWS; ++row) {
    for (int column = 0; column < COLUMNS; ++column) {
      const double roll = 2.0 * pi * ((column + 0.5) / COLUMNS - 0.5);
      const double tilt = pi * (0.5 - (row + 0.5) / ROWS);
      const double g[3] = {cos(tilt) * sin(roll), cos(tilt) * cos(roll), sin(tilt)};
      const double rms = supine_report_from_supine(c, g);
      if (!isnan(rms)) {
        (void)json_array_append_new(
            cells, json_pack("{s:o, s:i, s:i}", "hex",
                             supine_report_hex(
                                 SUPINE_COLOURS_DIFFERENCE,
                                 c->farthest_rms > 0.0 ? fmin(1.0, rms / c->farthest_rms) : 0.0),
                             "x", MAP_LEFT + column * CELL, "y", MAP_TOP + row * CELL));
      }
    }
  }
  return cells;
}

json_t *supine_report_map(const supine_comparison *c) {
  json_t *dots = json_array();
  for (size_t i = 0; i < c->postures.count; ++i) {
    double x;
    double y;
    place(c->postures.item[i].state.gravity, &x, &y);
    (void)json_array_append_new(
        dots, json_pack("{s:o, s:o, s:s, s:s}", "x", json_sprintf("%.1f", x), "y",
                        json_sprintf("%.1f", y), "line", supine_report_line(i), "name",
                        supine_options_posture_label(c->postures.item[i].name)));
  }
  return json_pack("{s:o, s:o}", "cells", map_cells(c), "dots", dots);
}

json_t *supine_report_direction(const double g[3]) {
  const char *name = "";
  double nearest = -2.0;
  for (size_t i = 0; i < supine_posture_count(); ++i) {
    double named[3];
    (void)supine_posture_gravity(supine_posture_name(i), named);
    const double cosine = supine_dot(named, g);
    /* On a tie, keep the first posture: the list has names before DICOM codes. */
    if (cosine > nearest + 1e-9) {
      nearest = cosine;
      name = supine_posture_name(i);
    }
  }
  const double degrees = acos(fmin(1.0, nearest)) * 180.0 / pi;
  if (degrees < 0.5) {
    return json_string(name);
  }
  return json_sprintf("%.0f° from %s (%.2f:%.2f:%.2f)", degrees, name, g[0] + 0.0, g[1] + 0.0,
                      g[2] + 0.0);
}
