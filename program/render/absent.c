/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Builds without EGL, OpenGL ES or cairo: every picture is refused. */
#include "program/render/render.h"

static supine_status refuse(supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_UNSUPPORTED,
                          "this build draws no pictures: it was configured without EGL, OpenGL ES "
                          "or cairo");
}

supine_status supine_render_create(const supine_basis *basis, supine_renderer **renderer,
                                   supine_error *error) {
  (void)basis;
  (void)renderer;
  return refuse(error);
}

void supine_render_destroy(supine_renderer *renderer) {
  (void)renderer;
}

void supine_render_extent(supine_renderer *renderer, const supine_scene *scene, double extent[4]) {
  (void)renderer;
  (void)scene;
  (void)extent;
}

void supine_render_project(supine_renderer *renderer, const supine_scene *scene,
                           const supine_marks *marks, double (*pixel)[2]) {
  (void)renderer;
  (void)scene;
  (void)marks;
  (void)pixel;
}

supine_status supine_render_draw(supine_renderer *renderer, const supine_scene *scene,
                                 uint32_t *pixels, supine_error *error) {
  (void)renderer;
  (void)scene;
  (void)pixels;
  return refuse(error);
}

supine_status supine_render_png(supine_renderer *renderer, const supine_scene *scene,
                                unsigned char **bytes, size_t *size, supine_error *error) {
  (void)renderer;
  (void)scene;
  (void)bytes;
  (void)size;
  return refuse(error);
}

supine_status supine_render_picture_write(supine_renderer *renderer, const supine_picture *picture,
                                          FILE *file, supine_error *error) {
  (void)renderer;
  (void)picture;
  (void)file;
  return refuse(error);
}

supine_status supine_render_picture_draw(supine_renderer *renderer, const supine_picture *picture,
                                         uint32_t *pixels, supine_error *error) {
  (void)renderer;
  (void)picture;
  (void)pixels;
  return refuse(error);
}

void supine_render_picture_extent(supine_renderer *renderer, const supine_picture *picture,
                                  double (*extent)[4]) {
  (void)renderer;
  (void)picture;
  (void)extent;
}
