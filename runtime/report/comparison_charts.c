/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Charts of the HTML report, as SVG in the page, so that they follow its theme. */
#include <math.h>

#include "runtime/render/render.h"
#include "runtime/report/comparison_html.h"

static const double pi = 3.14159265358979323846;

/* What a profile shows of a slab, in %. */
typedef double slab_value(const supine_comparison *c, size_t posture, size_t slab);

static double expansion(const supine_comparison *c, size_t posture, size_t slab) {
  const supine_slab *s = &c->posture[posture].slab[slab];
  return s->volume > 0.0 ? 100.0 * s->gain / s->volume : 0.0;
}

static double share(const supine_comparison *c, size_t posture, size_t slab) {
  const double gain = supine_report_gain(c, posture);
  return gain != 0.0 ? 100.0 * c->posture[posture].slab[slab].gain / gain : 0.0;
}

/* The plot's box in the drawing of 420 x 330. */
enum { LEFT = 46, RIGHT = 404, TOP = 14, BOTTOM = 286 };

static double across(double value, double low, double high) {
  return LEFT + (RIGHT - LEFT) * (value - low) / (high - low);
}

static double down(double height) {
  return BOTTOM - (BOTTOM - TOP) * height / 100.0;
}

static void profile(const supine_comparison *c, const char *title, slab_value *value, FILE *file) {
  double low = 0.0;
  double high = 0.0;
  for (size_t i = 0; i < c->postures.count; ++i) {
    for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
      low = fmin(low, value(c, i, s));
      high = fmax(high, value(c, i, s));
    }
  }
  const double step = supine_render_bar_step(high - low);
  low = step * floor(low / step);
  high = step * fmax(1.0 + low / step, ceil(high / step));
  (void)fputs("<figure><svg viewBox=\"0 0 420 330\" role=\"img\" aria-label=\"", file);
  (void)fprintf(file, "%s\">\n", title);
  for (int height = 0; height <= 100; height += 20) {
    (void)fprintf(file,
                  "<line class=\"grid\" x1=\"%d\" y1=\"%.1f\" x2=\"%d\" y2=\"%.1f\"/>"
                  "<text class=\"faint\" x=\"%d\" y=\"%.1f\" text-anchor=\"end\">%d</text>\n",
                  LEFT, down(height), RIGHT, down(height), LEFT - 8, down(height) + 4, height);
  }
  for (int i = 0; low + i * step <= high + 1e-9 * step; ++i) {
    const double x = across(low + i * step, low, high);
    (void)fprintf(file,
                  "<line class=\"grid\" x1=\"%.1f\" y1=\"%d\" x2=\"%.1f\" y2=\"%d\"/>"
                  "<text class=\"faint\" x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%g</text>\n",
                  x, TOP, x, BOTTOM, x, BOTTOM + 17, low + i * step);
  }
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)fprintf(file,
                  "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"2.5\" "
                  "stroke-linejoin=\"round\"%s points=\"",
                  supine_report_html_line(i), i >= 7 ? " stroke-dasharray=\"6 4\"" : "");
    for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
      (void)fprintf(file, "%s%.1f,%.1f", s > 0 ? " " : "", across(value(c, i, s), low, high),
                    down(95.0 - 10.0 * (double)s));
    }
    (void)fputs("\"/>\n", file);
    for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
      (void)fprintf(file, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\" fill=\"%s\"><title>",
                    across(value(c, i, s), low, high), down(95.0 - 10.0 * (double)s),
                    supine_report_html_line(i));
      supine_report_html_text(c->postures.item[i].name, file);
      (void)fprintf(file, ": %.2f %%</title></circle>\n", value(c, i, s));
    }
  }
  (void)fprintf(file,
                "<text x=\"%d\" y=\"322\" text-anchor=\"middle\">%s</text>"
                "<text transform=\"translate(13 150) rotate(-90)\" text-anchor=\"middle\">height, "
                "%%</text>\n</svg></figure>\n",
                (LEFT + RIGHT) / 2, title);
}

void supine_report_html_profiles(const supine_comparison *c, FILE *file) {
  (void)fputs("<p>", file);
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)fprintf(file, "<span class=\"key\" style=\"background:%s\"></span>",
                  supine_report_html_line(i));
    supine_report_html_text(c->postures.item[i].name, file);
    (void)fputs("&#160;&#160; ", file);
  }
  (void)fputs("</p>\n<div class=\"row\">\n", file);
  profile(c, "regional expansion, %", expansion, file);
  profile(c, "share of the volume gained, %", share, file);
  (void)fputs("</div>\n", file);
}

