/* SPDX-License-Identifier: MIT */
/* Collect what checks tell about an input. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <supine/findings.h>

#include "base/number.h"
#include "base/utf8.h"

static void add(supine_findings *findings, bool is_warning, const char *format, va_list arguments) {
  char text[SUPINE_FINDING_TEXT_MAX];
  if (findings == NULL) {
    return;
  }
  if (findings->count == SUPINE_FINDINGS_MAX) {
    ++findings->dropped;
    return;
  }
  supine_finding *added = &findings->list[findings->count++];
  (void)supine_print_text_list(text, sizeof text, format, arguments);
  supine_utf8_escape(text, "", added->text, sizeof added->text);
  added->is_warning = is_warning;
  memset(added->remedies, 0, sizeof added->remedies);
}

void supine_findings_warn(supine_findings *findings, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  add(findings, true, format, arguments);
  va_end(arguments);
}

void supine_findings_note(supine_findings *findings, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  add(findings, false, format, arguments);
  va_end(arguments);
}

void supine_findings_advise(supine_findings *findings,
                            const supine_remedy remedies[SUPINE_REMEDIES_MAX]) {
  if (findings != NULL && findings->count > 0 && findings->dropped == 0) {
    supine_finding *last = &findings->list[findings->count - 1];
    memcpy(last->remedies, remedies, sizeof last->remedies);
  }
}
