/* SPDX-License-Identifier: MIT */
/** @file
 * What was found of an input that a user should know, kept so that it can be said again later. */
#ifndef SUPINE_FINDINGS_H
#define SUPINE_FINDINGS_H

#include <stddef.h>

#include <supine/status.h>

/** Lines, each beginning with "warning: " or "note: " or a file's name and either. Zeroed at first.
 */
typedef struct supine_findings {
  char text[4096]; /**< each line ended by a line feed */
} supine_findings;

/** Adds a line by a printf format; one that does not fit is left out. */
SUPINE_PRINTF(2, 3) void supine_findings_add(supine_findings *findings, const char *format, ...);

/** The line at *at without its end, `length` long, and moves *at behind it; NULL after the last. */
const char *supine_findings_next(const char **at, size_t *length);

#endif
