/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine render: draw the lungs in one or several postures, or during a turn or a breath. */
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

static supine_status read_look(const char *text, void *field, supine_error *error) {
  supine_look *look = field;
  const bool shell = strcmp(text, "shell") == 0;
  (void)error;
  *look = shell ? SUPINE_LOOK_SHELL : SUPINE_LOOK_MAP;
  return supine_options_fits(shell || strcmp(text, "displacement") == 0);
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
    {"posture", 0, "LIST",
     "comma-separated postures: up to 8 side by side or, in a .webp, up to 32 that a film turns "
     "through, with a stop at each",
     FILLS(postures), .rivals = "gravity"},
    {"turn", 0, "FROM:TO:SECONDS",
     "draw a film of one turn at constant speed, such as supine:left:5s", FILLS(turn),
     .read = supine_options_turn_read, .wants = "FROM:TO:SECONDS",
     SUPINE_SAYS_GIVEN(supine_pictures, turns), .rivals = "gravity"},
    {"breath", 0, "VOLUME",
     "draw a film of one breath of this tidal volume, such as 500mL, in one posture: the breath of "
     "'supine breathe'",
     FILLS(breath), SUPINE_BREATH, .rivals = "breath"},
    {.table = supine_options_volume, FILLS(volume)},
    {"output", 'o', "FILE",
     ".png, .pdf or .svg for postures side by side; .webp for a film, which browsers play",
     FILLS(output), .required = true, .file = SUPINE_FILE_OUT,
     .endings = ".png, .pdf, .svg or .webp"},
    {"size", 0, "WxH",
     "size of the whole picture, in pixels; default 440 x 540 for each posture and view, plus "
     "margins",
     FILLS(size), .read = read_size, .wants = "WIDTHxHEIGHT, up to 16384 each"},
    {"view", 0, "LIST",
     "views to draw, one below another, separated by commas: anterior, posterior, left (or "
     "lateral), right, head, feet, lying (gravity down, head left)",
     .read = read_views, .standard = "lying"},
    {.table = supine_options_from, FILLS(from)},
    {"inside", 0, "FILE",
     "structures made by 'supine embed' from the same basis: targets, such as nodules, with their "
     "names and displacements, and airways or lobes (longer than 70 mm) around them",
     FILLS(inside), .file = SUPINE_FILE_IN},
    {"look", 0, "LOOK",
     "shell: translucent lungs, so that what is inside is seen; displacement: opaque lungs in the "
     "colours of the displacement, with a colour bar",
     FILLS(look), .read = read_look, .wants = "shell or displacement", .standard = "shell"},
    {"largest", 0, "MM",
     "with --look displacement, the end of the colour bar. If values exceed it, the bar has a "
     "pointed end. Default the largest displacement, rounded up",
     FILLS(largest), SUPINE_ABOVE_ZERO, SUPINE_MEASURES(LENGTH), .more = true},
    {.name = NULL}};

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  supine_pictures *wanted = chosen;
  const bool film = supine_text_ends_in(wanted->output, ".webp");
  SUPINE_REFUSE_IF(!wanted->turns && wanted->postures == NULL, error, SUPINE_ERROR_ARGUMENT,
                   "the posture is missing: give --posture or --turn");
  SUPINE_REFUSE_IF(wanted->turns && wanted->breath > 0.0, error, SUPINE_ERROR_ARGUMENT,
                   "give --turn or --breath, not both");
  SUPINE_REFUSE_IF((wanted->turns || wanted->breath > 0.0) && !film, error, SUPINE_ERROR_ARGUMENT,
                   "--%s draws a film: give -o a name that ends in .webp",
                   wanted->turns ? "turn" : "breath");
  SUPINE_REFUSE_IF(
      wanted->largest > 0.0 && wanted->look == SUPINE_LOOK_SHELL, error, SUPINE_ERROR_ARGUMENT,
      "--largest sets the colour bar, which a shell has not: give --look displacement");
  return supine_command_pictures_draw(wanted, given->operand[0], error);
}

const supine_command supine_command_render = {
    "render",
    "draw the lungs and their targets: postures side by side, or a film of a turn or a breath",
    .usage = "BASIS --posture STATE[,STATE...] -o lungs.png [OPTIONS]\n"
             "BASIS --posture STATE,STATE[,STATE...] -o lungs.webp [OPTIONS]\n"
             "BASIS --turn FROM:TO:SECONDS -o turn.webp [OPTIONS]\n"
             "BASIS --posture NAME --breath VOLUME -o breath.webp [OPTIONS]",
    .about =
        "Draws the lungs in each posture as a translucent shell, on a table and in a faint torso, "
        "with what is inside. The target that moves most, in multiples of its expected error, "
        "is orange: a dashed circle shows where it was, an arrow how it moves, and a ring within "
        "which distance of its ball it is expected (RMS). Other targets are teal; up to eight are "
        "named. Airways, lobes and other large structures have a colour each. A film of postures "
        "turns from one to the next; the first stays beside it. No display is needed. In views "
        "other than 'lying', and in the look 'displacement', a ball shows the "
        "body's axes (left, right, anterior, posterior, head, feet) and gravity: an arrow, a dot "
        "if it points towards you, or a cross if it points away from you.",
    .options = table,
    .notes = SUPINE_POSTURE_LIST_HELP
    "\n\nExamples:\n"
    "  supine render lungs.safetensors --posture supine,prone,left,right -o postures.png\n"
    "  supine render lungs.safetensors --inside nodules.safetensors --posture supine,left \\\n"
    "      -o nodules.png\n"
    "  supine render lungs.safetensors --posture supine,left,prone,left,supine -o film.webp\n"
    "  supine render lungs.safetensors --posture prone --breath 500mL -o breath.webp\n"
    "  supine render lungs.safetensors --posture prone --from supine:rest --look displacement \\\n"
    "      --view anterior,lateral,posterior -o prone.pdf",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(supine_pictures),
    .run = run};
