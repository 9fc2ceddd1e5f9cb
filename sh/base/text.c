/* SPDX-License-Identifier: MIT */
/* Sentences put together from parts, and how names end. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "sh/base/text.h"

void supine_text_add(char *text, size_t size, const char *format, ...) {
  const size_t used = strlen(text);
  va_list arguments;
  va_start(arguments, format);
  (void)vsnprintf(text + used, size - used, format, arguments);
  va_end(arguments);
}

static const char *tail_of(const char *name, const char *ending) {
  const size_t length = strlen(name);
  const size_t tail = strlen(ending);
  return length > tail ? name + length - tail : "";
}

bool supine_text_ends_in(const char *name, const char *ending) {
  return strcmp(tail_of(name, ending), ending) == 0;
}

bool supine_text_ends_in_any_case(const char *name, const char *ending) {
  return strcasecmp(tail_of(name, ending), ending) == 0;
}
