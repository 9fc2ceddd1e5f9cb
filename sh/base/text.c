/* SPDX-License-Identifier: MIT */
/* Build sentences from parts, and compare endings of names. */
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

/* Find the bytes of the UTF-8 character that begins here; 0 if invalid. */
static size_t character(const unsigned char *at) {
  const size_t size = at[0] < 0x80                     ? 1
                      : at[0] >= 0xC2 && at[0] <= 0xDF ? 2
                      : at[0] >= 0xE0 && at[0] <= 0xEF ? 3
                      : at[0] >= 0xF0 && at[0] <= 0xF4 ? 4
                                                       : 0;
  for (size_t i = 1; i < size; ++i) {
    if ((at[i] & 0xC0) != 0x80) {
      return 0;
    }
  }
  const bool odd = (at[0] == 0xE0 && at[1] < 0xA0) || (at[0] == 0xED && at[1] > 0x9F) ||
                   (at[0] == 0xF0 && at[1] < 0x90) || (at[0] == 0xF4 && at[1] > 0x8F);
  return odd ? 0 : size; /* overlong, a surrogate, or out of range */
}

char *supine_text_make_utf8(char *text) {
  for (char *at = text; *at != '\0';) {
    const size_t size = character((const unsigned char *)at);
    if (size == 0) {
      *at = '?';
    }
    at += size == 0 ? 1 : size;
  }
  return text;
}
