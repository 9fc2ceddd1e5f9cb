/* SPDX-License-Identifier: MIT */
/* Build sentences from parts, compare endings of names, and decode base64. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/ascii.h"
#include "base/number.h"
#include "base/text.h"
#include "base/utf8.h"

void supine_text_add(char *text, size_t size, const char *format, ...) {
  const size_t used = strlen(text);
  va_list arguments;
  va_start(arguments, format);
  (void)supine_print_text_list(text + used, size - used, format, arguments);
  va_end(arguments);
}

void supine_text_suggest(const char *before, const char *word, char *text, size_t size) {
  text[0] = '\0';
  if (word != NULL) {
    (void)supine_print_text(text, size, "; did you mean '%s%s'?", before, word);
  }
}

const char *supine_text_file_name(const char *path) {
  const char *slash = strrchr(path, '/');
  return slash != NULL ? slash + 1 : path;
}

bool supine_text_ends_in(const char *name, const char *ending) {
  const size_t length = strlen(name);
  const size_t tail = strlen(ending);
  return length > tail && supine_ascii_same(name + length - tail, ending);
}

bool supine_text_is_utf8(const char *text) {
  const char *const end = text + strlen(text);
  for (const char *at = text; at < end;) {
    const size_t size = supine_utf8_length(at, (size_t)(end - at));
    if (size == 0) {
      return false;
    }
    at += size;
  }
  return true;
}

const char *supine_text_shorten(const char *text, size_t size, char *shortened) {
  static const char ellipsis[] = "\xE2\x80\xA6";
  size_t length = strlen(text);
  if (length < size) {
    memcpy(shortened, text, length + 1);
  } else {
    length = size - sizeof ellipsis;
    while (length > 0 && ((unsigned char)text[length] & 0xC0U) == 0x80U) {
      --length;
    }
    memcpy(shortened, text, length);
    memcpy(shortened + length, ellipsis, sizeof ellipsis);
  }
  return shortened;
}

char *supine_text_make_utf8(char *text) {
  const char *const end = text + strlen(text);
  for (char *at = text; at < end;) {
    const size_t size = supine_utf8_length(at, (size_t)(end - at));
    if (size == 0) {
      *at = '?';
    }
    at += size == 0 ? 1 : size;
  }
  return text;
}

supine_number_text supine_text_distance(double mm) {
  supine_number_text distance = {"below 0.002"};
  if (!(mm < SUPINE_TEXT_DISTANCE_LEAST)) { /* true if it is NaN */
    (void)supine_print_text(distance.text, sizeof distance.text, "%.3f", mm);
  }
  return distance;
}

supine_number_text supine_text_change(double change) {
  supine_number_text text = {"0"};
  if (!(fabs(change) < 0.5)) { /* true if it is NaN */
    (void)supine_print_text(text.text, sizeof text.text, "%+.0f", change);
  }
  return text;
}

size_t supine_text_decode_base64(const char *at, const char *end, unsigned char *bytes) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  unsigned char *to = bytes;
  unsigned word = 0;
  int got = 0;
  int padding = 0;
  for (; at < end; ++at) {
    const char *digit = memchr(digits, *at, 64);
    if (supine_ascii_is_space(*at)) {
      continue;
    }
    if (digit == NULL && *at != '=') {
      break;
    }
    word = word << 6 | (digit != NULL ? (unsigned)(digit - digits) : 0U);
    padding += *at == '=';
    if (++got == 4) {
      for (int k = 0; k < 3 - padding; ++k) {
        *to++ = (unsigned char)(word >> (16 - 8 * k));
      }
      word = 0;
      got = padding = 0;
    }
  }
  return (size_t)(to - bytes);
}
