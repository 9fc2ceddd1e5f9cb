/* SPDX-License-Identifier: MIT */
/* Find the axes named by a comment in a file's head, as 3D Slicer writes them: SPACE=LPS. */
#include <ctype.h>
#include <string.h>
#include <strings.h>

#include "mesh/io/read.h"

/* Find the next `word` from `at` on that no letter or digit precedes. */
static const unsigned char *find_word(const unsigned char *at, const unsigned char *end,
                                      const unsigned char *begin, const char *word) {
  const size_t length = strlen(word);
  for (; (size_t)(end - at) >= length; ++at) {
    if (strncasecmp((const char *)at, word, length) == 0 && (at == begin || !isalnum(at[-1]))) {
      return at;
    }
  }
  return NULL;
}

static bool ends_word(const unsigned char *at, const unsigned char *end) {
  return at == end || !isalnum(*at);
}

static bool find_space(const unsigned char *begin, const unsigned char *end, supine_axes *axes) {
  static const char tag[] = "SPACE=";
  const unsigned char *at = find_word(begin, end, begin, tag);
  *axes = SUPINE_AXES_AUTO;
  if (at == NULL) {
    return false;
  }
  at += sizeof tag - 1;
  if (end - at >= 3 && ends_word(at + 3, end)) {
    const char letters[4] = {(char)toupper(at[0]), (char)toupper(at[1]), (char)toupper(at[2]),
                             '\0'};
    (void)supine_mesh_axes_parse(letters, axes);
  }
  return true;
}

static bool mentions_ras(const unsigned char *begin, const unsigned char *end) {
  const unsigned char *at = begin;
  while ((at = find_word(at, end, begin, "RAS")) != NULL && !ends_word(at + 3, end)) {
    ++at;
  }
  return at != NULL;
}

void supine_mesh_space_note(mesh_file *file, size_t size) {
  const unsigned char *end = file->bytes + (size < file->size ? size : file->size);
  file->tagged = find_space(file->bytes, end, &file->space);
  file->mentions_ras = mentions_ras(file->bytes, end);
}
