/* SPDX-License-Identifier: MIT */
/* Compare words that users type. */
#ifndef SUPINE_WORDS_H
#define SUPINE_WORDS_H

#include <stdbool.h>
#include <stddef.h>

/* Report whether two words are the same, ignoring case (of ASCII letters only, in every locale). */
bool supine_words_same(const char *a, const char *b);

/* Largest number of characters of `word` that supine_words_distance compares. */
enum { SUPINE_WORD_MAX = 63 };

/* Count the fewest insertions, deletions and replacements of a character that turn `text`, of any
 * length, into `word`, ignoring case (Levenshtein 1966). */
size_t supine_words_distance(const char *text, const char *word);

#endif
