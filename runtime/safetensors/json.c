/* SPDX-License-Identifier: MIT */
/* The part of JSON that a safetensors header uses (RFC 8259, strictly). */
#include <stdint.h>
#include <string.h>

#include "runtime/safetensors/json.h"

static void json_skip(json_cursor *cursor) {
  while (cursor->at < cursor->end && (*cursor->at == ' ' || *cursor->at == '\t' ||
                                      *cursor->at == '\n' || *cursor->at == '\r')) {
    ++cursor->at;
  }
}

bool supine_safetensors_json_take(json_cursor *cursor, char character) {
  json_skip(cursor);
  if (cursor->at < cursor->end && *cursor->at == character) {
    ++cursor->at;
    return true;
  }
  return false;
}

bool supine_safetensors_json_at_end(json_cursor *cursor) {
  json_skip(cursor);
  return cursor->at == cursor->end;
}

size_t supine_safetensors_utf8_length(const char *text, size_t size) {
  const unsigned char *u = (const unsigned char *)text;
  if (size == 0) {
    return 0;
  }
  if (u[0] < 0x80) {
    return 1;
  }
  const size_t length = u[0] >= 0xF0 ? 4 : u[0] >= 0xE0 ? 3 : 2;
  if (u[0] < 0xC2 || u[0] > 0xF4 || size < length) {
    return 0;
  }
  for (size_t i = 1; i < length; ++i) {
    if ((u[i] & 0xC0) != 0x80) {
      return 0;
    }
  }
  /* Overlong forms, surrogates, and what lies beyond U+10FFFF. */
  const bool bad = (u[0] == 0xE0 && u[1] < 0xA0) || (u[0] == 0xED && u[1] > 0x9F) ||
                   (u[0] == 0xF0 && u[1] < 0x90) || (u[0] == 0xF4 && u[1] > 0x8F);
  return bad ? 0 : length;
}

static bool json_hex(json_cursor *cursor, uint32_t *value) {
  *value = 0;
  for (int i = 0; i < 4; ++i) {
    if (cursor->at >= cursor->end) {
      return false;
    }
    const char c = *cursor->at++;
    const int digit = c >= '0' && c <= '9'   ? c - '0'
                      : c >= 'a' && c <= 'f' ? c - 'a' + 10
                      : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                             : -1;
    if (digit < 0) {
      return false;
    }
    *value = *value * 16 + (uint32_t)digit;
  }
  return true;
}

/* The code point of \uXXXX or of a surrogate pair, as UTF-8; NULL when malformed. */
static char *json_unicode(json_cursor *cursor, char *to) {
  uint32_t code = 0;
  if (!json_hex(cursor, &code) || code == 0 || (code >= 0xDC00 && code <= 0xDFFF)) {
    return NULL;
  }
  if (code >= 0xD800 && code <= 0xDBFF) {
    uint32_t low = 0;
    if (cursor->end - cursor->at < 6 || cursor->at[0] != '\\' || cursor->at[1] != 'u') {
      return NULL;
    }
    cursor->at += 2;
    if (!json_hex(cursor, &low) || low < 0xDC00 || low > 0xDFFF) {
      return NULL;
    }
    code = 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00);
  }
  if (code < 0x80) {
    *to++ = (char)code;
  } else if (code < 0x800) {
    *to++ = (char)(0xC0 | (code >> 6));
    *to++ = (char)(0x80 | (code & 0x3F));
  } else if (code < 0x10000) {
    *to++ = (char)(0xE0 | (code >> 12));
    *to++ = (char)(0x80 | ((code >> 6) & 0x3F));
    *to++ = (char)(0x80 | (code & 0x3F));
  } else {
    *to++ = (char)(0xF0 | (code >> 18));
    *to++ = (char)(0x80 | ((code >> 12) & 0x3F));
    *to++ = (char)(0x80 | ((code >> 6) & 0x3F));
    *to++ = (char)(0x80 | (code & 0x3F));
  }
  return to;
}

/* What follows a backslash; NULL when malformed. */
static char *json_escape(json_cursor *cursor, char *to) {
  static const char names[] = "\"\\/bfnrt";
  static const char meanings[] = "\"\\/\b\f\n\r\t";
  if (cursor->at >= cursor->end) {
    return NULL;
  }
  const char name = *cursor->at++;
  if (name == 'u') {
    return json_unicode(cursor, to);
  }
  const char *found = name == '\0' ? NULL : strchr(names, name);
  if (found == NULL) {
    return NULL;
  }
  *to = meanings[found - names];
  return to + 1;
}

char *supine_safetensors_json_string(json_cursor *cursor) {
  if (!supine_safetensors_json_take(cursor, '"')) {
    return NULL;
  }
  char *const begin = cursor->at;
  char *to = begin; /* never ahead of cursor->at: an escape is longer than what it stands for */
  while (cursor->at < cursor->end) {
    const unsigned char c = (unsigned char)*cursor->at;
    if (c == '"') {
      ++cursor->at;
      *to = '\0';
      return begin;
    }
    if (c < 0x20) {
      return NULL;
    }
    if (c == '\\') {
      ++cursor->at;
      to = json_escape(cursor, to);
      if (to == NULL) {
        return NULL;
      }
      continue;
    }
    const size_t length =
        supine_safetensors_utf8_length(cursor->at, (size_t)(cursor->end - cursor->at));
    if (length == 0) {
      return NULL;
    }
    memmove(to, cursor->at, length);
    to += length;
    cursor->at += length;
  }
  return NULL;
}

/* Take a non-negative integer, written without sign, fraction, exponent or leading zeros. */
static bool read_count(json_cursor *cursor, size_t *value) {
  json_skip(cursor);
  const char *const begin = cursor->at;
  size_t number = 0;
  while (cursor->at < cursor->end && *cursor->at >= '0' && *cursor->at <= '9') {
    const size_t digit = (size_t)(*cursor->at - '0');
    if (number > (SIZE_MAX - digit) / 10) {
      return false;
    }
    number = number * 10 + digit;
    ++cursor->at;
  }
  *value = number;
  return cursor->at > begin && (*begin != '0' || cursor->at == begin + 1);
}

bool supine_safetensors_json_counts(json_cursor *cursor, size_t *values, size_t capacity,
                                    size_t *count) {
  *count = 0;
  if (!supine_safetensors_json_take(cursor, '[')) {
    return false;
  }
  if (supine_safetensors_json_take(cursor, ']')) {
    return true;
  }
  do {
    if (*count == capacity || !read_count(cursor, &values[*count])) {
      return false;
    }
    ++*count;
  } while (supine_safetensors_json_take(cursor, ','));
  return supine_safetensors_json_take(cursor, ']');
}
