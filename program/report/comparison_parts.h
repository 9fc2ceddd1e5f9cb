/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Data of the HTML report's templates (page/), by name. */
#ifndef SUPINE_COMPARISON_PARTS_H
#define SUPINE_COMPARISON_PARTS_H

#include <jansson.h>

#include "program/render/render.h"
#include "program/report/comparison.h"

/* "#rrggbb" of a colour map at 0 <= t <= 1. */
json_t *supine_report_hex(supine_colours map, double t);

/* Colour of a posture's line in charts. */
const char *supine_report_line(size_t posture);

/* A bar of colours up to `largest`, its end pointed where values lie beyond: {{stops}}, {{ticks}},
 * {{beyond}} and {{words}}. */
json_t *supine_report_bar(supine_colours map, double largest, bool beyond, const char *words);

/* A direction of gravity in words: a posture's name, or how far it is from the nearest and the
 * numbers that commands take. */
json_t *supine_report_direction(const double g[3]);

/* The first sentences: what each posture changes. */
json_t *supine_report_findings(const supine_comparison *comparison);

/* {{postures}}: a row each, with volumes, changes, moves and what was published. */
json_t *supine_report_postures(const supine_comparison *comparison);

/* Regional expansion of the lowest over that of the uppermost three slabs of ten. */
double supine_report_lowest_over_uppermost(const supine_comparison *comparison, size_t posture);

/* A profile's title: what of a breath the lower half takes, or that ratio, in up to four postures.
 */
json_t *supine_report_profile_finding(const supine_comparison *comparison, bool share);

/* {{profiles}}: regional expansion and share of the volume gained, by height. */
json_t *supine_report_profiles(const supine_comparison *comparison);

/* {{map}}: distance from supine for every direction of gravity. */
json_t *supine_report_map(const supine_comparison *comparison);

/* {{outlines}}: slices of the lungs, each posture over the reference. */
json_t *supine_report_outlines(const supine_comparison *comparison);

/* {{pictures}}: {{cells}} from the front; NULL, and why in `error`, where none can be drawn. */
json_t *supine_report_pictures(const supine_comparison *comparison, supine_error *error);

#endif
