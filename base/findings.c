/* SPDX-License-Identifier: MIT */
/* Collect warnings and notes about an input. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/findings.h"
#include "base/number.h"
#include "base/text.h"

void supine_findings_add(supine_findings *findings, const char *format, ...) {
  const size_t used = strlen(findings->text);
  const size_t room = sizeof findings->text - used;
  va_list arguments;
  va_start(arguments, format);
  const int length = supine_print_text_list(findings->text + used, room, format, arguments);
  va_end(arguments);
  if (length < 0 || (size_t)length + 1 >= room) {
    findings->text[used] = '\0';
    return;
  }
  for (char *c = findings->text + used; *c != '\0'; ++c) { /* replace line feeds of file names */
    *c = *c == '\n' ? ' ' : *c;
  }
  (void)supine_text_make_utf8(findings->text + used);
  (void)strcat(findings->text, "\n");
}

const char *supine_findings_next(const char **at, size_t *length) {
  const char *line = *at;
  *length = strcspn(line, "\n");
  *at = line + *length + (line[*length] == '\n' ? 1 : 0);
  return *line != '\0' ? line : NULL;
}
