/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw the lungs in several postures as a picture, or while they turn as a film. */
#include <math.h>
#include <string.h>

#include <supine/compare.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/output.h"
#include "base/text.h"
#include "base/vec3.h"

#include "program/command/render_pictures.h"
#include "program/options/basis_input.h"
#include "program/options/facts.h"
#include "program/options/inside.h"

static const char name[] = "render";
static const double turn_seconds = 1.0; /* duration of a turn between two postures of a list, s */

enum { FPS = 15, FRAMES_MAX = 10000, STOP_MS = 1000 };

/* A frame of a film. */
typedef struct frame {
  supine_state state;
  char title[SUPINE_POSTURE_NAME_MAX + 24];
  int ms; /* how long it is shown */
} frame;

typedef struct film {
  size_t count;
  frame *frame; /* [count] */
  supine_arena arena;
} film;

static void close_film(film *shot) {
  supine_arena_free(&shot->arena);
}

/* A state of the lungs that a panel of the picture shows. */
typedef struct drawn {
  supine_pose pose;
  float *value; /* [N] length of the displacement, mm */
  char figure[32];
  char subtitle[160];
  char note[128];
  supine_options_marks marks;
} drawn;

/* The panels of a picture or of one frame of an animation, and the objects that draw them. */
typedef struct studio {
  const supine_pictures *wanted;
  supine_view view[SUPINE_VIEWS_MAX];
  supine_basis *basis;
  supine_options_reference_pose from;
  supine_compare *compare;
  supine_basis *inside; /* NULL if there are no structures inside the lungs */
  supine_options_names names;
  double *score; /* [names.count] of supine_options_targets_score, over all panels and frames */
  char legend[128];
  supine_posture_list postures; /* posture of each panel */
  drawn shown[SUPINE_PANELS_MAX];
  supine_panel panel[SUPINE_PANELS_MAX];
  double max; /* largest displacement of all panels so far, mm */
  char label[128];
  char caveats[SUPINE_CAVEATS_SIZE]; /* what the picture must say of the lungs */
  supine_arena arena;
} studio;

static void close_studio(studio *s) {
  for (size_t i = 0; i < SUPINE_PANELS_MAX; ++i) {
    supine_options_marks_free(&s->shown[i].marks);
  }
  supine_options_names_close(&s->names);
  supine_basis_close(s->inside);
  supine_compare_destroy(s->compare);
  supine_arena_free(&s->arena);
  supine_basis_close(s->basis);
}

/* Warn of names that are written wrongly without pango. */
static void tell_letters(const studio *s) {
  enum { FIRST = 0xD6 }; /* smallest byte of a letter from U+0580 on: Hebrew, Arabic, Thai, ... */
  bool shaped = false;
  for (size_t i = 0; i < s->names.count; ++i) {
    for (const char *at = s->names.text[i]; *at != '\0'; ++at) {
      shaped = shaped || (unsigned char)*at >= FIRST;
    }
  }
  if (shaped && !supine_render_shapes_text()) {
    supine_options_say(name, "warning: pango is not installed, so that names in Arabic, Hebrew and "
                             "other scripts may be written wrongly: install libpangocairo-1.0");
  }
}

static supine_status open_studio(studio *s, const char *path, supine_error *error) {
  SUPINE_TRY(supine_options_basis_open(path, SUPINE_STORAGE_AUTO, s->wanted->volume.allow_folds,
                                       &s->basis, error));
  SUPINE_TRY(supine_options_reference(s->basis, name, &s->wanted->from, true, &s->from, error));
  SUPINE_TRY(supine_compare_create(s->basis, &s->compare, error));
  (void)supine_basis_caveats(s->basis, s->caveats, sizeof s->caveats);
  if (s->wanted->inside != NULL) {
    SUPINE_TRY(
        supine_options_inside_open(s->basis, s->wanted->inside, &s->inside, &s->names, error));
    s->score = supine_arena_zeros(&s->arena, s->names.count, sizeof *s->score);
    tell_letters(s);
  }
  const size_t n = supine_basis_get_info(s->basis)->vertex_count;
  for (size_t i = 0; i < s->postures.count; ++i) {
    s->shown[i].value = supine_arena_take(&s->arena, n, sizeof *s->shown[i].value);
  }
  return s->arena.failed ? supine_error_memory(error, "%zu vertices", n) : SUPINE_OK;
}