/* RMS distance from supine in mm, or NaN where the inflation cannot be reached. */
static double from_supine(const supine_comparison *c, const double g[3]) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  double weights[2][SUPINE_MODES_MAX];
  double scales[2][SUPINE_LUNGS_MAX];
  const double *direction[2] = {supine, g};
  for (int side = 0; side < 2; ++side) {
    double scale = 0.0;
    if (supine_basis_weights(c->basis, direction[side], weights[side]) != SUPINE_OK ||
        supine_compare_scale(c->compare, &c->inflation, weights[side], &scale, NULL) != SUPINE_OK) {
      return NAN;
    }
    for (size_t lung = 0; lung < SUPINE_LUNGS_MAX; ++lung) {
      scales[side][lung] = scale;
    }
  }
  return supine_compare_rms(c->compare, weights[0], scales[0], weights[1], scales[1]);
}

enum { COLUMNS = 60, ROWS = 30, CELL = 13, MAP_LEFT = 66, MAP_TOP = 8 };

/* The map's place of a direction: across, rolling from right over supine and left to prone; down,
 * tilting from head down to feet down. */
static void place(const double g[3], double *x, double *y) {
  const double roll = atan2(g[0], g[1]) / pi; /* supine 0, left 1/2 */
  const double tilt = asin(fmin(1.0, fmax(-1.0, g[2]))) / pi;
  *x = MAP_LEFT + COLUMNS * CELL * (0.5 + roll / 2.0);
  *y = MAP_TOP + ROWS * CELL * (0.5 - tilt);
}

void supine_report_html_map(const supine_comparison *c, FILE *file) {
  static const char *const rolls[] = {"prone", "right", "supine", "left", "prone"};
  static const char *const tilts[] = {"inverted", "45&#176;", "level", "45&#176;", "upright"};
  (void)fprintf(file,
                "<figure><svg viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"distance from supine "
                "for every direction of gravity\" shape-rendering=\"crispEdges\">\n",
                MAP_LEFT + COLUMNS * CELL + 30, MAP_TOP + ROWS * CELL + 28);
  for (int row = 0; row < ROWS; ++row) {
    for (int column = 0; column < COLUMNS; ++column) {
      const double roll = 2.0 * pi * ((column + 0.5) / COLUMNS - 0.5);
      const double tilt = pi * (0.5 - (row + 0.5) / ROWS);
      const double g[3] = {cos(tilt) * sin(roll), cos(tilt) * cos(roll), sin(tilt)};
      const double rms = from_supine(c, g);
      char hex[8];
      if (!isnan(rms)) {
        supine_report_html_colour(
            c->extremes.farthest_rms > 0.0 ? rms / c->extremes.farthest_rms : 0.0, hex);
        (void)fprintf(file, "<path fill=\"%s\" d=\"M%d %dh%dv%dh-%dz\"/>\n", hex,
                      MAP_LEFT + column * CELL, MAP_TOP + row * CELL, CELL, CELL, CELL);
      }
    }
  }
  for (int i = 0; i < 5; ++i) {
    (void)fprintf(file,
                  "<text class=\"faint\" x=\"%d\" y=\"%d\" text-anchor=\"middle\">%s</text>"
                  "<text class=\"faint\" x=\"%d\" y=\"%d\" text-anchor=\"end\">%s</text>\n",
                  MAP_LEFT + i * COLUMNS * CELL / 4, MAP_TOP + ROWS * CELL + 18, rolls[i],
                  MAP_LEFT - 6, MAP_TOP + 8 + i * (ROWS * CELL - 8) / 4, tilts[i]);
  }
  for (size_t i = 0; i < c->postures.count; ++i) {
    double x;
    double y;
    place(c->postures.item[i].gravity, &x, &y);
    (void)fprintf(file,
                  "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"6\" fill=\"%s\" stroke=\"#fff\" "
                  "stroke-width=\"2\" shape-rendering=\"auto\"><title>",
                  x, y, supine_report_html_line(i));
    supine_report_html_text(c->postures.item[i].name, file);
    (void)fputs("</title></circle>\n", file);
  }
  (void)fprintf(file,
                "</svg><figcaption>RMS distance from supine at the same inflation, from 0 (dark) "
                "to %.1f mm (yellow), for every direction of gravity: rolling about the long axis "
                "across, head down to feet down from top to bottom. Dots are the postures "
                "compared.</figcaption></figure>\n",
                c->extremes.farthest_rms);
}
