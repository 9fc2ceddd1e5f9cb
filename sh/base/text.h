/* SPDX-License-Identifier: MIT */
/** @file
 * Sentences put together from parts. */
#ifndef SUPINE_TEXT_H
#define SUPINE_TEXT_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Adds to the end of `text`, of `size` bytes with its NUL, by a printf format; what does not fit
 * is left out. */
SUPINE_PRINTF(3, 4)
void supine_text_add(char *text, size_t size, const char *format, ...);

#ifdef __cplusplus
}
#endif
#endif
