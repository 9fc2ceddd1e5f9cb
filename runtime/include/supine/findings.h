/* SPDX-License-Identifier: MIT */
/** @file
 * What a check tells about an input: warnings, and notes for information. Functions that check an
 * input add to the caller's list; the caller shows it: `supine` prints it on standard error, the
 * Python package raises warnings, the JavaScript package returns them.
 *
 * Stability: growing. A minor version may add members at the end; CHANGELOG.md says how to move
 * over. */
#ifndef SUPINE_FINDINGS_H
#define SUPINE_FINDINGS_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { SUPINE_FINDINGS_MAX = 32, SUPINE_FINDING_TEXT_MAX = 640 };

/** Something found in an input. */
typedef struct supine_finding {
  bool is_warning;                             /**< otherwise a note */
  char text[SUPINE_FINDING_TEXT_MAX];          /**< one line, NUL-terminated, without "warning:" */
  supine_remedy remedies[SUPINE_REMEDIES_MAX]; /**< as in supine_error */
} supine_finding;

/** A list of findings. Zero-initialise `count` and `dropped`. */
typedef struct supine_findings {
  size_t count;   /**< number of findings in the list */
  size_t dropped; /**< number of further findings, for which the list had no room */
  supine_finding list[SUPINE_FINDINGS_MAX]; /**< [count] in the order in which they were found */
} supine_findings;

/** Add a warning, without a remedy, to a list, unless it is NULL. A long text is cut off.
 * @param format  printf format of the text */
SUPINE_API void supine_findings_warn(supine_findings *findings, const char *format, ...)
    SUPINE_PRINTF(2, 3);

/** Add a note, as supine_findings_warn adds a warning. */
SUPINE_API void supine_findings_note(supine_findings *findings, const char *format, ...)
    SUPINE_PRINTF(2, 3);

/** Set the remedies of the finding that was added last, unless the list is NULL. */
SUPINE_API void supine_findings_advise(supine_findings *findings,
                                       const supine_remedy remedies[SUPINE_REMEDIES_MAX]);

#ifdef __cplusplus
}
#endif
#endif
