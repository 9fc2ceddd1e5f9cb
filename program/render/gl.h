/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What the files that draw share: the context, the program, the buffers. */
#ifndef SUPINE_RENDER_GL_H
#define SUPINE_RENDER_GL_H

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl3.h>

#include "program/render/render.h"

/* An OpenGL ES 3 context without a window. */
typedef struct supine_gl_context {
  EGLDisplay display;
  EGLContext context;
} supine_gl_context;

/* Opens one and makes it current.
 * SUPINE_ERROR_UNSUPPORTED: no driver here draws off screen. */
supine_status supine_render_gl_open(supine_gl_context *context, supine_error *error);
bool supine_render_gl_use(const supine_gl_context *context);
void supine_render_gl_close(supine_gl_context *context);

/* Vertex attributes of the program, by location. */
enum {
  ATTRIBUTE_REST = 0,
  ATTRIBUTE_DIRECTION,
  ATTRIBUTE_COEFFICIENTS, /* and the three after it */
  ATTRIBUTE_NORMAL = ATTRIBUTE_COEFFICIENTS + 4,
  ATTRIBUTE_VALUE,
  ATTRIBUTE_COUNT
};

/* Compiles and links, for `lungs` and weights of `vectors` vec4s (supine.glsl); 0 after
 * filling `error`. */
GLuint supine_render_gl_program(size_t lungs, size_t vectors, supine_error *error);

struct supine_renderer {
  const supine_basis *basis;
  const supine_basis_info *info; /* of it */
  supine_gl_context gl;
  GLuint program;
  GLuint array;
  GLuint buffer[4]; /* vertices; displacements, where not packed; normals, values; triangles */
  GLuint colours[SUPINE_COLOURS_COUNT];
  bool packed; /* the basis has at most 16 modes and one direction a vertex: the GPU displaces */
  size_t vector_count; /* vec4s of supine_weights */
  size_t lung_count;   /* vec3s of supine_gains: two at least, see load_vertices */
  size_t index_begin[SUPINE_LUNGS_MAX + 1]; /* triangles of each lung */
  float *scratch;                           /* [N, 7]: positions, normals, values */
};

#endif
