/* SPDX-License-Identifier: MIT */
/* Parse and print numbers in the same way in every locale. */
#include <stdlib.h>

#include "base/locale.h"
#include "base/number.h"
#include "base/utf8.h"

double supine_number_parse(const char *text, char **end) {
  SUPINE_C_LOCALE;
  return strtod(text, end);
}

int supine_print_text_list(char *text, size_t size, const char *format, va_list arguments) {
  SUPINE_C_LOCALE;
  const int length = vsnprintf(text, size, format, arguments);
  if (length > 0 && (size_t)length >= size && size > 0) {
    supine_utf8_whole(text);
  }
  return length;
}

int supine_print_text(char *text, size_t size, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  const int length = supine_print_text_list(text, size, format, arguments);
  va_end(arguments);
  return length;
}

int supine_print_list(FILE *file, const char *format, va_list arguments) {
  SUPINE_C_LOCALE;
  return vfprintf(file, format, arguments);
}

int supine_print(FILE *file, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  const int length = supine_print_list(file, format, arguments);
  va_end(arguments);
  return length;
}
