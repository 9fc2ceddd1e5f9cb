/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Pieces of the HTML report. */
#ifndef SUPINE_COMPARISON_HTML_H
#define SUPINE_COMPARISON_HTML_H

#include "runtime/report/comparison.h"

/* Text with the characters that HTML reserves replaced. */
void supine_report_html_text(const char *text, FILE *file);

/* "#rrggbb" of the colour map at 0 <= t <= 1. */
void supine_report_html_colour(double t, char hex[8]);

/* Colour of a posture's line in charts. */
const char *supine_report_html_line(size_t posture);

/* Height profiles as inline SVG: regional expansion and share of the volume gained. */
void supine_report_html_profiles(const supine_comparison *comparison, FILE *file);

/* Distance from supine for every direction of gravity, as a map. */
void supine_report_html_map(const supine_comparison *comparison, FILE *file);

/* Pictures of each lung, as PNG inside the page; one line that says why where none can be drawn. */
void supine_report_html_pictures(const supine_comparison *comparison, FILE *file);

#endif
