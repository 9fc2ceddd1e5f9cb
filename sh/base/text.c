/* SPDX-License-Identifier: MIT */
/* Sentences put together from parts. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "sh/base/text.h"

void supine_text_add(char *text, size_t size, const char *format, ...) {
  const size_t used = strlen(text);
  va_list arguments;
  va_start(arguments, format);
  (void)vsnprintf(text + used, size - used, format, arguments);
  va_end(arguments);
}
