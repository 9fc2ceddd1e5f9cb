/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Builds without libwebp: animations are refused. */
#include "program/render/render.h"

static supine_status refuse(supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_UNSUPPORTED,
                          "this build writes no animations: it was configured without libwebp");
}

supine_status supine_render_animation_open(size_t width, size_t height,
                                           supine_animation **animation, supine_error *error) {
  (void)width;
  (void)height;
  (void)animation;
  return refuse(error);
}

supine_status supine_render_animation_add(supine_animation *animation, supine_renderer *renderer,
                                          const supine_picture *picture, int milliseconds,
                                          supine_error *error) {
  (void)animation;
  (void)renderer;
  (void)picture;
  (void)milliseconds;
  return refuse(error);
}

supine_status supine_render_animation_write(supine_animation *animation, FILE *file,
                                            supine_error *error) {
  (void)animation;
  (void)file;
  return refuse(error);
}

void supine_render_animation_close(supine_animation *animation) {
  (void)animation;
}
