/* SPDX-License-Identifier: MIT */
/* Check that the coordinates of an OBJ file are numbers. */
#include "mesh/io/read.h"

/* Turn a line that names a file of materials into a comment: a surface needs no colours. */
static void drop_materials(mesh_file *file, mesh_text word) {
  if (supine_mesh_text_is(word, "mtllib")) {
    file->bytes[word.at - file->bytes] = '#';
  }
}

supine_status supine_mesh_guard_obj(mesh_file *file, supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  mesh_text word;
  if (!supine_mesh_guard_text(file, error)) {
    return SUPINE_ERROR_FORMAT;
  }
  for (size_t number = 1; supine_mesh_text_line(&text, &line); ++number) {
    if (!supine_mesh_text_word(&line, &word)) {
      continue;
    }
    drop_materials(file, word);
    double position[3];
    if (supine_mesh_text_is(word, "v") && !supine_mesh_text_position(&line, position)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: line %zu: a vertex needs three numbers", file->path, number);
    }
  }
  return SUPINE_OK;
}
