/* SPDX-License-Identifier: MIT */
/** @file
 * The part of JSON that a safetensors header uses: objects, strings, arrays of counts. */
#ifndef SUPINE_JSON_H
#define SUPINE_JSON_H

#include <stdbool.h>
#include <stddef.h>

/** A place in JSON text that the reader may change: strings decode where they stand. */
typedef struct json_cursor {
  char *at;
  char *end;
} json_cursor;

/** Skips white space, then takes `character` when it is next; says whether it was. */
bool supine_safetensors_json_take(json_cursor *cursor, char character);

/** Skips white space and says whether the text ends there. */
bool supine_safetensors_json_at_end(json_cursor *cursor);

/** Takes a string and decodes it in place, NUL-terminated UTF-8; NULL when there is none, or when
 * it holds a control character, a NUL, a bad escape or bytes that are not UTF-8. */
char *supine_safetensors_json_string(json_cursor *cursor);

/** Takes an array of at most `capacity` counts. */
bool supine_safetensors_json_counts(json_cursor *cursor, size_t *values, size_t capacity,
                                    size_t *count);

/** Bytes of the UTF-8 character that `text` (of `size` bytes) begins with; 0 when malformed. */
size_t supine_safetensors_utf8_length(const char *text, size_t size);

#endif
