/* SPDX-License-Identifier: MIT */
/* Parse and print numbers in the same way in every locale. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/locale.h"
#include "base/number.h"
#include "base/utf8.h"

double supine_number_parse(const char *text, char **end) {
  SUPINE_C_LOCALE;
  const char *at = text + strspn(text, " \t\n\v\f\r");
  at += *at == '+' || *at == '-' ? 1 : 0;
  if (at[0] == '0' && (at[1] == 'x' || at[1] == 'X')) {
    if (end != NULL) {
      *end = (char *)(uintptr_t)(at + 1);
    }
    return 0;
  }
  return strtod(text, end);
}

void supine_number_shorten(char *text) {
  enum { LONGEST = 20 };
  for (char *at = text; *(at += strcspn(at, "0123456789")) != '\0';) {
    const size_t digits = strspn(at, "0123456789");
    char *end = at + digits;
    if (digits > LONGEST) {
      char shorter[LONGEST];
      const int size = snprintf(shorter, sizeof shorter, "%c.%.2se+%zu", at[0], at + 1, digits - 1);
      memcpy(at, shorter, (size_t)size);
      memmove(at + size, end, strlen(end) + 1);
      end = at + size;
    }
    at = end;
  }
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

void supine_writer_add(supine_writer *to, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  const size_t at = to->length < to->size ? to->length : to->size;
  const int count = supine_print_text_list(to->size > at ? to->text + at : NULL, to->size - at,
                                           format, arguments);
  va_end(arguments);
  to->length += count > 0 ? (size_t)count : 0;
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
