/* SPDX-License-Identifier: MIT */
/** @file Store warnings and notes about an input, to show them again later. */
#ifndef SUPINE_FINDINGS_H
#define SUPINE_FINDINGS_H

#include <stddef.h>

#include <supine/status.h>

enum { SUPINE_FINDINGS_MAX = 64 };

/** What can be done about a finding. */
typedef struct supine_advice {
  supine_remedy remedy;
  char value[SUPINE_REMEDY_VALUE_MAX]; /**< as in supine_error */
} supine_advice;

/** Lines that begin with "warning: " or "note: ", or with the name of a file and one of these
 * words. Zero-initialise. */
typedef struct supine_findings {
  char text[4096];                           /**< each line ends with a line feed */
  size_t count;                              /**< number of lines */
  supine_advice advice[SUPINE_FINDINGS_MAX]; /**< [count] of each line */
} supine_findings;

/** Format a line like printf, and add it. A line that does not fit is dropped. */
SUPINE_PRINTF(2, 3) void supine_findings_add(supine_findings *findings, const char *format, ...);

/** Do the same, with a remedy.
 * @param value  value of the argument; "" or NULL for none */
SUPINE_PRINTF(4, 5)
void supine_findings_advise(supine_findings *findings, supine_remedy remedy, const char *value,
                            const char *format, ...);

/** Return the line at *at and move *at to the next line; return NULL after the last.
 * @param length  set to the length of the line without its line feed */
const char *supine_findings_next(const char **at, size_t *length);

#endif
