/* SPDX-License-Identifier: GPL-3.0-or-later */
/* One drawing of the lungs. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/render/gl.h"

/* Each pixel is the mean of 2 x 2 drawn ones; four samples of each on top make drivers in software
 * take 2.7 times as long for edges that look the same. */
enum { OVERSAMPLE = 2 };

static const double distance_in_radii = 5.0; /* of the viewer */
static const double depth_in_radii = 3.0;    /* drawn, in front of the centre and behind */
static const double margin = 1.03;

/* The lungs that a scene shows. */
static void shown_lungs(const supine_renderer *r, const supine_scene *scene, size_t *begin,
                        size_t *end) {
  *begin = scene->one_lung ? scene->lung : 0;
  *end = scene->one_lung ? scene->lung + 1 : r->info->lung_count;
}

/* What changes with the state: normals, values and, where the GPU cannot displace, displacements.
 */
static void load_state(supine_renderer *r, const supine_scene *scene) {
  const size_t n = r->info->vertex_count;
  float *xyz = r->scratch;
  float *normals = r->scratch + 3 * n;
  supine_deform(r->basis, scene->pose, xyz);
  supine_normals(r->basis, xyz, normals);
  glBindBuffer(GL_ARRAY_BUFFER, r->buffer[2]);
  glBufferSubData(GL_ARRAY_BUFFER, 0, (GLsizeiptr)(3 * n * sizeof *normals), normals);
  glBufferSubData(GL_ARRAY_BUFFER, (GLintptr)(3 * n * sizeof *normals),
                  (GLsizeiptr)(n * sizeof *scene->value), scene->value);
  if (!r->packed) {
    for (size_t i = 0; i < 3 * n; ++i) {
      xyz[i] -= r->info->vertices[i];
    }
    glBindBuffer(GL_ARRAY_BUFFER, r->buffer[1]);
    glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(3 * n * sizeof *xyz), xyz, GL_DYNAMIC_DRAW);
    glEnableVertexAttribArray(ATTRIBUTE_DIRECTION);
    glVertexAttribPointer(ATTRIBUTE_DIRECTION, 3, GL_FLOAT, GL_FALSE, 0, NULL);
    for (GLuint k = 0; k < 4; ++k) {
      glDisableVertexAttribArray(ATTRIBUTE_COEFFICIENTS + k);
      glVertexAttrib4f(ATTRIBUTE_COEFFICIENTS + k, k == 0 ? 1.0F : 0.0F, 0, 0, 0);
    }
  }
}

static void uniform(const supine_renderer *r, const char *name, size_t count,
                    const double *values) {
  float v[4];
  const GLint at = glGetUniformLocation(r->program, name);
  for (size_t i = 0; i < count; ++i) {
    v[i] = (float)values[i];
  }
  if (count == 1) {
    glUniform1fv(at, 1, v);
  } else if (count == 2) {
    glUniform2fv(at, 1, v);
  } else if (count == 3) {
    glUniform3fv(at, 1, v);
  } else {
    glUniform4fv(at, 1, v);
  }
}

/* A viewer in front of the middle of the resting lungs, whatever their state. */
typedef struct camera {
  double axes[3][3];
  double centre[3];
  double radius, away; /* mm: of the lungs, and how far the viewer is */
} camera;

static camera find_camera(const supine_renderer *r, const supine_scene *scene) {
  camera c = {.radius = 1e-3};
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  size_t first;
  size_t last;
  supine_render_view_axes(scene->view, c.axes);
  shown_lungs(r, scene, &first, &last);
  for (size_t i = 3 * r->info->lung_begin[first]; i < 3 * r->info->lung_begin[last]; ++i) {
    low[i % 3] = fmin(low[i % 3], (double)r->info->vertices[i]);
    high[i % 3] = fmax(high[i % 3], (double)r->info->vertices[i]);
  }
  for (int axis = 0; axis < 3; ++axis) {
    c.centre[axis] = (low[axis] + high[axis]) / 2;
    c.radius = hypot(c.radius, (high[axis] - low[axis]) / 2);
  }
  c.away = distance_in_radii * c.radius;
  return c;
}

