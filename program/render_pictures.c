/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw the lungs in several postures as a picture, or during a turn as an animation. */
#include <math.h>
#include <string.h>

#include <supine/compare.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/output.h"
#include "base/vec3.h"

#include "program/options/basis_input.h"
#include "program/options/inside.h"
#include "program/render_pictures.h"

static const char name[] = "render";
static const double inside_opacity = 0.35; /* default opacity of the lungs with --inside */

enum { FPS = 15, FRAMES_MAX = 10000, LAST_FRAME_MS = 1000 };

/* A state of the lungs that a panel of the picture shows. */
typedef struct drawn {
  supine_pose pose;
  float *value; /* [N] length of the displacement, mm */
  char subtitle[160];
  char note[48];
  supine_command_marks marks;
} drawn;

/* The panels of a picture or of one frame of an animation, and the objects that draw them. */
typedef struct studio {
  const supine_pictures *wanted;
  supine_basis *basis;
  supine_reference_pose from;
  supine_compare *compare;
  supine_basis *inside; /* NULL if there are no structures inside the lungs */
  supine_command_names names;
  supine_posture_list postures; /* posture of each panel */
  drawn shown[SUPINE_PANELS_MAX];
  supine_panel panel[SUPINE_PANELS_MAX];
  double max; /* largest displacement of all panels so far, mm */
  char label[128];
  supine_arena arena;
} studio;

static void close_studio(studio *s) {
  for (size_t i = 0; i < SUPINE_PANELS_MAX; ++i) {
    supine_command_marks_free(&s->shown[i].marks);
  }
  supine_command_names_close(&s->names);
  supine_basis_close(s->inside);
  supine_compare_destroy(s->compare);
  supine_arena_free(&s->arena);
  supine_basis_close(s->basis);
}

static supine_status open_studio(studio *s, const char *path, supine_error *error) {
  SUPINE_TRY(supine_options_basis_open(path, SUPINE_STORAGE_AUTO, &s->basis, error));
  SUPINE_TRY(supine_options_reference(s->basis, &s->wanted->from, true, &s->from, error));
  SUPINE_TRY(supine_compare_create(s->basis, &s->compare, error));
  if (s->wanted->inside != NULL) {
    SUPINE_TRY(
        supine_command_inside_open(s->basis, s->wanted->inside, &s->inside, &s->names, error));
  }
  const size_t n = supine_basis_get_info(s->basis)->vertex_count;
  for (size_t i = 0; i < s->postures.count; ++i) {
    s->shown[i].value = supine_arena_take(&s->arena, n, sizeof *s->shown[i].value);
  }
  return s->arena.failed ? supine_error_memory(error, "%zu vertices", n) : SUPINE_OK;
}

/* Fill panel i: compute the pose, the displacements and the subtitle. */
static supine_status fill_panel(studio *s, size_t i, supine_error *error) {
  const supine_posture_item *item = &s->postures.item[i];
  drawn *shown = &s->shown[i];
  SUPINE_TRY(supine_options_pose(s->basis, name, s->wanted->volume.allow_folds, &item->state,
                                 &shown->pose, error));
  supine_distance_statistics statistics;
  (void)supine_compare_distances(s->compare, &shown->pose, &s->from.pose, shown->value);
  supine_compare_statistics(s->compare, shown->value, &statistics);
  s->max = fmax(s->max, statistics.max);
  (void)supine_print_text(
      shown->subtitle, sizeof shown->subtitle, "%.0f mL, mean %.1f, max %.1f mm",
      supine_posed_volume(s->basis, &shown->pose), statistics.mean, statistics.max);
  s->panel[i] = (supine_panel){.title = supine_options_posture_label(item->name),
                               .subtitle = shown->subtitle,
                               .note = shown->note,
                               .pose = &shown->pose,
                               .value = shown->value};
  memcpy(s->panel[i].gravity, item->state.gravity, sizeof s->panel[i].gravity);
  return SUPINE_OK;
}

