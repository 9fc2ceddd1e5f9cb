/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Does an OFF file hold the vertices and faces that it promises? */
#include <string.h>

#include "internal.h"

/* The next line with a word on it that is no comment. */
static bool next_line(mesh_text *text, mesh_text *line) {
  while (mesh_text_line(text, line)) {
    const unsigned char *comment = memchr(line->at, '#', (size_t)(line->end - line->at));
    line->end = comment == NULL ? line->end : comment;
    mesh_text rest = *line;
    mesh_text word;
    if (mesh_text_word(&rest, &word)) {
      return true;
    }
  }
  return false;
}

static bool read_counts(mesh_text *text, uint64_t *vertices, uint64_t *faces) {
  mesh_text line;
  mesh_text word;
  if (!next_line(text, &line) || !mesh_text_word(&line, &word) || word.end - word.at < 3) {
    return false;
  }
  word.at = word.end - 3; /* OFF, or with letters for what else the vertices carry: COFF, NOFF */
  if (!mesh_text_is(word, "off")) {
    return false;
  }
  if (!mesh_text_word(&line, &word)) { /* the counts on the first line, or on the next */
    if (!next_line(text, &line) || !mesh_text_word(&line, &word)) {
      return false;
    }
  }
  return mesh_text_count(word, vertices) && mesh_text_word(&line, &word) &&
         mesh_text_count(word, faces);
}

static bool face_is_legal(mesh_text line, uint64_t vertices) {
  mesh_text word;
  uint64_t corners = 0;
  if (!mesh_text_word(&line, &word) || !mesh_text_count(word, &corners) || corners == 0) {
    return false;
  }
  for (; corners > 0; --corners) {
    uint64_t corner = 0;
    if (!mesh_text_word(&line, &word) || !mesh_text_count(word, &corner) || corner >= vertices) {
      return false;
    }
  }
  return true;
}

supine_status mesh_guard_off(mesh_file *file, supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  uint64_t vertices = 0;
  uint64_t faces = 0;
  if (!mesh_guard_text(file, error)) {
    return SUPINE_ERROR_FORMAT;
  }
  if (!read_counts(&text, &vertices, &faces)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: does not begin with OFF and the counts of vertices and faces",
                            file->path);
  }
  for (uint64_t i = 0; i < vertices; ++i) {
    if (!next_line(&text, &line) || !mesh_text_skip_numbers(&line, 3)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: truncated or malformed: vertex %llu of %llu", file->path,
                              (unsigned long long)i, (unsigned long long)vertices);
    }
  }
  for (uint64_t i = 0; i < faces; ++i) {
    if (!next_line(&text, &line) || !face_is_legal(line, vertices)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: truncated or malformed: face %llu of %llu (%llu vertices)",
                              file->path, (unsigned long long)i, (unsigned long long)faces,
                              (unsigned long long)vertices);
    }
  }
  file->faces = (size_t)faces;
  return SUPINE_OK;
}
