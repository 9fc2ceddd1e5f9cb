/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A basis on the GPU. */
#include <stdlib.h>
#include <string.h>

#include "program/render/gl.h"

enum { COLOURS = 256 };

static void attribute(GLuint location, GLint count, size_t stride, size_t offset) {
  glEnableVertexAttribArray(location);
  glVertexAttribPointer(location, count, GL_FLOAT, GL_FALSE, (GLsizei)(stride * sizeof(float)),
                        (const void *)(uintptr_t)(offset * sizeof(float)));
}

static void load_colours(supine_renderer *r, supine_colours map) {
  unsigned char texels[COLOURS][4];
  for (int i = 0; i < COLOURS; ++i) {
    double rgb[3];
    supine_render_colour(map, i / (double)(COLOURS - 1), rgb);
    for (int k = 0; k < 3; ++k) {
      texels[i][k] = (unsigned char)(255 * rgb[k] + 0.5);
    }
    texels[i][3] = 255;
  }
  glBindTexture(GL_TEXTURE_2D, r->colours[map]);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, COLOURS, 1, 0, GL_RGBA, GL_UNSIGNED_BYTE, texels);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
}

/* Triangles in the order of their lungs. */
static void group_triangles(supine_renderer *r, uint32_t *grouped) {
  const supine_basis_info *info = r->info;
  size_t count = 0;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    r->index_begin[lung] = count;
    for (size_t t = 0; t < info->triangle_count; ++t) {
      const uint32_t *corner = r->info->triangles + 3 * t;
      if (corner[0] >= info->lung_begin[lung] && corner[0] < info->lung_begin[lung + 1]) {
        memcpy(grouped + 3 * count++, corner, 3 * sizeof *corner);
      }
    }
  }
  r->index_begin[info->lung_count] = count;
}

/* Rest positions, lungs and, where the GPU displaces, directions and coefficients. */
static supine_status load_vertices(supine_renderer *r, supine_error *error) {
  const size_t n = r->info->vertex_count;
  glBindBuffer(GL_ARRAY_BUFFER, r->buffer[0]);
  if (!r->packed) { /* without w, which reads 1: one gain serves both lungs */
    glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(3 * n * sizeof(float)), r->info->vertices,
                 GL_STATIC_DRAW);
    attribute(ATTRIBUTE_REST, 3, 3, 0);
    return SUPINE_OK;
  }
  const size_t modes = r->info->mode_count;
  const size_t floats = SUPINE_GL_FLOATS + modes;
  float *packed = calloc(n, floats * sizeof *packed);
  if (packed == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  const supine_status status = supine_gl_pack(r->basis, 0, n, packed);
  glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(floats * n * sizeof *packed), packed, GL_STATIC_DRAW);
  attribute(ATTRIBUTE_REST, 4, floats, 0);
  attribute(ATTRIBUTE_DIRECTION, 3, floats, 4);
  for (size_t k = 0; k < modes; k += 4) { /* missing ones read (0, 0, 0, 1) and get weight 0 */
    attribute(ATTRIBUTE_COEFFICIENTS + (GLuint)k / 4, modes - k < 4 ? (GLint)(modes - k) : 4,
              floats, SUPINE_GL_FLOATS + k);
  }
  free(packed);
  return status;
}

static supine_status load_surface(supine_renderer *r, supine_error *error) {
  const supine_basis_info *info = r->info;
  const size_t n = info->vertex_count;
  uint32_t *grouped = malloc(3 * info->triangle_count * sizeof *grouped + 1);
  if (grouped == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  group_triangles(r, grouped);
  glGenVertexArrays(1, &r->array);
  glGenBuffers(4, r->buffer);
  glBindVertexArray(r->array);
  supine_status status = load_vertices(r, error);
  glBindBuffer(GL_ARRAY_BUFFER, r->buffer[2]);
  glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(4 * n * sizeof(float)), NULL, GL_DYNAMIC_DRAW);
  attribute(ATTRIBUTE_NORMAL, 3, 3, 0);
  attribute(ATTRIBUTE_VALUE, 1, 1, 3 * n);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, r->buffer[3]);
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)(3 * info->triangle_count * sizeof *grouped),
               grouped, GL_STATIC_DRAW);
  if (status == SUPINE_OK && glGetError() != GL_NO_ERROR) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY,
                              "the OpenGL driver cannot hold %zu vertices", n);
  }
  free(grouped);
  return status;
}

supine_status supine_render_create(const supine_basis *basis, supine_renderer **renderer,
                                   supine_error *error) {
  supine_status status = SUPINE_ERROR_MEMORY;
  supine_renderer *r = calloc(1, sizeof *r);
  if (r == NULL) {
    return supine_error_set(error, status, "out of memory");
  }
  r->basis = basis;
  r->info = supine_basis_get_info(basis);
  r->packed = !r->info->vector && r->info->mode_count <= SUPINE_GL_MODES;
  r->scratch = calloc(r->info->vertex_count, 7 * sizeof *r->scratch);
  if (r->scratch == NULL) {
    (void)supine_error_set(error, status, "out of memory");
    goto cleanup;
  }
  status = supine_render_gl_open(&r->gl, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  const size_t lungs = r->info->lung_count < 2 ? 2 : r->info->lung_count;
  const size_t vectors = r->packed ? (r->info->mode_count + 3) / 4 : 1;
  r->vector_count = vectors;
  r->lung_count = lungs;
  r->program = supine_render_gl_program(lungs, vectors, error);
  status = r->program != 0 ? load_surface(r, error) : SUPINE_ERROR_UNSUPPORTED;
  if (status == SUPINE_OK) {
    glGenTextures(SUPINE_COLOURS_COUNT, r->colours);
    for (supine_colours map = 0; map < SUPINE_COLOURS_COUNT; ++map) {
      load_colours(r, map);
    }
    *renderer = r;
    r = NULL;
  }
cleanup:
  supine_render_destroy(r);
  return status;
}

void supine_render_destroy(supine_renderer *renderer) {
  if (renderer != NULL) {
    if (renderer->program != 0 && supine_render_gl_use(&renderer->gl)) {
      glDeleteTextures(SUPINE_COLOURS_COUNT,
                       renderer->colours); /* names that are 0 are passed over */
      glDeleteBuffers(4, renderer->buffer);
      glDeleteVertexArrays(1, &renderer->array);
      glDeleteProgram(renderer->program);
    }
    supine_render_gl_close(&renderer->gl);
    free(renderer->scratch);
    free(renderer);
  }
}
