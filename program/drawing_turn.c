/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw a turn of the patient as an animation. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/output.h"

#include "program/drawing.h"

static const char name[] = "render";

enum { PER_SECOND = 15, FRAMES_MAX = 10000, PAUSE_MS = 1000 /* at the end */ };

supine_status supine_command_read_turn(const char *value, breath_turn *turn, supine_error *error) {
  char text[128];
  char *colon[2];
  (void)snprintf(text, sizeof text, "%s", value);
  colon[0] = strchr(text, ':');
  colon[1] = colon[0] == NULL ? NULL : strchr(colon[0] + 1, ':');
  if (strlen(value) >= sizeof text || colon[1] == NULL) {
    return SUPINE_ERROR_ARGUMENT;
  }
  *colon[0] = *colon[1] = '\0';
  char *seconds = colon[1] + 1;
  const size_t length = strlen(seconds);
  if (length > 0 && seconds[length - 1] == 's') {
    seconds[length - 1] = '\0';
  }
  if (!supine_options_parse_number(seconds, &turn->seconds) || !(turn->seconds > 0.0)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "'%s' needs a time above 0 s, as in supine:left:5s", value);
  }
  const supine_status status = supine_options_posture(text, turn->from, error);
  return status == SUPINE_OK ? supine_options_posture(colon[0] + 1, turn->to, error) : status;
}

/* A turn being drawn. */
typedef struct turning {
  supine_command_studio *studio;
  size_t count; /* number of frames */
  supine_command_drawn shown;
  supine_posture_item item;
  supine_panel panel;
  char label[128];
  double extent[SUPINE_VIEWS_MAX][4];
} turning;

/* Compute the state of a frame. */
static supine_status find_frame(turning *t, size_t frame, supine_error *error) {
  const breath_turn *turn = &t->studio->wanted->turn;
  const double cosine =
      turn->from[0] * turn->to[0] + turn->from[1] * turn->to[1] + turn->from[2] * turn->to[2];
  const double angle = acos(fmax(-1.0, fmin(1.0, cosine))) * 180.0 / 3.14159265358979323846;
  const double share = (double)frame / (double)(t->count - 1);
  supine_breath_turn_gravity(turn, share * turn->seconds, t->item.gravity);
  (void)snprintf(t->item.name, sizeof t->item.name, "turned by %.0f of %.0f degrees", share * angle,
                 angle);
  return supine_command_drawn_find(t->studio, &t->item, &t->shown, error);
}

static supine_picture make_picture(turning *t) {
  t->panel =
      supine_command_drawn_panel(t->studio->wanted, &t->shown, t->item.name, t->item.gravity);
  supine_picture picture = supine_command_drawing_picture(t->studio, &t->panel, 1, t->label);
  picture.extent = (const double(*)[4])t->extent;
  return picture;
}

/* Find the largest displacement and the extent of the picture over the whole turn, so that the
 * colour bar and the scale stay fixed. */
static supine_status measure(turning *t, supine_error *error) {
  static const double none[4] = SUPINE_EXTENT_NONE;
  supine_status status = SUPINE_OK;
  for (size_t view = 0; view < SUPINE_VIEWS_MAX; ++view) {
    memcpy(t->extent[view], none, sizeof none);
  }
  for (size_t frame = 0; frame < t->count && status == SUPINE_OK; ++frame) {
    status = find_frame(t, frame, error);
    const supine_picture picture = make_picture(t);
    if (status == SUPINE_OK) {
      supine_render_picture_extent(t->studio->renderer, &picture, t->extent);
    }
  }
  return status;
}

static supine_status play(turning *t, supine_animation *animation, supine_error *error) {
  supine_progress progress = supine_options_progress_begin(name);
  supine_status status = SUPINE_OK;
  for (size_t frame = 0; frame < t->count && status == SUPINE_OK; ++frame) {
    status = find_frame(t, frame, error);
    if (status == SUPINE_OK) {
      status = supine_command_drawn_mark(t->studio, &t->shown, error);
    }
    const supine_picture picture = make_picture(t);
    if (status == SUPINE_OK) {
      status =
          supine_render_animation_add(animation, t->studio->renderer, &picture,
                                      frame + 1 < t->count ? 1000 / PER_SECOND : PAUSE_MS, error);
    }
    supine_command_marks_free(&t->shown.marks);
    if (!supine_options_progress_step(&progress, (double)(frame + 1) / (double)t->count)) {
      status =
          supine_error_set(error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
    }
  }
  supine_options_progress_end(&progress);
  return status;
}

/* Draw all frames of a turn, and write them. */
static supine_status animate(turning *t, supine_error *error) {
  const char *path = t->studio->wanted->output;
  supine_animation *animation = NULL;
  supine_output output = {0};
  supine_status status = measure(t, error);
  const supine_picture picture = make_picture(t);
  if (status == SUPINE_OK) {
    status = supine_output_open(path, &output, error);
  }
  if (status == SUPINE_OK) {
    status = supine_render_animation_open(picture.width, picture.height, &animation, error);
  }
  supine_options_signals_catch(true);
  if (status == SUPINE_OK) {
    status = play(t, animation, error);
  }
  if (status == SUPINE_OK) {
    status = supine_render_animation_write(animation, output.file, error);
    if (status == SUPINE_OK || ferror(output.file) != 0) { /* committing reports a failed write */
      status = supine_output_commit(&output, error);
    }
  }
  supine_output_abandon(&output);
  supine_render_animation_close(animation);
  if (status == SUPINE_OK) {
    (void)printf("%s: %zu x %zu pixels, %zu frames\n", path, picture.width, picture.height,
                 t->count);
  }
  return status;
}

supine_status supine_command_drawing_turn(supine_command_studio *studio, supine_error *error) {
  const double seconds = studio->wanted->turn.seconds;
  const double frames = floor(seconds * PER_SECOND * (1.0 + 1e-12)) + 1.0;
  const size_t n = supine_basis_get_info(studio->basis)->vertex_count;
  if (!(frames <= FRAMES_MAX)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a turn of %g s exceeds %d frames: give a shorter time", seconds,
                            FRAMES_MAX);
  }
  turning t = {.studio = studio,
               .count = frames < 2.0 ? 2 : (size_t)frames,
               .shown = {.value = malloc(n * sizeof *t.shown.value)}};
  const supine_status status = t.shown.value != NULL
                                   ? animate(&t, error)
                                   : supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  free(t.shown.value);
  return status;
}
