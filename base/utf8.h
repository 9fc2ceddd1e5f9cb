/* SPDX-License-Identifier: MIT */
/** @file Check UTF-8. */
#ifndef SUPINE_UTF8_H
#define SUPINE_UTF8_H

#include <stddef.h>

/** Return the number of bytes of the first UTF-8 character in `text` [size]; 0 if the character is
 * cut off, overlong, a surrogate, out of range or otherwise malformed. */
static inline size_t supine_utf8_length(const char *text, size_t size) {
  const unsigned char *u = (const unsigned char *)text;
  if (size == 0 || u[0] < 0x80) {
    return size == 0 ? 0 : 1;
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
  const int bad = (u[0] == 0xE0 && u[1] < 0xA0) || (u[0] == 0xED && u[1] > 0x9F) ||
                  (u[0] == 0xF0 && u[1] < 0x90) || (u[0] == 0xF4 && u[1] > 0x8F);
  return bad ? 0 : length;
}

#endif
