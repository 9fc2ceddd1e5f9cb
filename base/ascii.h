/* SPDX-License-Identifier: MIT */
/** @file Classify and compare characters of ASCII in the same way in every locale. In a Turkish
 * locale strcasecmp finds that "i" and "I" differ, and in Latin 1 isspace accepts a byte of UTF-8.
 */
#ifndef SUPINE_ASCII_H
#define SUPINE_ASCII_H

#include <stdbool.h>
#include <stddef.h>

static inline bool supine_ascii_is_space(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

static inline bool supine_ascii_is_digit(char c) {
  return c >= '0' && c <= '9';
}

static inline char supine_ascii_upper(char c) {
  return (char)(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
}

static inline bool supine_ascii_is_letter(char c) {
  return supine_ascii_upper(c) >= 'A' && supine_ascii_upper(c) <= 'Z';
}

/** Return whether the first `count` characters of two texts are the same, ignoring case. As in
 * strncasecmp, only the characters up to a common end count. */
static inline bool supine_ascii_same_begin(const char *a, const char *b, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    if (supine_ascii_upper(a[i]) != supine_ascii_upper(b[i])) {
      return false;
    }
    if (a[i] == '\0') {
      return true;
    }
  }
  return true;
}

/** Return whether two texts are the same, ignoring case. */
static inline bool supine_ascii_same(const char *a, const char *b) {
  return supine_ascii_same_begin(a, b, (size_t)-1);
}

#endif
