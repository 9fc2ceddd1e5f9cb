/* SPDX-License-Identifier: MIT */
/* Refuse bytes in a text that importers mishandle: they look for the LF after every CR, and end
 * words at a NUL. */
#include <string.h>

#include "mesh/io/read.h"

bool supine_mesh_guard_text(const mesh_file *file, supine_error *error) {
  const unsigned char *end = file->bytes + file->size;
  const unsigned char *nul = memchr(file->bytes, '\0', file->size);
  if (nul != NULL) {
    (void)supine_error_set(error, SUPINE_ERROR_FORMAT,
                           "%s: the text holds a NUL byte; save it as plain ASCII or UTF-8",
                           file->path);
    return false;
  }
  for (const unsigned char *at = file->bytes; (at = memchr(at, '\r', (size_t)(end - at))) != NULL;
       ++at) {
    if (at + 1 == end || at[1] != '\n') {
      (void)supine_error_set(error, SUPINE_ERROR_FORMAT,
                             "%s: a carriage return without a line feed; save it with LF line ends",
                             file->path);
      return false;
    }
  }
  return true;
}
