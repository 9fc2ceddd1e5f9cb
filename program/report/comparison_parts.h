/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the data of the HTML report's templates. */
#ifndef SUPINE_COMPARISON_PARTS_H
#define SUPINE_COMPARISON_PARTS_H

#include <jansson.h>

#include "program/render/render.h"
#include "program/report/comparison.h"

/* Return the colour of a map at 0 <= t <= 1 as "#rrggbb". */
json_t *supine_report_hex(supine_colours map, double t);

/* Return the colour of a posture's line in charts. */
const char *supine_report_line(size_t posture);

/* Return a colour bar from 0 to `largest`, with a pointed end if `beyond`, that is, if there are
 * larger values: {{stops}}, {{ticks}}, {{beyond}} and {{words}}. */
json_t *supine_report_bar(supine_colours map, double largest, bool beyond, const char *words);

/* Return a direction of gravity in words: a posture's name, or the angle from the nearest posture
 * and the vector in the notation of --posture. */
json_t *supine_report_direction(const double g[3]);

/* Return {{findings}}: sentences on the change in each of the first three postures that differ from
 * the reference. */
json_t *supine_report_findings(const supine_comparison *comparison);

/* Return {{postures}}: for each a table row of volumes, their changes, displacements and published
 * values. */
json_t *supine_report_postures(const supine_comparison *comparison);

/* Return the regional expansion of the lowest three slabs over that of the uppermost three. */
double supine_report_lowest_over_uppermost(const supine_comparison *comparison, size_t posture);

/* Return the title of a profile, for up to four postures: if `share`, the share of the breath in
 * the lower half of the lungs, else supine_report_lowest_over_uppermost. */
json_t *supine_report_profile_finding(const supine_comparison *comparison, bool share);

/* Return {{profiles}}: two charts over the height, regional expansion and share of the breath. */
json_t *supine_report_profiles(const supine_comparison *comparison);

/* Return {{map}}: RMS distance from supine for every direction of gravity. */
json_t *supine_report_map(const supine_comparison *comparison);

/* Return {{outlines}}: for each slice, the outlines in all postures over that of the reference. */
json_t *supine_report_outlines(const supine_comparison *comparison);

/* Return {{pictures}}: {{cells}}, a picture of each posture from the front, and a colour bar; NULL,
 * with `error` set, if they cannot be drawn. */
json_t *supine_report_pictures(const supine_comparison *comparison, supine_error *error);

#endif
