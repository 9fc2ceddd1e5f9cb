/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A turn of the patient as an animation. */
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
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "give a time above 0 s, not '%s'", value);
  }
  const supine_status status = supine_options_posture(text, turn->from, error);
  return status == SUPINE_OK ? supine_options_posture(colon[0] + 1, turn->to, error) : status;
}

/* Resources to draw the frames. */
typedef struct turning {
  const supine_basis *basis;
  const supine_command_drawing *wanted;
  const supine_reference_pose *from;
  supine_compare *compare;
  supine_renderer *renderer;
  supine_basis *inside; /* or NULL */
  supine_command_names names;
  size_t count; /* frames */
  double ends[2];
  double extent[SUPINE_VIEWS_MAX][4];
} turning;

/* Compute the state of a frame. */
static supine_status find_frame(turning *t, size_t frame, supine_posture_item *item,
                                supine_command_drawn *shown, supine_error *error) {
  const breath_turn *turn = &t->wanted->turn;
  const double cosine =
      turn->from[0] * turn->to[0] + turn->from[1] * turn->to[1] + turn->from[2] * turn->to[2];
  const double angle = acos(fmax(-1.0, fmin(1.0, cosine))) * 180.0 / 3.14159265358979323846;
  const double share = (double)frame / (double)(t->count - 1);
  supine_breath_turn_gravity(turn, share * turn->seconds, item->gravity);
  (void)snprintf(item->name, sizeof item->name, "turned by %.0f of %.0f degrees", share * angle,
                 angle);
  const supine_status status =
      supine_command_drawn_find(t->basis, t->compare, t->wanted, item, shown, error);
  if (status == SUPINE_OK) {
    supine_command_drawn_value(t->basis, t->compare, &t->from->pose, shown, t->ends);
  }
  return status;
}

static supine_picture make_picture(turning *t, supine_panel *panel, char *label) {
  supine_picture picture =
      supine_command_drawing_picture(t->wanted, t->from->name, t->ends, 1, label);
  picture.panel = panel;
  picture.extent = (const double(*)[4])t->extent;
  return picture;
}

/* Find the extents of colours and picture over the whole turn, so that they stay fixed. */
static supine_status measure(turning *t, supine_command_drawn *shown, supine_error *error) {
  static const double none[4] = SUPINE_EXTENT_NONE;
  supine_posture_item item;
  char label[128];
  supine_status status = SUPINE_OK;
  for (size_t view = 0; view < SUPINE_VIEWS_MAX; ++view) {
    memcpy(t->extent[view], none, sizeof none);
  }
  for (size_t frame = 0; frame < t->count && status == SUPINE_OK; ++frame) {
    status = find_frame(t, frame, &item, shown, error);
    supine_panel panel = supine_command_drawn_panel(t->wanted, shown, item.name, item.gravity);
    const supine_picture picture = make_picture(t, &panel, label);
    if (status == SUPINE_OK) {
      supine_render_picture_extent(t->renderer, &picture, t->extent);
    }
  }
  return status;
}

static supine_status play(turning *t, supine_command_drawn *shown, supine_animation *animation,
                          supine_error *error) {
  supine_progress progress = supine_options_progress_begin(name);
  supine_posture_item item;
  supine_status status = SUPINE_OK;
  for (size_t frame = 0; frame < t->count && status == SUPINE_OK; ++frame) {
    char label[128];
    status = find_frame(t, frame, &item, shown, error);
    if (status == SUPINE_OK && t->inside != NULL) {
      status = supine_command_marks_make(t->inside, &t->names, &shown->pose, &t->from->pose,
                                         &shown->marks, error);
    }
    supine_panel panel = supine_command_drawn_panel(t->wanted, shown, item.name, item.gravity);
    const supine_picture picture = make_picture(t, &panel, label);
    if (status == SUPINE_OK) {
      status =
          supine_render_animation_add(animation, t->renderer, &picture,
                                      frame + 1 < t->count ? 1000 / PER_SECOND : PAUSE_MS, error);
    }
    supine_command_marks_free(&shown->marks);
    if (!supine_options_progress_step(&progress, (double)(frame + 1) / (double)t->count)) {
      status =
          supine_error_set(error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
    }
  }
  supine_options_progress_end(&progress);
  return status;
}

/* Draw all frames of a turn, and write them. */
static supine_status animate(turning *t, supine_command_drawn *shown, supine_error *error) {
  supine_animation *animation = NULL;
  supine_output output = {0};
  char label[128];
  supine_panel panel;
  supine_status status = measure(t, shown, error);
  const supine_picture picture = make_picture(t, &panel, label);
  if (status == SUPINE_OK) {
    status = supine_output_open(t->wanted->output, &output, error);
  }
  if (status == SUPINE_OK) {
    status = supine_render_animation_open(picture.width, picture.height, &animation, error);
  }
  supine_options_signals_catch(true);
  if (status == SUPINE_OK) {
    status = play(t, shown, animation, error);
  }
  if (status == SUPINE_OK) {
    status = supine_render_animation_write(animation, output.file, error);
    if (status == SUPINE_OK || ferror(output.file) != 0) { /* the stream knows why a write failed */
      status = supine_output_commit(&output, error);
    }
  }
  supine_output_abandon(&output);
  supine_render_animation_close(animation);
  if (status == SUPINE_OK) {
    (void)printf("%s: %zu x %zu pixels, %zu frames\n", t->wanted->output, picture.width,
                 picture.height, t->count);
  }
  return status;
}

supine_status supine_command_drawing_turn(const supine_basis *basis,
                                          const supine_command_drawing *wanted,
                                          const supine_reference_pose *from, supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const double frames = floor(wanted->turn.seconds * PER_SECOND * (1.0 + 1e-12)) + 1.0;
  turning t = {.basis = basis, .wanted = wanted, .from = from};
  supine_command_drawn shown = {.value = NULL};
  if (!(frames <= FRAMES_MAX)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a turn of %g s exceeds %d frames: give a shorter one",
                            wanted->turn.seconds, FRAMES_MAX);
  }
  t.count = frames < 2.0 ? 2 : (size_t)frames;
  shown.value = malloc(n * sizeof *shown.value);
  supine_status status =
      shown.value != NULL ? supine_compare_create(basis, &t.compare, error) : SUPINE_ERROR_MEMORY;
  if (status == SUPINE_OK) {
    status = supine_render_create(basis, &t.renderer, error);
  }
  if (status == SUPINE_OK && wanted->inside != NULL) {
    status = supine_command_inside_open(basis, wanted->inside, &t.inside, &t.names, error);
  }
  if (status == SUPINE_OK) {
    status = animate(&t, &shown, error);
  }
  supine_command_names_close(&t.names);
  supine_basis_close(t.inside);
  supine_render_destroy(t.renderer);
  supine_compare_destroy(t.compare);
  free(shown.value);
  return status;
}
