/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Data of the HTML report's templates. */
#ifndef SUPINE_COMPARISON_PARTS_H
#define SUPINE_COMPARISON_PARTS_H

#include <jansson.h>

#include "program/render/render.h"
#include "program/report/comparison.h"

/* Return "#rrggbb" of a colour map at 0 <= t <= 1. */
json_t *supine_report_hex(supine_colours map, double t);

/* Return the colour of a posture's line in charts. */
const char *supine_report_line(size_t posture);

/* Return a colour bar from 0 to `largest`, with a pointed end if there are larger values:
 * {{stops}},
 * {{ticks}}, {{beyond}} and {{words}}. */
json_t *supine_report_bar(supine_colours map, double largest, bool beyond, const char *words);

/* Return a direction of gravity in words: a posture's name, or the angle from the nearest posture
 * and the vector in the notation of --posture. */
json_t *supine_report_direction(const double g[3]);

/* Return the first sentences: the change in each posture. */
json_t *supine_report_findings(const supine_comparison *comparison);

/* Return {{postures}}: a row each, with volumes, changes, moves and published values. */
json_t *supine_report_postures(const supine_comparison *comparison);

/* Return the regional expansion of the lowest three slabs over that of the uppermost three. */
double supine_report_lowest_over_uppermost(const supine_comparison *comparison, size_t posture);

/* Return the title of a profile, for up to four postures: the lower half's share of a breath, or
 * the ratio above. */
json_t *supine_report_profile_finding(const supine_comparison *comparison, bool share);

/* Return {{profiles}}: regional expansion and share of the volume gained, by height. */
json_t *supine_report_profiles(const supine_comparison *comparison);

/* Return {{map}}: distance from supine for every direction of gravity. */
json_t *supine_report_map(const supine_comparison *comparison);

/* Return {{outlines}}: slices of the lungs, each posture over the reference. */
json_t *supine_report_outlines(const supine_comparison *comparison);

/* Return {{pictures}}: {{cells}} from the front; NULL, with `error` set, if none can be drawn. */
json_t *supine_report_pictures(const supine_comparison *comparison, supine_error *error);

#endif
