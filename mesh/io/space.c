/* SPDX-License-Identifier: MIT */
/* Find the axes named by a comment in a file's head, as 3D Slicer writes them: SPACE=LPS. */
#include <ctype.h>
#include <stdio.h>
#include <string.h>

#include "mesh/io/read.h"

/* Find the next `word` from `at` on that no letter or digit precedes. */
static const char *find_word(const char *at, const char *begin, const char *word) {
  while ((at = strcasestr(at, word)) != NULL && at > begin && isalnum((unsigned char)at[-1])) {
    ++at;
  }
  return at;
}

void supine_mesh_space_note(mesh_file *file, size_t size) {
  char head[MESH_HEAD_SIZE + 1];
  char letters[4] = "";
  (void)snprintf(head, sizeof head, "%.*s", (int)(size < MESH_HEAD_SIZE ? size : MESH_HEAD_SIZE),
                 (const char *)file->bytes);
  const char *tag = find_word(head, head, "SPACE=");
  const char *word = head;
  file->tagged = tag != NULL;
  file->space = SUPINE_AXES_AUTO;
  if (tag != NULL && !isalnum((unsigned char)tag[strnlen(tag, 9)])) {
    for (size_t k = 0; k < 3; ++k) {
      letters[k] = (char)toupper((unsigned char)tag[strnlen(tag, 6 + k)]);
    }
    (void)supine_mesh_axes_parse(letters, &file->space);
  }
  while ((word = find_word(word, head, "RAS")) != NULL && isalnum((unsigned char)word[3])) {
    ++word;
  }
  file->mentions_ras = word != NULL;
}
