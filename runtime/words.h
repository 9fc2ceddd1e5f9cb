/* SPDX-License-Identifier: MIT */
/* Compare words that users type. */
#ifndef SUPINE_WORDS_H
#define SUPINE_WORDS_H

#include <stdbool.h>
#include <stddef.h>

/* Compare in upper or lower case (ASCII, in every locale). */
bool supine_words_same(const char *a, const char *b);

/* Longest word of a distance; the rest of it does not count. */
enum { SUPINE_WORD_MAX = 63 };

/* Count the fewest insertions, deletions and replacements of a character that turn `text`, of any
 * length, into `word` (Levenshtein 1966), in upper or lower case. */
size_t supine_words_distance(const char *text, const char *word);

#endif
