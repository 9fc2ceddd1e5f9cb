/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Encode bytes as base64. */
#include <stdint.h>
#include <stdlib.h>

#include "program/view/export/base64.h"

json_t *supine_export_base64(const void *bytes, size_t size) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const unsigned char *from = bytes;
  size_t length = 0;
  char *text = malloc((size + 2) / 3 * 4 + 1);
  for (size_t i = 0; text != NULL && i < size; i += 3) {
    const size_t left = size - i;
    const uint32_t group = ((uint32_t)from[i] << 16) | (left > 1 ? (uint32_t)from[i + 1] << 8 : 0) |
                           (left > 2 ? (uint32_t)from[i + 2] : 0);
    for (unsigned digit = 0; digit < 4; ++digit) {
      text[length++] = digit <= left ? digits[group >> (18 - 6 * digit) & 63] : '=';
    }
  }
  json_t *made = text != NULL ? json_stringn_nocheck(text, length) : NULL;
  free(text);
  return made;
}
