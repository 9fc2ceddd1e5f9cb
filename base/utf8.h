/* SPDX-License-Identifier: MIT */
/** @file Check UTF-8, and make text from files safe to print. */
#ifndef SUPINE_UTF8_H
#define SUPINE_UTF8_H

#include <stddef.h>
#include <string.h>

/** Return the number of bytes of the first UTF-8 character in `text` [size]; 0 if the character is
 * cut off, overlong, a surrogate, out of range or otherwise malformed. */
static inline size_t supine_utf8_length(const char *text, size_t size) {
  const unsigned char *u = (const unsigned char *)text;
  if (size == 0 || u[0] < 0x80) {
    return size == 0 ? 0 : 1;
  }
  size_t length = 2;
  if (u[0] >= 0xF0) {
    length = 4;
  } else if (u[0] >= 0xE0) {
    length = 3;
  }
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

/** Return the number of bytes of the control character that begins at `text`: 1 for those of ASCII,
 * 2 for U+0080 to U+009F; 0 if another character begins there. A terminal obeys such characters. */
static inline size_t supine_utf8_control(const char *text) {
  const unsigned char *u = (const unsigned char *)text;
  if ((u[0] < 0x20 && u[0] != 0) || u[0] == 0x7F) {
    return 1;
  }
  return u[0] == 0xC2 && u[1] >= 0x80 && u[1] <= 0x9F ? 2 : 0;
}

/** Remove the first bytes of a character from the end of a text that was cut, if the rest of the
 * character is missing. */
static inline void supine_utf8_whole(char *text) {
  const size_t length = strlen(text);
  size_t begin = length; /* of the last character */
  while (begin > 0 && length - begin < 3 && ((unsigned char)text[begin - 1] & 0xC0U) == 0x80U) {
    --begin;
  }
  const unsigned lead = begin > 0 ? (unsigned char)text[begin - 1] : 0U;
  size_t wanted = 1;
  if (lead >= 0xC0U) {
    wanted = lead >= 0xF0U ? 4U : 2U + (lead >= 0xE0U);
  }
  if (begin > 0 && length - begin + 1 < wanted) {
    text[begin - 1] = '\0';
  }
}

/** Copy a text to `out`, with each control character but those in `kept` as \xHH. Cut off
 * characters that do not fit into `size` > 0 bytes. */
static inline void supine_utf8_escape(const char *text, const char *kept, char *out, size_t size) {
  static const char digits[] = "0123456789ABCDEF";
  size_t at = 0;
  while (*text != '\0') {
    const size_t control = strchr(kept, *text) == NULL ? supine_utf8_control(text) : 0;
    const unsigned code = (unsigned char)text[control == 2 ? 1 : 0];
    const char escaped[4] = {'\\', 'x', digits[code >> 4], digits[code & 15U]};
    const size_t length = control > 0 ? sizeof escaped : 1;
    if (at + length >= size) {
      break;
    }
    memcpy(out + at, control > 0 ? escaped : text, length);
    at += length;
    text += control > 0 ? control : 1;
  }
  out[at] = '\0';
  if (*text != '\0') {
    supine_utf8_whole(out);
  }
}

#endif
