/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Encode bytes as base64. */
#include <stdint.h>

#include "program/view/export/base64.h"

void supine_export_base64_write(const void *bytes, size_t size, FILE *file) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const unsigned char *from = bytes;
  char text[4096];
  size_t length = 0;
  for (size_t i = 0; i < size; i += 3) {
    const size_t left = size - i;
    const uint32_t group = ((uint32_t)from[i] << 16) | (left > 1 ? (uint32_t)from[i + 1] << 8 : 0) |
                           (left > 2 ? (uint32_t)from[i + 2] : 0);
    for (unsigned digit = 0; digit < 4; ++digit) {
      text[length] = '=';
      if (digit <= left) {
        text[length] = digits[group >> (18 - 6 * digit) & 63];
      }
      ++length;
    }
    if (length == sizeof text) {
      (void)fwrite(text, 1, length, file);
      length = 0;
    }
  }
  (void)fwrite(text, 1, length, file);
}
