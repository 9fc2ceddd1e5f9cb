/* SPDX-License-Identifier: MIT */
/* Read STL, binary or text: three corners for each facet. */
#include <stdlib.h>
#include <string.h>

#include "mesh/io/read.h"

enum { STL_HEADER = 80, STL_FACET = 50, STL_NORMAL = 12 };

/* Some binary files begin with "solid" too: the length or a byte that text never has decides. */
static bool is_text(const mesh_file *file) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text word;
  if (!supine_mesh_text_word(&text, &word) || !supine_mesh_text_is(word, "solid")) {
    return false;
  }
  const size_t head = file->size < 1024 ? file->size : 1024;
  return memchr(file->bytes, '\0', head) == NULL;
}

static uint32_t read_bits(const unsigned char *at) {
  return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static void take_binary(const mesh_file *file, supine_mesh *mesh, size_t facets) {
  for (size_t c = 0; c < 9 * facets; ++c) {
    const size_t offset = STL_HEADER + 4 + c / 9 * STL_FACET + STL_NORMAL + c % 9 * 4;
    const uint32_t bits = read_bits(file->bytes + offset);
    float value = 0.0F;
    memcpy(&value, &bits, sizeof value);
    mesh->vertices[c] = (double)value;
  }
  mesh->vertex_count = 3 * facets;
}

/* Read one corner per line; lines with other keywords add nothing. */
static supine_status take_text(const mesh_file *file, supine_mesh *mesh, supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  mesh_text word;
  bool open = true;
  for (size_t number = 1; supine_mesh_text_line(&text, &line); ++number) {
    if (!supine_mesh_text_word(&line, &word)) {
      continue;
    }
    open = !supine_mesh_text_is(word, "endsolid") && (open || supine_mesh_text_is(word, "solid"));
    if (supine_mesh_text_is(word, "vertex") &&
        !supine_mesh_text_position(&line, mesh->vertices + 3 * mesh->vertex_count++)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: line %zu: a vertex needs three numbers; save the mesh again",
                              file->path, number);
    }
  }
  if (open || mesh->vertex_count % 3 != 0) {
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: the STL text ends before its endsolid: the file is truncated; save it again",
        file->path);
  }
  return SUPINE_OK;
}

/* Report why a file is neither kind. */
static supine_status refuse(const mesh_file *file, size_t facets, size_t promised,
                            supine_error *error) {
  return file->size < STL_HEADER + 4
             ? supine_error_set(
                   error, SUPINE_ERROR_FORMAT,
                   "%s: %zu bytes are too few for an STL file: it is truncated; save it again",
                   file->path, file->size)
             : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%s: the file has %zu bytes, but an STL of %zu facets has %zu: it "
                                "is truncated or not an STL file; save it again",
                                file->path, file->size, facets, promised);
}

supine_status supine_mesh_read_stl(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                   supine_error *error) {
  (void)dropped;
  const size_t facets = file->size < STL_HEADER + 4 ? 0 : read_bits(file->bytes + STL_HEADER);
  const size_t promised = STL_HEADER + 4 + STL_FACET * facets;
  const bool binary = file->size == promised;
  if (!binary && !is_text(file)) {
    return refuse(file, facets, promised, error);
  }
  if (!binary && !supine_mesh_guard_text(file, error)) {
    return SUPINE_ERROR_FORMAT;
  }
  const size_t room = binary ? 3 * facets + 1 : file->size / strlen("vertex 0 0 0") + 2;
  if (room > MESH_VERTICES_MAX) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: more than %d vertices; give a coarser mesh", file->path,
                            MESH_VERTICES_MAX);
  }
  mesh->vertices = malloc(3 * room * sizeof *mesh->vertices);
  mesh->triangles = malloc(room * sizeof *mesh->triangles);
  if (mesh->vertices == NULL || mesh->triangles == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", file->path);
  }
  if (binary) {
    supine_mesh_space_note(file, STL_HEADER);
    take_binary(file, mesh, facets);
  } else {
    const supine_status status = take_text(file, mesh, error);
    if (status != SUPINE_OK) {
      return status;
    }
  }
  mesh->triangle_count = mesh->vertex_count / 3;
  for (size_t c = 0; c < mesh->vertex_count; ++c) {
    mesh->triangles[c] = (uint32_t)c;
  }
  return SUPINE_OK;
}
