/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Choose the colours of the HTML report, and build its colour bar. */
#include "program/report/comparison_parts.h"
#include "program/view/render/render.h"

/* Return the colour of a map at 0 <= t <= 1 as a string "#rrggbb". */
static json_t *hex(supine_colours map, double t) {
  double rgb[3];
  supine_render_colour(map, t, rgb);
  return json_sprintf("#%02x%02x%02x", (unsigned)(255.0 * rgb[0] + 0.5) & 255U,
                      (unsigned)(255.0 * rgb[1] + 0.5) & 255U,
                      (unsigned)(255.0 * rgb[2] + 0.5) & 255U);
}

/* These colours can be told apart with any colour vision (M. Okabe and K. Ito, 2008). */
const char *supine_report_line(size_t posture) {
  static const char *const lines[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                      "#56b4e9", "#e69f00", "#8c8c8c"};
  return lines[posture % (sizeof lines / sizeof *lines)];
}

json_t *supine_report_bar(supine_colours map, double largest, const char *words) {
  enum { STOPS = 16 };
  const double step = supine_render_bar_step(largest);
  json_t *stops = json_array();
  json_t *ticks = json_array();
  for (int i = 0; i <= STOPS; ++i) {
    (void)json_array_append_new(stops, hex(map, i / (double)STOPS));
  }
  for (int i = 0; largest > 0.0 && i * step <= largest * (1.0 + 1e-9); ++i) {
    (void)json_array_append_new(ticks, json_pack("{s:o, s:o}", "at",
                                                 json_sprintf("%.2f", 100.0 * i * step / largest),
                                                 "value", json_sprintf("%g", i * step)));
  }
  return json_pack("{s:o, s:o, s:s}", "stops", stops, "ticks", ticks, "words", words);
}
