/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What stands in the HTML report's templates (page/), by their names. */
#ifndef SUPINE_COMPARISON_PARTS_H
#define SUPINE_COMPARISON_PARTS_H

#include <jansson.h>

#include "runtime/report/comparison.h"

/* "#rrggbb" of the colour map at 0 <= t <= 1. */
json_t *supine_report_hex(double t);

/* Black or white, whichever reads on that colour. */
const char *supine_report_ink(double t);

/* Colour of a posture's line in charts. */
const char *supine_report_line(size_t posture);

/* {{profiles}}: regional expansion and share of the volume gained, by height. */
json_t *supine_report_profiles(const supine_comparison *comparison);

/* {{map}}: distance from supine for every direction of gravity. */
json_t *supine_report_map(const supine_comparison *comparison);

/* {{pictures}} of each lung; NULL, and why in `error`, where none can be drawn. */
json_t *supine_report_pictures(const supine_comparison *comparison, supine_error *error);

#endif
