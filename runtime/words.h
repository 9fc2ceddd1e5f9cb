/* SPDX-License-Identifier: MIT */
/* Words as users type them. */
#ifndef SUPINE_WORDS_H
#define SUPINE_WORDS_H

#include <stddef.h>

/* Longest word that a distance is taken to. */
enum { SUPINE_WORD_MAX = 63 };

/* ASCII alone, whatever the locale. */
int supine_words_lower(char c);

/* Fewest insertions, deletions and replacements of a character that turn `text`, of any length,
 * into `word` (Levenshtein 1966), cases alike. */
size_t supine_words_distance(const char *text, const char *word);

#endif
