/* SPDX-License-Identifier: MIT */
#include <string.h>

#include <supine/inputs.h>

#include "runtime/words.h"

static int lower(char c) {
  return c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c;
}

bool supine_words_same(const char *a, const char *b) {
  while (*a != '\0' && lower(*a) == lower(*b)) {
    ++a;
    ++b;
  }
  return *a == *b;
}

size_t supine_words_distance(const char *text, const char *word) {
  const size_t whole = strlen(word);
  const size_t length = whole < SUPINE_WORD_MAX ? whole : SUPINE_WORD_MAX;
  size_t row[SUPINE_WORD_MAX + 1];
  for (size_t j = 0; j <= length; ++j) {
    row[j] = j;
  }
  for (const char *c = text; *c != '\0'; ++c) {
    size_t diagonal = row[0]++;
    for (size_t j = 1; j <= length; ++j) {
      const int differ = lower(*c) != lower(word[j - 1]);
      const size_t replaced = diagonal + (differ ? 1 : 0);
      const size_t shifted = 1 + (row[j] < row[j - 1] ? row[j] : row[j - 1]);
      diagonal = row[j];
      row[j] = replaced < shifted ? replaced : shifted;
    }
  }
  return row[length];
}

bool supine_words_close(const char *text, const char *word) {
  const double differ = (double)supine_words_distance(text, word) / (double)strlen(word);
  return supine_input_judge(SUPINE_INPUT_SUGGESTION, differ) == SUPINE_INPUT_TAKEN;
}