/* Add the expected error to panel i, and marks of the structures inside the lungs, if any. Call
 * this after fill_panel. */
static supine_status mark_panel(studio *s, size_t i, supine_error *error) {
  drawn *shown = &s->shown[i];
  const supine_pose *const pose[2] = {&s->from.pose, &shown->pose};
  SUPINE_FREED_BY(supine_posed_expected_free) supine_expected expected = {0};
  SUPINE_TRY(supine_posed_expected(s->inside != NULL ? s->inside : s->basis,
                                   &s->postures.item[i].state, &s->from.state, &expected, error));
  double sigma = expected.sigma != NULL && expected.rms >= 0.05 ? expected.rms : NAN;
  if (s->inside != NULL) {
    s->panel[i].marks = &shown->marks.marks;
    SUPINE_TRY(supine_command_marks_make(s->inside, &s->names, pose, expected.sigma, &shown->marks,
                                         error));
    const supine_target *t = &shown->marks.first;
    char way[96];
    const bool still = t->moved < 0.05;
    (void)snprintf(shown->subtitle, sizeof shown->subtitle, "%s: %s", t->name,
                   still ? "where arrows begin" : supine_command_target_way(t, 2, way));
    sigma = still ? NAN : t->expected;
  }
  if (!isnan(sigma)) {
    (void)supine_print_text(shown->note, sizeof shown->note, "expected error %.1f mm", sigma);
  }
  return SUPINE_OK;
}

static supine_picture make_picture(studio *s) {
  const supine_pictures *wanted = s->wanted;
  const size_t count = s->postures.count;
  const double opacity = wanted->opacity > 0.0    ? wanted->opacity
                         : wanted->inside != NULL ? inside_opacity
                                                  : 1.0;
  const double largest = wanted->largest > 0.0 ? wanted->largest : supine_render_bar_end(s->max);
  (void)snprintf(s->label, sizeof s->label, "displacement from %s, mm", s->from.name);
  return (supine_picture){.panel = s->panel,
                          .panel_count = count,
                          .view = wanted->view,
                          .view_count = wanted->view_count,
                          .bar_label = s->label,
                          .colours = SUPINE_COLOURS_DISPLACEMENT,
                          .largest = largest,
                          .beyond = s->max > largest,
                          .transparency = 1.0 - opacity,
                          .width = wanted->size[0] != 0 ? wanted->size[0] : 20 + 440 * count,
                          .height = wanted->size[1] != 0 ? wanted->size[1]
                                                         : 120 + 480 * wanted->view_count};
}

static supine_status draw_postures(studio *s, supine_error *error) {
  for (size_t i = 0; i < s->postures.count; ++i) {
    SUPINE_TRY(fill_panel(s, i, error));
    SUPINE_TRY(mark_panel(s, i, error));
  }
  const supine_picture picture = make_picture(s);
  SUPINE_TRY(supine_render_picture_save(s->basis, &picture, s->wanted->output, error));
  (void)printf("%s: %zu x %zu pixels\n", s->wanted->output, picture.width, picture.height);
  return SUPINE_OK;
}

/* Compute frame `frame` of the `count` frames of an animation, and fill its only panel. */
static supine_status find_frame(studio *s, size_t frame, size_t count, supine_error *error) {
  const breath_turn *turn = &s->wanted->turn;
  supine_posture_item *item = &s->postures.item[0];
  item->state = s->wanted->volume.state;
  const double cosine = fmax(-1.0, fmin(1.0, supine_dot(turn->from, turn->to)));
  const double angle = acos(cosine) * 180.0 / 3.14159265358979323846;
  const double share = (double)frame / (double)(count - 1);
  supine_breath_turn_gravity(turn, share * turn->seconds, item->state.gravity);
  (void)supine_print_text(item->name, sizeof item->name, "turned by %.0f of %.0f degrees",
                          share * angle, angle);
  return fill_panel(s, 0, error);
}

