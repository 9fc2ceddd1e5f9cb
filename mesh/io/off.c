/* SPDX-License-Identifier: MIT */
/* OFF: vertices and faces, one a line, with colours and normals that a surface does not need. */
#include <stdlib.h>
#include <string.h>

#include "mesh/io/read.h"

/* The next line with a word on it, up to a comment. */
static bool next_line(mesh_text *text, mesh_text *line) {
  while (supine_mesh_text_line(text, line)) {
    const unsigned char *comment = memchr(line->at, '#', (size_t)(line->end - line->at));
    line->end = comment == NULL ? line->end : comment;
    mesh_text rest = *line;
    mesh_text word;
    if (supine_mesh_text_word(&rest, &word)) {
      return true;
    }
  }
  return false;
}

/* OFF, with letters in front for what else its vertices carry. */
static bool is_magic(mesh_text word) {
  static const char *const magic[] = {"OFF",   "COFF",   "NOFF",   "CNOFF",
                                      "STOFF", "STCOFF", "STNOFF", "STCNOFF"};
  for (size_t i = 0; i < sizeof magic / sizeof *magic; ++i) {
    if (supine_mesh_text_is(word, magic[i])) {
      return true;
    }
  }
  return false;
}

static bool read_counts(mesh_text *text, uint64_t *vertices, uint64_t *faces) {
  mesh_text line;
  mesh_text word;
  if (!next_line(text, &line) || !supine_mesh_text_word(&line, &word) || !is_magic(word)) {
    return false;
  }
  if (!supine_mesh_text_word(&line, &word)) { /* the counts on the first line, or on the next */
    if (!next_line(text, &line) || !supine_mesh_text_word(&line, &word)) {
      return false;
    }
  }
  return supine_mesh_text_count(word, vertices) && supine_mesh_text_word(&line, &word) &&
         supine_mesh_text_count(word, faces);
}

/* How many corners, and which; false for what is no number. */
static bool read_face(mesh_text line, double corners[MESH_CORNERS_MAX], uint64_t *count) {
  mesh_text word;
  if (!supine_mesh_text_word(&line, &word) || !supine_mesh_text_count(word, count) || *count == 0) {
    return false;
  }
  for (uint64_t k = 0; k < *count; ++k) {
    uint64_t corner = 0;
    if (!supine_mesh_text_word(&line, &word) || !supine_mesh_text_count(word, &corner)) {
      return false;
    }
    corners[k < MESH_CORNERS_MAX ? k : 0] = (double)corner;
  }
  return true;
}

supine_status supine_mesh_read_off(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                   supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  uint64_t vertices = 0;
  uint64_t faces = 0;
  if (!supine_mesh_guard_text(file, error)) {
    return SUPINE_ERROR_FORMAT;
  }
  if (!read_counts(&text, &vertices, &faces)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: does not begin with OFF and the counts of vertices and faces",
                            file->path);
  }
  const size_t room = (size_t)(text.end - text.at) / 6 + 1; /* "0 0 0\n" */
  mesh->vertices = malloc(3 * (vertices < room ? (size_t)vertices : room) * sizeof(double));
  if (mesh->vertices == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", file->path);
  }
  for (uint64_t i = 0; i < vertices; ++i, ++mesh->vertex_count) {
    if (!next_line(&text, &line) || !supine_mesh_text_position(&line, mesh->vertices + 3 * i)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: truncated or malformed at vertex %llu of %llu", file->path,
                              (unsigned long long)i, (unsigned long long)vertices);
    }
  }
  mesh_faces out = {.path = file->path, .mesh = mesh};
  supine_status status = SUPINE_OK;
  for (uint64_t i = 0; status == SUPINE_OK && i < faces; ++i) {
    double corners[MESH_CORNERS_MAX];
    uint64_t count = 0;
    if (!next_line(&text, &line) || !read_face(line, corners, &count)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: truncated or malformed at face %llu of %llu, with %llu vertices",
                              file->path, (unsigned long long)i, (unsigned long long)faces,
                              (unsigned long long)vertices);
    }
    status = supine_mesh_faces_add(&out, corners, (size_t)count, error);
  }
  *dropped = out.dropped;
  return status;
}
