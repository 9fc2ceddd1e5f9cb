/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The GPU's part: displacement, projection, light and colour. */
#include <stdio.h>
#include <string.h>

#include "program/render/gl.h"
#include "program/template/assets.h"

extern const supine_asset supine_render_assets[]; /* the .glsl files, put in by the build */

static const char version[] = "#version 300 es\n"
                              "precision highp float;\n";

static const char *source(const char *name) {
  return supine_template_asset(supine_render_assets, name, strlen(name))->bytes;
}

static GLuint compile(GLenum kind, const char *defines, const char *first, const char *second,
                      supine_error *error) {
  const char *text[4] = {version, defines, first, second};
  GLint good = GL_FALSE;
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 4, text, NULL);
  glCompileShader(shader);
  glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
  if (good != GL_TRUE) {
    char log[256] = "";
    glGetShaderInfoLog(shader, sizeof log, NULL, log);
    (void)supine_error_set(error, SUPINE_ERROR_UNSUPPORTED, "the OpenGL driver refuses: %s", log);
    glDeleteShader(shader);
    return 0;
  }
  return shader;
}

GLuint supine_render_gl_program(size_t lungs, size_t vectors, supine_error *error) {
  GLint good = GL_FALSE;
  GLuint program = 0;
  char defines[128];
  (void)snprintf(defines, sizeof defines, "#define SUPINE_LUNGS %zu\n#define SUPINE_VECTORS %zu\n",
                 lungs, vectors);
  const GLuint vertex =
      compile(GL_VERTEX_SHADER, defines, source("supine.glsl"), source("lungs.vert.glsl"), error);
  const GLuint fragment = vertex != 0 ? compile(GL_FRAGMENT_SHADER, "", source("contour.glsl"),
                                                source("lungs.frag.glsl"), error)
                                      : 0;
  if (fragment != 0) {
    program = glCreateProgram();
    glAttachShader(program, vertex);
    glAttachShader(program, fragment);
    glLinkProgram(program);
    glGetProgramiv(program, GL_LINK_STATUS, &good);
    if (good != GL_TRUE) {
      (void)supine_error_set(error, SUPINE_ERROR_UNSUPPORTED, "the OpenGL driver cannot link");
      glDeleteProgram(program);
      program = 0;
    }
  }
  glDeleteShader(vertex); /* 0 is legal; kept while attached */
  glDeleteShader(fragment);
  return program;
}