/* Fill panel i: compute the pose, the displacements and the subtitle.
 * @param tell  whether to warn of what is wrong with the lungs (supine_options_pose) */
static supine_status fill_panel(studio *s, size_t i, bool tell, supine_error *error) {
  const supine_posture_item *item = &s->postures.item[i];
  drawn *shown = &s->shown[i];
  if (tell) {
    SUPINE_TRY(supine_options_pose(s->basis, name, &item->state, &shown->pose, error));
  } else {
    SUPINE_TRY(supine_basis_pose(s->basis, &item->state, &shown->pose, error));
  }
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

/* Compute the expected errors of panel i: of the structures inside the lungs, else of the
 * surface. */
static supine_status expect(const studio *s, size_t i, supine_errors *errors, supine_error *error) {
  return supine_posed_errors(s->inside != NULL ? s->inside : s->basis, &s->postures.item[i].state,
                             &s->from.state, errors, error);
}

/* Raise the scores of the targets to those of panel i, after fill_panel. */
static supine_status score_panel(studio *s, size_t i, supine_error *error) {
  const supine_pose *const pose[2] = {&s->from.pose, &s->shown[i].pose};
  SUPINE_FREED_BY(supine_posed_errors_free) supine_errors errors = {.moved = {0}};
  SUPINE_FREED_BY(supine_options_targets_free) supine_target *targets = NULL;
  if (s->inside != NULL) {
    SUPINE_TRY(expect(s, i, &errors, error));
    SUPINE_TRY(
        supine_options_targets_find(s->inside, &s->names, pose, &errors, false, &targets, error));
    supine_options_targets_score(targets, s->names.count, s->score);
  }
  return SUPINE_OK;
}

/* Write the caption of panel i about the selected target: how far it goes, the expected error, and
 * where to. */
static void tell_target(studio *s, size_t i) {
  drawn *shown = &s->shown[i];
  const supine_target *t = &shown->marks.selected;
  char target[SUPINE_SHOWN_NAME_SIZE];
  shown->note[0] = '\0';
  if (t->moved < 0.05 && !(t->moved_error > 0.0)) {
    (void)supine_print_text(shown->subtitle, sizeof shown->subtitle, "where %s is",
                            supine_options_shown_name(t->name, 36, target));
    return;
  }
  (void)supine_print_text(shown->figure, sizeof shown->figure, "%.1f mm", t->moved);
  s->panel[i].figure = shown->figure;
  if (isnan(t->moved_error)) {
    (void)supine_print_text(shown->subtitle, sizeof shown->subtitle, "error unknown");
  } else {
    (void)supine_print_text(shown->subtitle, sizeof shown->subtitle, "\302\261 %.1f expected",
                            t->moved_error);
  }
  if (t->moved <= t->moved_error) {
    (void)supine_print_text(shown->note, sizeof shown->note, "no change that the model can tell");
  } else {
    (void)supine_options_target_way(t, 2, shown->note);
  }
}

/* Add the expected error to panel i, and marks of the structures inside the lungs, if any. Call
 * this after fill_panel, and after score_panel for all panels. */
static supine_status mark_panel(studio *s, size_t i, supine_error *error) {
  drawn *shown = &s->shown[i];
  const supine_pose *const pose[2] = {&s->from.pose, &shown->pose};
  SUPINE_FREED_BY(supine_posed_errors_free) supine_errors errors = {.moved = {0}};
  SUPINE_TRY(expect(s, i, &errors, error));
  shown->note[0] = '\0';
  if (s->inside == NULL) {
    if (errors.moved.sigma != NULL && errors.moved.rms >= 0.05) {
      (void)supine_print_text(shown->note, sizeof shown->note, "expected error %.1f mm",
                              errors.moved.rms);
    }
    return SUPINE_OK;
  }
  s->panel[i].marks = &shown->marks.marks;
  SUPINE_TRY(supine_options_marks_make(s->inside, &s->names, pose, &errors, s->score, &shown->marks,
                                       error));
  if (shown->marks.selected.name != NULL) {
    tell_target(s, i);
  }
  return SUPINE_OK;
}

/* Write what the signs of a picture with targets mean. */
static void write_legend(studio *s) {
  const size_t unnamed = s->shown[0].marks.unnamed;
  s->legend[0] = '\0';
  if (s->inside != NULL) {
    supine_text_add(s->legend, sizeof s->legend,
                    "dashed: %s \302\267 ring: within the expected error", s->from.name);
  }
  if (s->wanted->view[0] == SUPINE_VIEW_LYING) {
    supine_text_add(s->legend, sizeof s->legend, "%sgravity points down",
                    s->inside != NULL ? " \302\267 " : "");
  }
  if (unnamed > 0) {
    supine_text_add(s->legend, sizeof s->legend, " \302\267 and %zu more target%s", unnamed,
                    unnamed == 1 ? "" : "s");
  }
}

static supine_picture make_picture(studio *s) {
  const supine_pictures *wanted = s->wanted;
  const size_t count = s->postures.count;
  const double largest = wanted->largest > 0.0 ? wanted->largest : supine_render_bar_end(s->max);
  (void)snprintf(s->label, sizeof s->label, "displacement from %s, mm", s->from.name);
  return (supine_picture){.panel = s->panel,
                          .panel_count = count,
                          .view = s->view,
                          .view_count = wanted->view_count,
                          .bar_label = s->label,
                          .legend = s->legend,
                          .remark = "computed, not measured",
                          .caption = s->caveats,
                          .colours = SUPINE_COLOURS_DISPLACEMENT,
                          .largest = largest,
                          .beyond = s->max > largest,
                          .look = wanted->look,
                          .width = wanted->size[0] != 0 ? wanted->size[0] : 20 + 440 * count,
                          .height = wanted->size[1] != 0 ? wanted->size[1]
                                                         : 140 + 540 * wanted->view_count};
}

/* Compute and mark all panels. */
static supine_status fill_panels(studio *s, supine_error *error) {
  for (size_t i = 0; i < s->postures.count; ++i) {
    SUPINE_TRY(fill_panel(s, i, true, error));
    SUPINE_TRY(score_panel(s, i, error));
  }
  for (size_t i = 0; i < s->postures.count; ++i) {
    SUPINE_TRY(mark_panel(s, i, error));
  }
  write_legend(s);
  return SUPINE_OK;
}

static void add_result(const char *path, const supine_picture *picture, size_t frames) {
  SUPINE_ADD_RESULT(json_pack("{s:o, s:I, s:I, s:I}", "file", supine_options_json_text(path),
                              "width", (json_int_t)picture->width, "height",
                              (json_int_t)picture->height, "frames", (json_int_t)frames));
}

static supine_status draw_postures(studio *s, supine_error *error) {
  SUPINE_TRY(fill_panels(s, error));
  const supine_picture picture = make_picture(s);
  SUPINE_TRY(supine_render_picture_save(s->basis, &picture, s->wanted->output, error));
  supine_options_line("%s: %zu x %zu pixels\n", s->wanted->output, picture.width, picture.height);
  add_result(s->wanted->output, &picture, 1);
  return SUPINE_OK;
}

/* Compute a frame of a film, and fill the panel that moves: the last one. */
static supine_status find_frame(studio *s, const frame *shown, bool tell, supine_error *error) {
  const size_t moving = s->postures.count - 1;
  s->postures.item[moving].state = shown->state;
  SUPINE_TRY(fill_panel(s, moving, tell, error));
  s->panel[moving].title = shown->title;
  return SUPINE_OK;
}

/* Append all frames of a film to an animation.
 * @param extent  for each view, the limits of x and y of the lungs over the whole film, mm */
static supine_status add_frames(studio *s, const film *shot, const double (*extent)[4],
                                supine_animation *animation, supine_error *error) {
  SUPINE_FREED_BY(supine_options_progress_end)
  supine_progress progress = supine_options_progress_begin(name);
  const size_t moving = s->postures.count - 1;
  for (size_t i = 0; i < moving; ++i) {
    SUPINE_TRY(mark_panel(s, i, error));
  }
  for (size_t i = 0; i < shot->count; ++i) {
    SUPINE_TRY(find_frame(s, &shot->frame[i], false, error));
    SUPINE_TRY(mark_panel(s, moving, error));
    write_legend(s);
    supine_picture picture = make_picture(s);
    picture.extent = extent;
    SUPINE_TRY(
        supine_render_animation_add(animation, s->basis, &picture, shot->frame[i].ms, error));
    const bool goes_on =
        supine_options_progress_step(&progress, (double)(i + 1) / (double)shot->count);
    SUPINE_REFUSE_IF(!goes_on, error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
  }
  return SUPINE_OK;
}

/* Draw a film. A first pass over the frames finds the largest displacement and the extents of the
 * lungs, so that the colour bar and the scale are the same in all frames. */
static supine_status draw_film(studio *s, const film *shot, supine_error *error) {
  static const double none[4] = SUPINE_EXTENT_NONE;
  const char *path = s->wanted->output;
  double extent[SUPINE_VIEWS_MAX][4];
  SUPINE_FREED_BY(supine_render_animation_close) supine_animation *animation = NULL;
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  for (size_t view = 0; view < SUPINE_VIEWS_MAX; ++view) {
    memcpy(extent[view], none, sizeof none);
  }
  for (size_t i = 0; i < shot->count; ++i) {
    const double *gravity = shot->frame[i].state.gravity;
    if (s->view[0] == SUPINE_VIEW_LYING && fabs(gravity[2]) > SUPINE_VIEW_LYING_TILT) {
      s->view[0] = SUPINE_VIEW_ANTERIOR; /* the camera of a patient who gets up stays where it is */
    }
  }
  const size_t moving = s->postures.count - 1;
  for (size_t i = 0; i < moving; ++i) {
    SUPINE_TRY(fill_panel(s, i, true, error));
    SUPINE_TRY(score_panel(s, i, error));
  }
  for (size_t i = 0; i < shot->count; ++i) {
    SUPINE_TRY(find_frame(s, &shot->frame[i], shot->frame[i].ms == STOP_MS, error));
    SUPINE_TRY(score_panel(s, moving, error));
    const supine_picture picture = make_picture(s);
    supine_render_picture_extent(s->basis, &picture, extent);
  }
  const supine_picture picture = make_picture(s);
  SUPINE_TRY(supine_output_open(path, &output, error));
  SUPINE_TRY(supine_render_animation_open(picture.width, picture.height, &animation, error));
  supine_options_signals_catch(true);
  SUPINE_TRY(add_frames(s, shot, (const double(*)[4])extent, animation, error));
  const supine_status status = supine_render_animation_write(animation, output.file, error);
  if (ferror(output.file) == 0) {
    SUPINE_TRY(status);
  }
  SUPINE_TRY(supine_output_commit(&output, error)); /* which says why the file cannot be written */
  supine_options_line("%s: %zu x %zu pixels, %zu frames\n", path, picture.width, picture.height,
                      shot->count);
  add_result(path, &picture, shot->count);
  return SUPINE_OK;
}

static bool same_volume(const supine_state *a, const supine_state *b) {
  bool same = a->lung_count == b->lung_count && a->volume.kind == b->volume.kind &&
              a->volume.ml == b->volume.ml;
  for (size_t i = 0; i < a->lung_count && same; ++i) {
    same = strcmp(a->lungs[i].name, b->lungs[i].name) == 0 &&
           a->lungs[i].volume.kind == b->lungs[i].volume.kind &&
           a->lungs[i].volume.ml == b->lungs[i].volume.ml;
  }
  return same;
}

/* Append the frames of a turn without the first, with which the turn before ends, and stop at the
 * last.
 * @param to  name of the posture at the end; NULL to print the angle */
static void add_turn(film *shot, const breath_turn *turn, const supine_state *state,
                     const char *to) {
  const size_t count = (size_t)fmax(2.0, supine_options_frame_count(turn->seconds, FPS));
  const double cosine = fmax(-1.0, fmin(1.0, supine_dot(turn->from, turn->to)));
  const double angle = acos(cosine) * 180.0 / 3.14159265358979323846;
  for (size_t i = shot->count > 0 ? 1 : 0; i < count; ++i) {
    frame *next = &shot->frame[shot->count++];
    const double share = (double)i / (double)(count - 1);
    const bool last = i + 1 == count;
    *next = (frame){.state = *state, .ms = last ? STOP_MS : 1000 / FPS};
    supine_options_turn_gravity(turn, share * turn->seconds, next->state.gravity);
    if (to == NULL) {
      (void)supine_print_text(next->title, sizeof next->title, "turned by %.0f of %.0f degrees",
                              share * angle, angle);
    } else {
      (void)snprintf(next->title, sizeof next->title, "%s%s", last ? "" : "to ", to);
    }
  }
}

/* Allocate the frames of turns of `seconds` each. */
static supine_status begin_turns(film *shot, size_t turns, double seconds, supine_error *error) {
  const double most = fmax(2.0, supine_options_frame_count(seconds, FPS));
  SUPINE_REFUSE_IF(!(most <= FRAMES_MAX), error, SUPINE_ERROR_ARGUMENT,
                   "a turn of %g s has more than %d frames: give a shorter turn", seconds,
                   FRAMES_MAX);
  shot->frame = supine_arena_take(&shot->arena, turns * (size_t)most, sizeof *shot->frame);
  return supine_arena_check(&shot->arena, error, "the frames of %zu turns", turns);
}

/* Make a film that turns from each posture of a list to the next. */
static supine_status turn_through(const supine_posture_list *stops, film *shot,
                                  supine_error *error) {
  const supine_posture_item *first = &stops->item[0];
  SUPINE_REFUSE_IF(stops->count < 2, error, SUPINE_ERROR_ARGUMENT,
                   "a film needs two postures or more, or a breath: name where to turn, add "
                   "--breath 500mL, or give -o a name that ends in .png");
  SUPINE_TRY(begin_turns(shot, stops->count - 1, turn_seconds, error));
  for (size_t i = 1; i < stops->count; ++i) {
    const supine_posture_item *item = &stops->item[i];
    breath_turn turn = {.seconds = turn_seconds};
    SUPINE_REFUSE_IF(!same_volume(&item->state, &first->state), error, SUPINE_ERROR_ARGUMENT,
                     "a film turns at one volume: give it once, with --volume");
    memcpy(turn.from, item[-1].state.gravity, sizeof turn.from);
    memcpy(turn.to, item->state.gravity, sizeof turn.to);
    add_turn(shot, &turn, &first->state, supine_options_posture_label(item->name));
  }
  (void)snprintf(shot->frame[0].title, sizeof shot->frame[0].title, "%s",
                 supine_options_posture_label(first->name));
  return SUPINE_OK;
}

/* Make a film of one breath in a posture, which ends as it begins. */
static supine_status breathe_in(const supine_basis *basis, const supine_posture_list *stops,
                                double tidal, film *shot, supine_error *error) {
  SUPINE_REFUSE_IF(stops->count != 1, error, SUPINE_ERROR_ARGUMENT,
                   "a film of a breath has one posture: name one");
  supine_options_breath breath = {.cycle = supine_breath_default(), .fps = FPS};
  SUPINE_TRY(supine_options_breath_lie(&stops->item[0].state, &breath, error));
  breath.cycle.tidal = tidal;
  breath.count = (size_t)supine_options_frame_count(60.0 / breath.cycle.rate, FPS);
  shot->frame = supine_arena_take(&shot->arena, breath.count, sizeof *shot->frame);
  double *time = supine_arena_take(&shot->arena, breath.count, sizeof *time);
  supine_state *state = supine_arena_take(&shot->arena, breath.count, sizeof *state);
  SUPINE_TRY(supine_arena_check(&shot->arena, error, "%zu frames", breath.count));
  SUPINE_TRY(supine_options_breath_list(basis, name, &breath, time, state, error));
  const char *posture = supine_options_posture_label(stops->item[0].name);
  for (size_t i = 0; i < breath.count; ++i) {
    frame *next = &shot->frame[shot->count++];
    const double above = state[i].volume.ml - state[0].volume.ml;
    *next = (frame){.state = state[i], .ms = 1000 / FPS};
    (void)supine_print_text(next->title, sizeof next->title, "%s, %s + %.0f mL", posture,
                            supine_basis_get_info(basis)->has_rest ? "rest" : "scan", above);
  }
  return SUPINE_OK;
}

/* Draw a film of --turn, of the postures of a list, or of a breath. */
static supine_status film_draw(studio *s, const char *path, supine_error *error) {
  const supine_pictures *wanted = s->wanted;
  supine_posture_list stops = {.count = 0};
  SUPINE_FREED_BY(close_film) film shot = {.count = 0};
  if (wanted->postures != NULL) {
    SUPINE_TRY(
        supine_options_posture_list_parse(wanted->postures, &wanted->volume.state, &stops, error));
    SUPINE_TRY(supine_options_posture_list_check(
        &stops, wanted->volume.state.volume.kind != SUPINE_VOLUME_DEFAULT, error));
  }
  if (wanted->turns) {
    SUPINE_TRY(begin_turns(&shot, 1, wanted->turn.seconds, error));
    add_turn(&shot, &wanted->turn, &wanted->volume.state, NULL);
  } else if (wanted->breath == 0.0) {
    SUPINE_TRY(turn_through(&stops, &shot, error));
    s->postures.item[0] = stops.item[0]; /* which stays beside the lungs that turn */
    s->postures.count = 2;
  }
  SUPINE_TRY(open_studio(s, path, error));
  if (wanted->breath > 0.0) {
    SUPINE_TRY(breathe_in(s->basis, &stops, wanted->breath, &shot, error));
  }
  return draw_film(s, &shot, error);
}

supine_status supine_command_pictures_still(const supine_pictures *wanted, const char *path,
                                            FILE *file, supine_error *error) {
  SUPINE_FREED_BY(close_studio) studio s = {.wanted = wanted, .postures.count = 1};
  SUPINE_FREED_BY(supine_render_animation_close) supine_animation *still = NULL;
  memcpy(s.view, wanted->view, sizeof s.view);
  SUPINE_TRY(supine_options_posture_list_parse(wanted->postures, &wanted->volume.state, &s.postures,
                                               error));
  SUPINE_TRY(open_studio(&s, path, error));
  SUPINE_TRY(fill_panels(&s, error));
  const supine_picture picture = make_picture(&s);
  SUPINE_TRY(supine_render_animation_open(picture.width, picture.height, &still, error));
  SUPINE_TRY(supine_render_animation_add(still, s.basis, &picture, STOP_MS, error));
  return supine_render_animation_write(still, file, error);
}

supine_status supine_command_pictures_draw(const supine_pictures *wanted, const char *path,
                                           supine_error *error) {
  SUPINE_FREED_BY(close_studio) studio s = {.wanted = wanted, .postures.count = 1};
  memcpy(s.view, wanted->view, sizeof s.view);
  if (supine_text_ends_in(wanted->output, ".webp")) {
    return film_draw(&s, path, error);
  }
  SUPINE_TRY(supine_options_posture_list_parse(wanted->postures, &wanted->volume.state, &s.postures,
                                               error));
  SUPINE_TRY(supine_options_posture_list_check(
      &s.postures, wanted->volume.state.volume.kind != SUPINE_VOLUME_DEFAULT, error));
  SUPINE_REFUSE_IF(s.postures.count > SUPINE_PANELS_MAX, error, SUPINE_ERROR_ARGUMENT,
                   "a picture holds at most %d postures: name fewer", SUPINE_PANELS_MAX);
  SUPINE_TRY(open_studio(&s, path, error));
  return draw_postures(&s, error);
}
