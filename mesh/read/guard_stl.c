/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Is an STL file, binary or text, as long as it says? */
#include <string.h>

#include "mesh/read/read.h"

enum { STL_HEADER = 80, STL_FACET = 50 };

static size_t binary_facets(const mesh_file *file) {
  const unsigned char *at = file->bytes + STL_HEADER;
  return (size_t)at[0] | (size_t)at[1] << 8 | (size_t)at[2] << 16 | (size_t)at[3] << 24;
}

/* Some binary files begin with "solid" too: then the length decides, or a byte that no text has. */
static bool is_text(const mesh_file *file) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text word;
  if (!supine_mesh_text_word(&text, &word) || !supine_mesh_text_is(word, "solid")) {
    return false;
  }
  const size_t head = file->size < 1024 ? file->size : 1024;
  return memchr(file->bytes, '\0', head) == NULL;
}

static supine_status check_text(mesh_file *file, supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  mesh_text word;
  size_t corners = 0;
  bool open = true;
  for (size_t number = 1; supine_mesh_text_line(&text, &line); ++number) {
    if (!supine_mesh_text_word(&line, &word)) {
      continue;
    }
    open = !supine_mesh_text_is(word, "endsolid") && (open || supine_mesh_text_is(word, "solid"));
    if (supine_mesh_text_is(word, "vertex")) {
      ++corners;
      if (!supine_mesh_text_skip_numbers(&line, 3)) {
        return supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%s: line %zu: a vertex wants three numbers", file->path, number);
      }
    }
  }
  if (open || corners % 3 != 0) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: the STL text ends before its endsolid: the file is truncated",
                            file->path);
  }
  file->faces = corners / 3;
  return SUPINE_OK;
}

supine_status supine_mesh_guard_stl(mesh_file *file, supine_error *error) {
  const bool has_count = file->size >= STL_HEADER + 4;
  const size_t promised = has_count ? STL_HEADER + 4 + STL_FACET * binary_facets(file) : 0;
  if (has_count && promised == file->size) {
    supine_mesh_space_note(file, STL_HEADER);
    file->faces = binary_facets(file);
    file->whole = true;
    return file->faces > 0
               ? SUPINE_OK
               : supine_error_set(error, SUPINE_ERROR_MESH,
                                  "%s: no triangles: the STL file has 0 facets", file->path);
  }
  if (is_text(file)) {
    return supine_mesh_guard_text(file, error) ? check_text(file, error) : SUPINE_ERROR_FORMAT;
  }
  if (!has_count) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: %zu bytes are too few for an STL file: it is truncated",
                            file->path, file->size);
  }
  return supine_error_set(error, SUPINE_ERROR_FORMAT,
                          "%s: the file has %zu bytes where an STL of %zu facets has %zu: it is "
                          "truncated or not an STL file",
                          file->path, file->size, binary_facets(file), promised);
}