/* Append all frames of a body's turn to an animation.
 * @param extent  for each view, the limits of x and y of the lungs over the whole turn, mm */
static supine_status add_frames(studio *s, size_t count, const double (*extent)[4],
                                supine_animation *animation, supine_error *error) {
  SUPINE_FREED_BY(supine_options_progress_end)
  supine_progress progress = supine_options_progress_begin(name);
  for (size_t frame = 0; frame < count; ++frame) {
    SUPINE_TRY(find_frame(s, frame, count, error));
    SUPINE_TRY(mark_panel(s, 0, error));
    supine_picture picture = make_picture(s);
    picture.extent = extent;
    SUPINE_TRY(supine_render_animation_add(animation, s->basis, &picture,
                                           frame + 1 < count ? 1000 / FPS : LAST_FRAME_MS, error));
    SUPINE_REFUSE_IF(!supine_options_progress_step(&progress, (double)(frame + 1) / (double)count),
                     error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
  }
  return SUPINE_OK;
}

/* Draw an animation of the body's turn from one posture to another. A first pass over the frames
 * finds the largest displacement and the extents of the lungs, so that the colour bar and the scale
 * are the same in all frames. */
static supine_status draw_turn(studio *s, supine_error *error) {
  static const double none[4] = SUPINE_EXTENT_NONE;
  const char *path = s->wanted->output;
  const double seconds = s->wanted->turn.seconds;
  const double frames = fmax(2.0, floor(seconds * FPS * (1.0 + 1e-12)) + 1.0);
  double extent[SUPINE_VIEWS_MAX][4];
  SUPINE_FREED_BY(supine_render_animation_close) supine_animation *animation = NULL;
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  SUPINE_REFUSE_IF(!(frames <= FRAMES_MAX), error, SUPINE_ERROR_ARGUMENT,
                   "a turn of %g s has more than %d frames: give a shorter turn", seconds,
                   FRAMES_MAX);
  const size_t count = (size_t)frames;
  for (size_t view = 0; view < SUPINE_VIEWS_MAX; ++view) {
    memcpy(extent[view], none, sizeof none);
  }
  for (size_t frame = 0; frame < count; ++frame) {
    SUPINE_TRY(find_frame(s, frame, count, error));
    const supine_picture picture = make_picture(s);
    supine_render_picture_extent(s->basis, &picture, extent);
  }
  const supine_picture picture = make_picture(s);
  SUPINE_TRY(supine_output_open(path, &output, error));
  SUPINE_TRY(supine_render_animation_open(picture.width, picture.height, &animation, error));
  supine_options_signals_catch(true);
  SUPINE_TRY(add_frames(s, count, (const double(*)[4])extent, animation, error));
  const supine_status status = supine_render_animation_write(animation, output.file, error);
  SUPINE_TRY(status == SUPINE_OK || ferror(output.file) != 0 ? supine_output_commit(&output, error)
                                                             : status);
  (void)printf("%s: %zu x %zu pixels, %zu frames\n", path, picture.width, picture.height, count);
  return SUPINE_OK;
}

supine_status supine_command_pictures_draw(const supine_pictures *wanted, const char *path,
                                           supine_error *error) {
  SUPINE_FREED_BY(close_studio) studio s = {.wanted = wanted, .postures.count = 1};
  if (!wanted->turns) {
    SUPINE_TRY(supine_options_posture_list_parse(wanted->postures, &wanted->volume.state,
                                                 &s.postures, error));
    SUPINE_TRY(supine_options_posture_list_check(
        &s.postures, wanted->volume.state.volume.kind != SUPINE_VOLUME_DEFAULT, error));
  }
  SUPINE_REFUSE_IF(s.postures.count > SUPINE_PANELS_MAX, error, SUPINE_ERROR_ARGUMENT,
                   "a picture holds at most %d postures: name fewer", SUPINE_PANELS_MAX);
  SUPINE_TRY(open_studio(&s, path, error));
  return wanted->turns ? draw_turn(&s, error) : draw_postures(&s, error);
}