void supine_render_extent(supine_renderer *r, const supine_scene *scene, double extent[4]) {
  const camera c = find_camera(r, scene);
  const double closest = c.away - 0.98 * depth_in_radii * c.radius;
  size_t first;
  size_t last;
  shown_lungs(r, scene, &first, &last);
  supine_deform(r->basis, scene->pose, r->scratch);
  for (size_t i = r->info->lung_begin[first]; i < r->info->lung_begin[last]; ++i) {
    double p[3] = {0, 0, 0};
    for (size_t row = 0; row < 3; ++row) {
      for (size_t axis = 0; axis < 3; ++axis) {
        p[row] += c.axes[row][axis] * ((double)r->scratch[3 * i + axis] - c.centre[axis]);
      }
    }
    for (int side = 0; side < 2; ++side) {
      const double at = p[side] * c.away / fmax(closest, c.away - p[2]);
      extent[2 * side] = fmin(extent[2 * side], at);
      extent[2 * side + 1] = fmax(extent[2 * side + 1], at);
    }
  }
}

/* The extent in the middle, filling the picture: its middle, and what a mm is of half a side. */
static void find_frame(supine_renderer *r, const supine_scene *scene, double frame[4]) {
  double extent[4] = SUPINE_EXTENT_NONE;
  if (scene->extent != NULL) {
    memcpy(extent, scene->extent, sizeof extent);
  } else {
    supine_render_extent(r, scene, extent);
  }
  const double aspect = (double)scene->width / (double)scene->height;
  const double wide = fmax(1e-3, margin * (extent[1] - extent[0]) / 2);
  const double high = fmax(1e-3, margin * (extent[3] - extent[2]) / 2);
  const double tall = fmax(high, wide / aspect);
  frame[0] = (extent[0] + extent[1]) / 2;
  frame[1] = (extent[2] + extent[3]) / 2;
  frame[2] = 1 / (tall * aspect);
  frame[3] = 1 / tall;
}

static void load_camera(supine_renderer *r, const supine_scene *scene) {
  const camera c = find_camera(r, scene);
  const double depth[2] = {c.away, depth_in_radii * c.radius};
  double frame[4];
  find_frame(r, scene, frame);
  float columns[9];
  for (int i = 0; i < 9; ++i) {
    columns[i] = (float)c.axes[i % 3][i / 3];
  }
  glUniformMatrix3fv(glGetUniformLocation(r->program, "view"), 1, GL_FALSE, columns);
  uniform(r, "centre", 3, c.centre);
  uniform(r, "frame", 4, frame);
  uniform(r, "depth", 2, depth);
}

void supine_render_project(supine_renderer *r, const supine_scene *scene, const supine_marks *marks,
                           double (*pixel)[2]) {
  const camera c = find_camera(r, scene);
  const double size[2] = {(double)scene->width, (double)scene->height};
  double frame[4];
  find_frame(r, scene, frame);
  for (size_t i = 0; i < marks->count; ++i) {
    double p[3] = {0, 0, 0};
    for (size_t row = 0; row < 3; ++row) {
      for (size_t axis = 0; axis < 3; ++axis) {
        p[row] += c.axes[row][axis] * ((double)marks->mark[i].xyz[axis] - c.centre[axis]);
      }
    }
    for (size_t side = 0; side < 2; ++side) { /* as lungs.vert.glsl does; the first row is on top */
      const double away = p[side] * c.away / (c.away - p[2]) - frame[side];
      pixel[i][side] = 0.5 * (1 + away * frame[2 + side] * (side == 0 ? 1 : -1)) * size[side];
    }
  }
}

static void draw_lungs(const supine_renderer *r, const supine_scene *scene) {
  float weights[SUPINE_GL_MODES] = {1};
  float gains[3 * SUPINE_LUNGS_MAX];
  size_t begin;
  size_t end;
  shown_lungs(r, scene, &begin, &end);
  for (size_t i = 0; i < 3 * SUPINE_LUNGS_MAX; ++i) {
    gains[i] = 1;
  }
  if (r->packed) {
    (void)supine_gl_weights(r->basis, scene->pose, weights, gains);
  }
  glUniform4fv(glGetUniformLocation(r->program, "supine_weights"), (GLsizei)r->vector_count,
               weights);
  glUniform3fv(glGetUniformLocation(r->program, "supine_gains"), (GLsizei)r->lung_count, gains);
  glDrawElements(GL_TRIANGLES, (GLsizei)(3 * (r->index_begin[end] - r->index_begin[begin])),
                 GL_UNSIGNED_INT,
                 (const void *)(uintptr_t)(3 * r->index_begin[begin] * sizeof(uint32_t)));
}

/* A framebuffer to draw on and read from. */
typedef struct canvas {
  GLuint frame;
  GLuint buffer[2];
  GLsizei width, height;
} canvas;

