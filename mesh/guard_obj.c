/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Are the coordinates of an OBJ file numbers? The importer reads other words as 0. */
#include "internal.h"

supine_status mesh_guard_obj(mesh_file *file, supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  mesh_text word;
  for (size_t number = 1; mesh_text_line(&text, &line); ++number) {
    if (mesh_text_word(&line, &word) && mesh_text_is(word, "v") &&
        !mesh_text_skip_numbers(&line, 3)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: line %zu: a vertex wants three numbers", file->path, number);
    }
  }
  return SUPINE_OK;
}
