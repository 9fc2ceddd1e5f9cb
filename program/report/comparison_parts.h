/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the values that replace tags, such as {{map}}, in the templates of the HTML report. */
#ifndef SUPINE_COMPARISON_PARTS_H
#define SUPINE_COMPARISON_PARTS_H

#include <jansson.h>

#include "program/report/comparison.h"

/* Return the colour of a posture's line in charts. */
const char *supine_report_line(size_t posture);

/* Return the values of the tags of report.html that have these names. */
json_t *supine_report_findings(const supine_comparison *comparison);
json_t *supine_report_targets(const supine_comparison *comparison);
json_t *supine_report_postures(const supine_comparison *comparison);
json_t *supine_report_profile(const supine_comparison *comparison);
json_t *supine_report_outlines(const supine_comparison *comparison);

/* Return the value of the tag {{pictures}}. If pictures cannot be drawn, set `error` and return
 * NULL. */
json_t *supine_report_pictures(const supine_comparison *comparison, supine_error *error);

#endif
