/* SPDX-License-Identifier: MIT */
/* Split a text of any content into lines, words and numbers. */
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "mesh/io/read.h"

static bool is_blank(unsigned char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\f' || c == '\v';
}

static bool is_digit(unsigned char c) {
  return c >= '0' && c <= '9';
}

bool supine_mesh_text_line(mesh_text *text, mesh_text *line) {
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

bool supine_mesh_text_word(mesh_text *text, mesh_text *word) {
  while (text->at < text->end && is_blank(*text->at)) {
    ++text->at;
  }
  word->at = text->at;
  while (text->at < text->end && !is_blank(*text->at)) {
    ++text->at;
  }
  word->end = text->at;
  return word->at < word->end;
}

bool supine_mesh_text_is(mesh_text word, const char *expected) {
  const size_t length = strlen(expected);
  return (size_t)(word.end - word.at) == length &&
         strncasecmp((const char *)word.at, expected, length) == 0;
}

static size_t skip_digits(mesh_text *word) {
  const unsigned char *begin = word->at;
  while (word->at < word->end && is_digit(*word->at)) {
    ++word->at;
  }
  return (size_t)(word->at - begin);
}

static void skip_sign(mesh_text *word) {
  if (word->at < word->end && (*word->at == '-' || *word->at == '+')) {
    ++word->at;
  }
}

static bool is_number(mesh_text word) {
  skip_sign(&word);
  if (supine_mesh_text_is(word, "nan") || supine_mesh_text_is(word, "inf") ||
      supine_mesh_text_is(word, "infinity")) {
    return true;
  }
  size_t digits = skip_digits(&word);
  if (word.at < word.end && *word.at == '.') {
    ++word.at;
    digits += skip_digits(&word);
  }
  if (digits > 0 && word.at < word.end && (*word.at == 'e' || *word.at == 'E')) {
    ++word.at;
    skip_sign(&word);
    digits = skip_digits(&word);
  }
  return digits > 0 && word.at == word.end;
}

bool supine_mesh_text_count(mesh_text word, uint64_t *value) {
  *value = 0;
  for (const unsigned char *p = word.at; p < word.end; ++p) {
    if (!is_digit(*p) || *value > (uint64_t)INT64_MAX / 10 - 1) {
      return false;
    }
    *value = *value * 10 + (uint64_t)(*p - '0');
  }
  return word.at < word.end;
}

bool supine_mesh_text_number(mesh_text *text, double *value) {
  mesh_text word;
  const bool good = supine_mesh_text_word(text, &word) && is_number(word);
  *value = good ? strtod((const char *)word.at, NULL) : 0.0; /* ends with the word */
  return good;
}

bool supine_mesh_text_position(mesh_text *text, double position[3]) {
  bool good = true;
  for (int k = 0; good && k < 3; ++k) {
    good = supine_mesh_text_number(text, &position[k]);
    position[k] = (double)(float)position[k];
  }
  return good;
}
