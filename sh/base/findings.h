/* SPDX-License-Identifier: MIT */
/** @file Warnings and notes about an input, kept to be shown again later. */
#ifndef SUPINE_FINDINGS_H
#define SUPINE_FINDINGS_H

#include <stddef.h>

#include <supine/status.h>

/** Lines, each of which begins with "warning: " or "note: ", or with a file's name and one of them.
 * Zero-initialise. */
typedef struct supine_findings {
  char text[4096]; /**< each line ends with a line feed */
} supine_findings;

/** Add a line by a printf format; a line that does not fit is dropped. */
SUPINE_PRINTF(2, 3) void supine_findings_add(supine_findings *findings, const char *format, ...);

/** Return the line at *at, which has `length` bytes without its line feed, and move *at to the next
 * line; return NULL after the last. */
const char *supine_findings_next(const char **at, size_t *length);

#endif
