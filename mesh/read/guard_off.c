/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Does an OFF file hold the vertices and faces that it promises? Its bytes are written anew on the
 * way, without comments, colours and normals, over which the importer loses faces. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/read/read.h"

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

static void put(FILE *out, mesh_text word) {
  (void)fwrite(word.at, 1, (size_t)(word.end - word.at), out);
}

static bool copy_vertex(mesh_text line, FILE *out) {
  for (int k = 0; k < 3; ++k) {
    mesh_text word;
    if (!supine_mesh_text_word(&line, &word) || !supine_mesh_text_is_number(word)) {
      return false;
    }
    put(out, word);
    (void)fputc(k < 2 ? ' ' : '\n', out);
  }
  return true;
}

static bool copy_face(mesh_text line, uint64_t vertices, FILE *out) {
  mesh_text word;
  uint64_t corners = 0;
  if (!supine_mesh_text_word(&line, &word) || !supine_mesh_text_count(word, &corners) ||
      corners == 0) {
    return false;
  }
  put(out, word);
  for (; corners > 0; --corners) {
    uint64_t corner = 0;
    if (!supine_mesh_text_word(&line, &word) || !supine_mesh_text_count(word, &corner) ||
        corner >= vertices) {
      return false;
    }
    (void)fputc(' ', out);
    put(out, word);
  }
  (void)fputc('\n', out);
  return true;
}

static supine_status copy(mesh_file *file, FILE *out, supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  uint64_t vertices = 0;
  uint64_t faces = 0;
  if (!read_counts(&text, &vertices, &faces)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: does not begin with OFF and the counts of vertices and faces",
                            file->path);
  }
  (void)fprintf(out, "OFF\n%llu %llu 0\n", (unsigned long long)vertices, (unsigned long long)faces);
  for (uint64_t i = 0; i < vertices; ++i) {
    if (!next_line(&text, &line) || !copy_vertex(line, out)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: truncated or malformed at vertex %llu of %llu", file->path,
                              (unsigned long long)i, (unsigned long long)vertices);
    }
  }
  for (uint64_t i = 0; i < faces; ++i) {
    if (!next_line(&text, &line) || !copy_face(line, vertices, out)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: truncated or malformed at face %llu of %llu, with %llu vertices",
                              file->path, (unsigned long long)i, (unsigned long long)faces,
                              (unsigned long long)vertices);
    }
  }
  file->faces = (size_t)faces;
  return SUPINE_OK;
}

supine_status supine_mesh_guard_off(mesh_file *file, supine_error *error) {
  if (!supine_mesh_guard_text(file, error)) {
    return SUPINE_ERROR_FORMAT;
  }
  char *bytes = NULL;
  size_t size = 0;
  FILE *out = open_memstream(&bytes, &size);
  if (out == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", file->path);
  }
  supine_status status = copy(file, out, error);
  if (fclose(out) != 0 && status == SUPINE_OK) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", file->path);
  }
  if (status == SUPINE_OK) {
    free(file->bytes);
    file->bytes = (unsigned char *)bytes;
    file->size = size;
  } else {
    free(bytes);
  }
  return status;
}
