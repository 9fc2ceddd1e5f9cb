/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the values that replace tags, such as {{map}}, in the templates of the HTML report. */
#ifndef SUPINE_COMPARISON_PARTS_H
#define SUPINE_COMPARISON_PARTS_H

#include <jansson.h>

#include "program/report/comparison.h"
#include "program/view/render/render.h"

/* Return the colour of a map at 0 <= t <= 1 as a string "#rrggbb". */
json_t *supine_report_hex(supine_colours map, double t);

/* Return the colour of a posture's line in charts. */
const char *supine_report_line(size_t posture);

/* Return the data of bar.html, a colour bar from 0 to `largest` with the caption `words`. If
 * `beyond` is true, some values exceed `largest`, and the bar has a pointed end. */
json_t *supine_report_bar(supine_colours map, double largest, bool beyond, const char *words);

/* Return a direction of gravity as text: the name of its posture. If the posture has no name,
 * return the angle from the nearest named posture, and the vector as --posture takes it. */
json_t *supine_report_direction(const double g[3]);

/* Return the value of the tag {{findings}}: a sentence on each of the first three postures that
 * differ from the reference pose. */
json_t *supine_report_findings(const supine_comparison *comparison);

/* Return the value of the tag {{postures}}: for each posture a table row of lung volumes, their
 * changes, displacements, and values from publications. */
json_t *supine_report_postures(const supine_comparison *comparison);

/* Return the title of a chart, with a value for each of the first four postures. If `share` is
 * true, it is the fraction of the inhaled volume that enters the lower half of the lungs. Otherwise
 * it is the ratio of the expansions of the lowest and uppermost three slabs. */
json_t *supine_report_profile_finding(const supine_comparison *comparison, bool share);

/* Return the value of the tag {{profiles}}: charts, by height along gravity, of the regional
 * expansion and of the fraction of the inhaled volume. */
json_t *supine_report_profiles(const supine_comparison *comparison);

/* Return the value of the tag {{map}}: the RMS distance from supine by direction of gravity. */
json_t *supine_report_map(const supine_comparison *comparison);

/* Return the value of the tag {{outlines}}: for each slice, the outlines in all postures and in the
 * reference pose. */
json_t *supine_report_outlines(const supine_comparison *comparison);

/* Return the value of the tag {{pictures}}: a picture of each posture from the front, and a colour
 * bar. If pictures cannot be drawn, set `error` and return NULL. */
json_t *supine_report_pictures(const supine_comparison *comparison, supine_error *error);

#endif
