/* SPDX-License-Identifier: MIT */
/* The axes that a comment in a file's head names, as 3D Slicer writes them: SPACE=LPS. */
#include <ctype.h>
#include <string.h>
#include <strings.h>

#include "mesh/io/read.h"

/* The next place, from `at` on, where `word` stands with no letter or digit before it. */
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

static bool is_axes(const unsigned char *at, const unsigned char *end, const char *axes) {
  return end - at >= 3 && strncasecmp((const char *)at, axes, 3) == 0 && ends_word(at + 3, end);
}

static mesh_space find_space(const unsigned char *begin, const unsigned char *end) {
  static const char tag[] = "SPACE=";
  const unsigned char *at = find_word(begin, end, begin, tag);
  if (at == NULL) {
    return MESH_SPACE_NONE;
  }
  at += sizeof tag - 1;
  return is_axes(at, end, "LPS")   ? MESH_SPACE_LPS
         : is_axes(at, end, "RAS") ? MESH_SPACE_RAS
                                   : MESH_SPACE_FOREIGN;
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
  file->space = find_space(file->bytes, end);
  file->mentions_ras = mentions_ras(file->bytes, end);
}
