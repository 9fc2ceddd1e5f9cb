/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine render: draw the lungs in one or several postures, or during a turn. */
#include <string.h>

#include "base/arena.h"
#include "base/text.h"

#include "program/command/list.h"
#include "program/command/render_pictures.h"

static supine_status read_size(const char *text, void *field, supine_error *error) {
  size_t *size = field;
  char rest;
  (void)error;
  return supine_options_fits(sscanf(text, "%5zux%5zu%c", &size[0], &size[1], &rest) == 2 &&
                             size[0] > 0 && size[1] > 0 && size[0] <= 16384 && size[1] <= 16384);
}

static supine_status read_views(const char *text, void *field, supine_error *error) {
  supine_pictures *wanted = field;
  const char *names[SUPINE_VIEW_COUNT + 1] = {[SUPINE_VIEW_COUNT] = "lateral"};
  char word[32];
  wanted->view_count = 0;
  for (supine_view i = 0; i < SUPINE_VIEW_COUNT; ++i) {
    names[i] = supine_render_view_name(i);
  }
  for (const char *at = text; supine_options_next_item(&at, word, sizeof word);) {
    size_t view = 0;
    while (view <= SUPINE_VIEW_COUNT && strcmp(word, names[view]) != 0) {
      ++view;
    }
    if (view > SUPINE_VIEW_COUNT) {
      const char *nearest = supine_options_suggest(word, names, SUPINE_VIEW_COUNT + 1);
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "no view '%s'; did you mean '%s'?",
                              word, nearest != NULL ? nearest : "anterior");
    }
    SUPINE_REFUSE_IF(wanted->view_count == SUPINE_VIEWS_MAX, error, SUPINE_ERROR_ARGUMENT,
                     "more than %d views: name fewer", SUPINE_VIEWS_MAX);
    wanted->view[wanted->view_count++] =
        view == SUPINE_VIEW_COUNT ? SUPINE_VIEW_LEFT : (supine_view)view;
  }
  return SUPINE_OK;
}

#define FILLS(member) SUPINE_FILLS(supine_pictures, member)

static const supine_option table[] = {
    {"posture", 0, "LIST", "comma-separated postures, up to 8", FILLS(postures),
     .rivals = "gravity"},
    {"turn", 0, "FROM:TO:SECONDS",
     "draw an animation instead: gravity turns from one posture to another at constant speed, "
     "pauses for a second, and starts again. For example, supine:left:5s turns for 5 s",
     FILLS(turn), .read = supine_options_turn_read, .wants = "FROM:TO:SECONDS",
     SUPINE_SAYS_GIVEN(supine_pictures, turns), .rivals = "gravity"},
    {.table = supine_options_volume, FILLS(volume)},
    {"output", 'o', "FILE", ".png for --posture; .webp for --turn, an animation that browsers play",
     FILLS(output), .required = true, .file = SUPINE_FILE_OUT, .endings = ".png or .webp"},
    {"size", 0, "WxH",
     "size of the whole picture, in pixels; default 440 x 480 for each posture and view, plus "
     "margins",
     FILLS(size), .read = read_size, .wants = "WIDTHxHEIGHT, up to 16384 each"},
    {"view", 0, "LIST",
     "views to draw, one below another, separated by commas: anterior, posterior, left (or "
     "lateral), right, head, feet, lying (gravity down, head left). With --turn, lying is anterior",
     .read = read_views, .standard = "lying"},
    {.table = supine_options_from, FILLS(from)},
    {"largest", 0, "MM",
     "end of the colour bar. If values exceed it, the bar has a pointed end. Default the largest "
     "displacement, rounded up",
     FILLS(largest), SUPINE_ABOVE_ZERO, .wants = "millimetres above 0", .more = true},
    {"inside", 0, "FILE",
     "structures made by 'supine embed' from the same basis, shown inside transparent lungs with "
     "their names and displacements",
     FILLS(inside), .file = SUPINE_FILE_IN},
    {"opacity", 0, "SHARE",
     "opacity of the lungs, 0.05 to 1 (opaque); default 1, or 0.35 with --inside", FILLS(opacity),
     .range = {0.05, 1.0}, .wants = "a share from 0.05 to 1", .more = true},
    {.name = NULL}};

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  supine_pictures *wanted = chosen;
  SUPINE_REFUSE_IF(!wanted->turns && wanted->postures == NULL, error, SUPINE_ERROR_ARGUMENT,
                   "the posture is missing: give --posture or --turn");
  SUPINE_REFUSE_IF(
      wanted->turns != supine_text_ends_in(wanted->output, ".webp"), error, SUPINE_ERROR_ARGUMENT,
      wanted->turns ? "--turn writes an animation: give -o a name that ends in .webp"
                    : "--posture writes a still picture: give -o a name that ends in .png");
  if (wanted->turns && wanted->view[0] == SUPINE_VIEW_LYING) {
    wanted->view[0] = SUPINE_VIEW_ANTERIOR; /* the camera of a film stays where it is */
  }
  return supine_command_pictures_draw(wanted, given->operand[0], error);
}

const supine_command supine_command_render = {
    "render",
    "draw the lungs: postures side by side, or an animated turn",
    .usage = "BASIS --posture STATE[,STATE...] -o lung.png [OPTIONS]\n"
             "BASIS --turn FROM:TO:SECONDS -o turn.webp [OPTIONS]",
    .about = "Draws the lungs in each posture, side by side; no display is needed. Colours show "
             "the displacement, with contour lines at the ticks of the colour bar. A ball shows "
             "the body's axes (left, right, anterior, posterior, head, feet) and gravity: an "
             "arrow, a dot if it points towards you, or a cross if it points away from you.",
    .options = table,
    .notes = SUPINE_POSTURE_LIST_HELP
    "\n\nExamples:\n"
    "  supine render lungs.safetensors --posture supine,prone,left,right -o postures.png\n"
    "  supine render lungs.safetensors --turn supine:left:5s -o turn.webp\n"
    "  supine render lungs.safetensors --inside nodules.safetensors --posture supine,prone \\\n"
    "      -o inside.png\n"
    "  supine render lungs.safetensors --posture prone --from supine:rest \\\n"
    "      --view anterior,lateral,posterior -o prone.png",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(supine_pictures),
    .run = run};
