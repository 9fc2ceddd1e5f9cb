/* SPDX-License-Identifier: MIT */
/** @file
 * Sentences put together from parts, and how names end. */
#ifndef SUPINE_TEXT_H
#define SUPINE_TEXT_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

/** Adds to the end of `text`, of `size` bytes with its NUL, by a printf format; what does not fit
 * is left out. */
SUPINE_PRINTF(3, 4)
void supine_text_add(char *text, size_t size, const char *format, ...);

/** Replaces bytes that are not UTF-8, as names of files may hold, by '?'. Returns `text`. */
char *supine_text_make_utf8(char *text);

/** Does a name end in `ending` (".csv"), with something before it? */
bool supine_text_ends_in(const char *name, const char *ending);
/** The same, capitals or not. */
bool supine_text_ends_in_any_case(const char *name, const char *ending);

#endif
