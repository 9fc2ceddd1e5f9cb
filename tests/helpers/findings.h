/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Show a list of findings as text. */
#ifndef SUPINE_TESTS_FINDINGS_H
#define SUPINE_TESTS_FINDINGS_H

#include <supine/findings.h>

#include "base/text.h"

/* Return the findings, one a line, as the program prints them, without remedies. The text is valid
 * until the next call. */
static inline const char *findings_text(const supine_findings *findings) {
  static char text[SUPINE_FINDINGS_MAX * (SUPINE_FINDING_TEXT_MAX + 16)];
  text[0] = '\0';
  for (size_t i = 0; i < findings->count; ++i) {
    supine_text_add(text, sizeof text, "%s: %s\n",
                    findings->list[i].is_warning ? "warning" : "note", findings->list[i].text);
  }
  return text;
}

#endif
