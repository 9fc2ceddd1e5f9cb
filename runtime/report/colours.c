/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Colours of the HTML report. */
#include "runtime/render/render.h"
#include "runtime/report/comparison_parts.h"

json_t *supine_report_hex(double t) {
  double rgb[3];
  supine_render_colour(t, rgb);
  return json_sprintf("#%02x%02x%02x", (unsigned)(255.0 * rgb[0] + 0.5) & 255U,
                      (unsigned)(255.0 * rgb[1] + 0.5) & 255U,
                      (unsigned)(255.0 * rgb[2] + 0.5) & 255U);
}

const char *supine_report_ink(double t) {
  double rgb[3];
  supine_render_colour(t, rgb);
  return 0.3 * rgb[0] + 0.59 * rgb[1] + 0.11 * rgb[2] > 0.5 ? "#101418" : "#fff";
}

/* Told apart by people with any colour vision (M. Okabe and K. Ito, 2008). */
const char *supine_report_line(size_t posture) {
  static const char *const lines[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                      "#56b4e9", "#e69f00", "#8c8c8c"};
  return lines[posture % (sizeof lines / sizeof *lines)];
}
