/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the values that replace tags, such as {{map}}, in the templates of the HTML report. */
#ifndef SUPINE_COMPARISON_PARTS_H
#define SUPINE_COMPARISON_PARTS_H

#include <jansson.h>

#include "program/report/comparison.h"

/* Return the colour of a posture's line in charts. */
const char *supine_report_line(size_t posture);

/* Return the value of the tag {{findings}}: a sentence on each of the first three postures that
 * differ from the reference pose. */
json_t *supine_report_findings(const supine_comparison *comparison);

/* Return the value of the tag {{targets}}: a row for each structure inside the lungs and posture.
 */
json_t *supine_report_targets(const supine_comparison *comparison);

/* Return the value of the tag {{postures}}: for each posture a table row of lung volumes, their
 * changes, displacements, and values from publications. */
json_t *supine_report_postures(const supine_comparison *comparison);

/* Return the value of the tag {{profile}}: a chart of the regional expansion by height along
 * gravity.
 */
json_t *supine_report_profile(const supine_comparison *comparison);

/* Return the value of the tag {{outlines}}: for each slice, the outlines in all postures and in the
 * reference pose. */
json_t *supine_report_outlines(const supine_comparison *comparison);

/* Return the value of the tag {{pictures}}: a picture of each posture from the front, and a colour
 * bar. If pictures cannot be drawn, set `error` and return NULL. */
json_t *supine_report_pictures(const supine_comparison *comparison, supine_error *error);

#endif
