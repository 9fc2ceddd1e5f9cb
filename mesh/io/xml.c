/* SPDX-License-Identifier: MIT */
/* Find elements and attributes in the text of an XML file. */
#include <stdio.h>
#include <string.h>

#include "base/ascii.h"

#include "mesh/io/read.h"

bool supine_io_element_find(const char *from, const char *to, const char *name,
                            mesh_element *found) {
  const size_t length = strlen(name);
  const char *at = from < to ? memchr(from, '<', (size_t)(to - from)) : NULL;
  while (at != NULL) {
    const size_t left = (size_t)(to - at);
    const char *next = at + 1;
    if (left > 4 && strncmp(at, "<!--", 4) == 0) {
      const char *closed = strstr(at + 4, "-->");
      next = closed != NULL && closed < to ? closed : to;
    } else if (left > length + 1 && strncmp(at + 1, name, length) == 0 &&
               (supine_ascii_is_space(at[1 + length]) || strchr("/>", at[1 + length]) != NULL)) {
      const char *end = memchr(at, '>', left);
      if (end == NULL) {
        return false;
      }
      *found = (mesh_element){at + 1 + length, end, end + 1};
      return true;
    }
    at = next < to ? memchr(next, '<', (size_t)(to - next)) : NULL;
  }
  return false;
}

/* Move past blanks, not beyond `end`. */
static const char *skip_blanks(const char *at, const char *end) {
  while (at < end && supine_ascii_is_space(*at)) {
    ++at;
  }
  return at;
}

bool supine_io_element_attribute(const mesh_element *e, const char *name, char *value,
                                 size_t size) {
  const size_t length = strlen(name);
  for (const char *at = e->at; at + length + 2 < e->end; ++at) {
    if (!supine_ascii_is_space(at[-1]) || strncmp(at, name, length) != 0) {
      continue;
    }
    const char *sign = skip_blanks(at + length, e->end);
    const char *from = sign < e->end && *sign == '=' ? skip_blanks(sign + 1, e->end) : e->end;
    if (from < e->end && (*from == '"' || *from == '\'')) {
      const char *to = memchr(from + 1, *from, (size_t)(e->end - from - 1));
      if (to == NULL) {
        return false;
      }
      const ptrdiff_t taken = to - from - 1;
      (void)snprintf(value, size, "%.*s", (int)(taken < 256 ? taken : 256), from + 1);
      return true;
    }
  }
  return false;
}
