/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write animations as WebP files. */
#include <stdlib.h>

#include <webp/encode.h>
#include <webp/mux.h>

#include "base/arena.h"
#include "program/view/render/render.h"

/* WebP quality, 0 to 100. At 78, letters are sharp and files take a fifth of the lossless size. */
static const float quality = 78.0F;
enum { EFFORT = 4, SIDE_MAX = 16383 };

struct supine_animation {
  WebPAnimEncoder *encoder;
  WebPConfig config;
  size_t width, height;
  int duration_ms; /* duration of the pictures appended so far */
  uint32_t *pixels;
};

supine_status supine_render_animation_open(size_t width, size_t height,
                                           supine_animation **animation, supine_error *error) {
  WebPAnimEncoderOptions options;
  SUPINE_REFUSE_IF(width > SIDE_MAX || height > SIDE_MAX, error, SUPINE_ERROR_ARGUMENT,
                   "an animation has at most %d x %d pixels: give a smaller --size", SIDE_MAX,
                   SIDE_MAX);
  supine_animation *made = calloc(1, sizeof *made);
  if (made != NULL && WebPAnimEncoderOptionsInit(&options) && WebPConfigInit(&made->config)) {
    /* Use key frames only: differences between lossy frames add up to visible steps of colour. */
    options.kmax = 1;
    made->config.quality = quality;
    made->config.method = EFFORT;
    made->width = width;
    made->height = height;
    made->pixels = malloc(width * height * sizeof *made->pixels);
    made->encoder =
        made->pixels != NULL ? WebPAnimEncoderNew((int)width, (int)height, &options) : NULL;
  }
  if (made == NULL || made->encoder == NULL) {
    supine_render_animation_close(&made);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  *animation = made;
  return SUPINE_OK;
}

supine_status supine_render_animation_add(supine_animation *animation, const supine_basis *basis,
                                          const supine_picture *picture, int milliseconds,
                                          supine_error *error) {
  WebPPicture frame;
  SUPINE_TRY(supine_render_picture_draw(basis, picture, animation->pixels, error));
  supine_status status = SUPINE_ERROR_MEMORY;
  if (WebPPictureInit(&frame)) {
    frame.width = (int)animation->width;
    frame.height = (int)animation->height;
    frame.use_argb = 1;
    if (WebPPictureImportBGRX(&frame, (const uint8_t *)animation->pixels, 4 * frame.width) &&
        WebPAnimEncoderAdd(animation->encoder, &frame, animation->duration_ms,
                           &animation->config)) {
      animation->duration_ms += milliseconds;
      status = SUPINE_OK;
    }
    WebPPictureFree(&frame);
  }
  return status == SUPINE_OK ? status : supine_error_set(error, status, "out of memory");
}

supine_status supine_render_animation_write(supine_animation *animation, FILE *file,
                                            supine_error *error) {
  WebPData data;
  WebPDataInit(&data);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (WebPAnimEncoderAdd(animation->encoder, NULL, animation->duration_ms, NULL) &&
      WebPAnimEncoderAssemble(animation->encoder, &data)) {
    status = fwrite(data.bytes, 1, data.size, file) == data.size ? SUPINE_OK : SUPINE_ERROR_WRITE;
  }
  WebPDataClear(&data);
  return status == SUPINE_OK ? status
                             : supine_error_set(error, status,
                                                status == SUPINE_ERROR_WRITE ? "WebP: write error"
                                                                             : "out of memory");
}

void supine_render_animation_close(supine_animation **animation) {
  if (*animation != NULL) {
    WebPAnimEncoderDelete((*animation)->encoder);
    free((*animation)->pixels);
    free(*animation);
  }
}