static bool canvas_open(canvas *c, const supine_scene *scene) {
  static const GLenum formats[] = {GL_RGBA8, GL_DEPTH_COMPONENT24};
  static const GLenum places[] = {GL_COLOR_ATTACHMENT0, GL_DEPTH_ATTACHMENT};
  GLint largest = 0;
  glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &largest);
  const size_t limit = (size_t)largest / OVERSAMPLE;
  if (scene->width == 0 || scene->height == 0 || scene->width > limit || scene->height > limit) {
    return false;
  }
  c->width = (GLsizei)(OVERSAMPLE * scene->width);
  c->height = (GLsizei)(OVERSAMPLE * scene->height);
  glGenFramebuffers(1, &c->frame);
  glGenRenderbuffers(2, c->buffer);
  glBindFramebuffer(GL_FRAMEBUFFER, c->frame);
  for (int i = 0; i < 2; ++i) {
    glBindRenderbuffer(GL_RENDERBUFFER, c->buffer[i]);
    glRenderbufferStorage(GL_RENDERBUFFER, formats[i], c->width, c->height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, places[i], GL_RENDERBUFFER, c->buffer[i]);
  }
  return glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE &&
         glGetError() == GL_NO_ERROR;
}

static void canvas_close(canvas *c) {
  glDeleteFramebuffers(1, &c->frame);
  glDeleteRenderbuffers(2, c->buffer);
}

/* Means of 2 x 2 pixels, the top row first. Nothing drawn is 0 in colour and alpha alike, so that
 * the means are premultiplied. */
static void shrink(const canvas *c, const unsigned char *rgba, const supine_scene *scene,
                   uint32_t *pixels) {
  enum { COUNT = OVERSAMPLE * OVERSAMPLE };
  for (size_t y = 0; y < scene->height; ++y) {
    for (size_t x = 0; x < scene->width; ++x) {
      uint32_t sum[4] = {COUNT / 2, COUNT / 2, COUNT / 2, COUNT / 2};
      for (size_t sub = 0; sub < COUNT; ++sub) {
        const size_t row = (scene->height - 1 - y) * OVERSAMPLE + sub / OVERSAMPLE;
        const size_t column = x * OVERSAMPLE + sub % OVERSAMPLE;
        const unsigned char *from = rgba + 4 * (row * (size_t)c->width + column);
        for (int k = 0; k < 4; ++k) {
          sum[k] += from[k];
        }
      }
      pixels[y * scene->width + x] =
          (sum[3] / COUNT) << 24 | (sum[0] / COUNT) << 16 | (sum[1] / COUNT) << 8 | sum[2] / COUNT;
    }
  }
}

supine_status supine_render_draw(supine_renderer *r, const supine_scene *scene, uint32_t *pixels,
                                 supine_error *error) {
  canvas c = {0, {0}, 0, 0};
  unsigned char *rgba = NULL;
  const double dark = scene->dark ? 1 : 0;
  supine_status status = SUPINE_OK;
  if (!supine_render_gl_use(&r->gl)) {
    return supine_error_set(error, SUPINE_ERROR_UNSUPPORTED, "the OpenGL context is lost");
  }
  if (!canvas_open(&c, scene)) {
    status = supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "the OpenGL driver cannot draw %zu x %zu pixels", scene->width,
                              scene->height);
    goto cleanup;
  }
  rgba = malloc(4 * (size_t)c.width * (size_t)c.height);
  if (rgba == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
    goto cleanup;
  }
  glViewport(0, 0, c.width, c.height);
  glClearColor(0, 0, 0, 0);
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  glEnable(GL_DEPTH_TEST);
  glUseProgram(r->program);
  glBindVertexArray(r->array);
  glBindTexture(GL_TEXTURE_2D, r->colours[scene->colours]);
  load_camera(r, scene);
  load_state(r, scene);
  uniform(r, "largest", 1, &scene->largest);
  uniform(r, "line_step", 1, &scene->line_step);
  uniform(r, "dark", 1, &dark);
  draw_lungs(r, scene);
  glReadPixels(0, 0, c.width, c.height, GL_RGBA, GL_UNSIGNED_BYTE, rgba);
  if (glGetError() != GL_NO_ERROR) {
    status = supine_error_set(error, SUPINE_ERROR_UNSUPPORTED, "the OpenGL driver failed");
    goto cleanup;
  }
  shrink(&c, rgba, scene, pixels);
cleanup:
  canvas_close(&c);
  free(rgba);
  return status;
}
