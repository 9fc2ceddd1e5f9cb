/* SPDX-License-Identifier: MIT */
/* Split a text of any content into lines, words and numbers; decode binary numbers. */
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/number.h"

#include "mesh/io/read.h"

bool supine_io_text_line(mesh_text *text, mesh_text *line) {
  if (text->at >= text->end) {
    return false;
  }
  const unsigned char *stop = memchr(text->at, '\n', (size_t)(text->end - text->at));
  *line = (mesh_text){text->at, stop == NULL ? text->end : stop};
  text->at = stop == NULL ? text->end : stop + 1;
  if (line->end > line->at && line->end[-1] == '\r') {
    --line->end;
  }
  return true;
}

bool supine_io_text_word(mesh_text *text, mesh_text *word) {
  while (text->at < text->end && supine_ascii_is_space((char)*text->at)) {
    ++text->at;
  }
  word->at = text->at;
  while (text->at < text->end && !supine_ascii_is_space((char)*text->at)) {
    ++text->at;
  }
  word->end = text->at;
  return word->at < word->end;
}

bool supine_io_text_is(mesh_text word, const char *expected) {
  const size_t length = strlen(expected);
  return (size_t)(word.end - word.at) == length &&
         supine_ascii_same_begin((const char *)word.at, expected, length);
}

bool supine_io_text_count(mesh_text word, uint64_t *value) {
  *value = 0;
  for (const unsigned char *p = word.at; p < word.end; ++p) {
    if (!supine_ascii_is_digit((char)*p) || *value > (uint64_t)INT64_MAX / 10 - 1) {
      return false;
    }
    *value = *value * 10 + (uint64_t)(*p - '0');
  }
  return word.at < word.end;
}

bool supine_io_text_number(mesh_text *text, double *value) {
  mesh_text word;
  char *end = NULL;
  *value = 0.0;
  if (!supine_io_text_word(text, &word)) {
    return false;
  }
  *value = supine_number_parse((const char *)word.at, &end);
  return (const unsigned char *)end == word.end;
}

bool supine_io_text_position(mesh_text *text, double position[3]) {
  bool good = true;
  for (int k = 0; good && k < 3; ++k) {
    good = supine_io_text_number(text, &position[k]);
    position[k] = (double)(float)position[k];
  }
  return good;
}

const mesh_type *supine_io_type_find(mesh_text name) {
  static const mesh_type types[] = {
      {"char", 1, true, false},    {"int8", 1, true, false},    {"uchar", 1, false, false},
      {"uint8", 1, false, false},  {"short", 2, true, false},   {"int16", 2, true, false},
      {"ushort", 2, false, false}, {"uint16", 2, false, false}, {"int", 4, true, false},
      {"int32", 4, true, false},   {"uint", 4, false, false},   {"uint32", 4, false, false},
      {"int64", 8, true, false},   {"uint64", 8, false, false}, {"float", 4, true, true},
      {"float32", 4, true, true},  {"double", 8, true, true},   {"float64", 8, true, true}};
  for (size_t i = 0; i < sizeof types / sizeof *types; ++i) {
    if (supine_io_text_is(name, types[i].name)) {
      return &types[i];
    }
  }
  return NULL;
}

double supine_io_type_decode(const mesh_type *type, const unsigned char *bytes, bool big_endian) {
  uint64_t bits = 0;
  for (unsigned k = 0; k < type->size; ++k) {
    bits = bits << 8 | bytes[big_endian ? k : type->size - 1 - k];
  }
  if (type->is_real && type->size == 8) {
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
  }
  if (type->is_real) {
    const uint32_t low = (uint32_t)bits;
    float value;
    memcpy(&value, &low, sizeof value);
    return (double)value;
  }
  const uint64_t sign = UINT64_C(1) << (8 * type->size - 1);
  return type->is_signed && (bits & sign) != 0 ? (double)(int64_t)(bits - sign) - (double)sign
                                               : (double)bits;
}

supine_status supine_io_guard_text(const mesh_file *file, supine_error *error) {
  const unsigned char *end = file->bytes + file->size;
  SUPINE_REFUSE_IF(memchr(file->bytes, '\0', file->size) != NULL, error, SUPINE_ERROR_FORMAT,
                   "%s: the text holds a NUL byte; save it as plain ASCII or UTF-8", file->path);
  for (const unsigned char *at = file->bytes; (at = memchr(at, '\r', (size_t)(end - at))) != NULL;
       ++at) {
    SUPINE_REFUSE_IF(at + 1 == end || at[1] != '\n', error, SUPINE_ERROR_FORMAT,
                     "%s: a line ends in CR alone; save the text with LF line ends", file->path);
  }
  return SUPINE_OK;
}

size_t supine_io_little_endian(const unsigned char *at, size_t bytes) {
  size_t number = 0;
  while (bytes-- > 0) {
    number = number << 8 | at[bytes];
  }
  return number;
}
