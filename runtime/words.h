/* SPDX-License-Identifier: MIT */
/* Compare words that users type. */
#ifndef SUPINE_WORDS_H
#define SUPINE_WORDS_H

#include <stdbool.h>
#include <stddef.h>

/* Return whether two words are the same, ignoring the case of ASCII letters in every locale. */
bool supine_words_same(const char *a, const char *b);

/* Largest number of characters of `word` that supine_words_distance compares. */
enum { SUPINE_WORD_MAX = 63 };

/* Return the smallest number of characters to insert, delete or replace to turn `text`, of any
 * length, into `word`, ignoring case (Levenshtein 1966). */
size_t supine_words_distance(const char *text, const char *word);

/* Return whether `text` may be a misspelling of `word`: the check `suggestion` takes the share of
 * the word's characters that differ. */
bool supine_words_close(const char *text, const char *word);

#endif
