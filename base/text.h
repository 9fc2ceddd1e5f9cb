/* SPDX-License-Identifier: MIT */
/** @file Build sentences from parts, and compare endings of names. */
#ifndef SUPINE_TEXT_H
#define SUPINE_TEXT_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

/** Format text like printf, and append it to `text`, which has room for `size` bytes. Cut off what
 * does not fit. */
SUPINE_PRINTF(3, 4)
void supine_text_add(char *text, size_t size, const char *format, ...);

/** Write "; did you mean 'WORD'?", to follow what is wrong in a message; or nothing if `word` is
 * NULL.
 * @param before  what stands before the word, such as "--"
 * @param text    [size] written */
void supine_text_suggest(const char *before, const char *word, char *text, size_t size);

/** Return whether a text is UTF-8. */
bool supine_text_is_utf8(const char *text);

/** Copy `text` to `shortened`, which has room for `size` bytes, 4 or more. If it is too long, cut
 * it between two UTF-8 characters and end it with "...", an ellipsis of one character. Return
 * `shortened`. */
const char *supine_text_shorten(const char *text, size_t size, char *shortened);

/** Replace bytes that are not UTF-8, which file names may contain, by '?'. Return `text`. */
char *supine_text_make_utf8(char *text);

/** Return the part of a path after the last '/'. */
const char *supine_text_file_name(const char *path);

/** Return whether a name ends in `ending` (".csv"), ignoring case, after at least one character. */
bool supine_text_ends_in(const char *name, const char *ending);

/** Distances below this one, in mm, are at the level of the storage of positions: their digits
 * depend on the processor. */
#define SUPINE_TEXT_DISTANCE_LEAST 0.002

/** Text of a number. */
typedef struct supine_number_text {
  char text[32];
} supine_number_text;

/** Format a distance in mm: with three decimals, or as "below 0.002". */
supine_number_text supine_text_distance(double mm);

/** Format a change rounded to a whole number: with its sign, or as "0". */
supine_number_text supine_text_change(double change);

/** Decode base64 (RFC 4648) from `at` up to `end`, or to the first character that is neither base64
 * nor white space. Several streams may follow each other, each padded to groups of four characters.
 * @param bytes  output: room for 3 bytes for each 4 characters
 * @return the number of bytes decoded */
size_t supine_text_decode_base64(const char *at, const char *end, unsigned char *bytes);

#endif
