/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the data that fill the templates of the HTML report. A name in braces, such as {{map}}, is
 * the template's tag that a returned value replaces. */
#ifndef SUPINE_COMPARISON_PARTS_H
#define SUPINE_COMPARISON_PARTS_H

#include <jansson.h>

#include "program/render/render.h"
#include "program/report/comparison.h"

/* Return the colour of a map at 0 <= t <= 1 as a string "#rrggbb". */
json_t *supine_report_hex(supine_colours map, double t);

/* Return the colour of a posture's line in charts. */
const char *supine_report_line(size_t posture);

/* Return the data of bar.html, a colour bar from 0 to `largest` with the caption `words`. The bar
 * has a pointed end if `beyond`, which means that some values are larger. */
json_t *supine_report_bar(supine_colours map, double largest, bool beyond, const char *words);

/* Return a direction of gravity as text: the name of a posture, or the angle from the nearest
 * posture and the vector in the notation of --posture. */
json_t *supine_report_direction(const double g[3]);

/* Return {{findings}}: sentences on the change in each of the first three postures that differ from
 * the reference. */
json_t *supine_report_findings(const supine_comparison *comparison);

/* Return {{postures}}: for each posture a table row of volumes, their changes, displacements and
 * published values. */
json_t *supine_report_postures(const supine_comparison *comparison);

/* Return the title of a profile, with a value for each of the first four postures: the share of the
 * breath in the lower half of the lungs if `share`, else the ratio of the regional expansion
 * of the three lowest slabs to that of the three uppermost slabs. */
json_t *supine_report_profile_finding(const supine_comparison *comparison, bool share);

/* Return {{profiles}}: charts of regional expansion and of the share of the breath by height. */
json_t *supine_report_profiles(const supine_comparison *comparison);

/* Return {{map}}: the RMS distance from supine for every direction of gravity. */
json_t *supine_report_map(const supine_comparison *comparison);

/* Return {{outlines}}: for each slice, the outlines in all postures and in the reference pose. */
json_t *supine_report_outlines(const supine_comparison *comparison);

/* Return {{pictures}}: a picture of each posture from the front, and a colour bar; NULL, with
 * `error` set, if pictures cannot be drawn. */
json_t *supine_report_pictures(const supine_comparison *comparison, supine_error *error);

#endif
