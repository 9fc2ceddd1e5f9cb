/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine render: a picture of the lungs in one or several postures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sh/base/output.h"

#include "program/drawing.h"
#include "program/options/basis_input.h"

static const char name[] = "render";

typedef supine_command_drawing request;
typedef supine_command_drawn state;

static int write_picture(const request *wanted, supine_renderer *renderer,
                         const supine_picture *picture) {
  supine_output output = {0};
  supine_error error;
  if (supine_output_open(wanted->output, &output, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  if (supine_render_picture_write(renderer, picture, output.file, &error) != SUPINE_OK) {
    if (ferror(output.file) != 0) { /* the output knows why a write failed */
      (void)supine_output_commit(&output, &error);
    }
    supine_output_abandon(&output);
    return supine_options_fail(name, &error);
  }
  if (supine_output_commit(&output, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  (void)printf("%s: %zu x %zu pixels\n", wanted->output, picture->width, picture->height);
  return supine_options_finish(name);
}

/* Draw and write the states with the colours found for them. */
static int draw(const request *wanted, supine_renderer *renderer,
                const supine_posture_list *postures, const char *from, const state *states,
                const double ends[2]) {
  supine_panel panel[SUPINE_PANELS_MAX];
  char label[128];
  for (size_t i = 0; i < postures->count; ++i) {
    panel[i] = supine_command_drawn_panel(wanted, &states[i],
                                          supine_options_posture_label(postures->item[i].name),
                                          postures->item[i].gravity);
  }
  supine_picture picture =
      supine_command_drawing_picture(wanted, from, ends, postures->count, label);
  picture.panel = panel;
  return write_picture(wanted, renderer, &picture);
}

static supine_status find_marks(const supine_basis *basis, const char *path, state *states,
                                size_t count, const supine_pose *from, supine_error *error) {
  supine_basis *inside = NULL;
  supine_command_names names = {0};
  supine_status status = supine_command_inside_open(basis, path, &inside, &names, error);
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    status =
        supine_command_marks_make(inside, &names, &states[i].pose, from, &states[i].marks, error);
  }
  supine_command_names_close(&names);
  supine_basis_close(inside);
  return status;
}

static int render(const supine_basis *basis, const request *wanted,
                  const supine_posture_list *postures, const supine_reference_pose *from) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const size_t count = postures->count;
  supine_compare *compare = NULL;
  supine_renderer *renderer = NULL;
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  double ends[2] = {0.0, 0.0}; /* end of the colours: the 95th percentile, and the largest value */
  int result = SUPINE_EXIT_OK;
  state *states = calloc(count, sizeof *states);
  float *values = malloc(count * n * sizeof *values);
  if (states == NULL || values == NULL ||
      supine_compare_create(basis, &compare, &error) != SUPINE_OK ||
      supine_render_create(basis, &renderer, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  for (size_t i = 0; i < count && result == SUPINE_EXIT_OK; ++i) {
    states[i].value = values + i * n;
    result = supine_command_drawn_find(basis, compare, wanted, &postures->item[i], &states[i]);
  }
  if (result != SUPINE_EXIT_OK) {
    goto cleanup;
  }
  for (size_t i = 0; i < count; ++i) {
    supine_command_drawn_value(basis, compare, &from->pose, &states[i], ends);
  }
  if (wanted->inside != NULL &&
      find_marks(basis, wanted->inside, states, count, &from->pose, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  result = draw(wanted, renderer, postures, from->name, states, ends);
cleanup:
  supine_render_destroy(renderer);
  supine_compare_destroy(compare);
  for (size_t i = 0; states != NULL && i < count; ++i) {
    supine_command_marks_free(&states[i].marks);
  }
  free(states);
  free(values);
  return result;
}

static int read_size(const char *command, const char *text, void *field) {
  request *wanted = field;
  (void)command;
  char width[16];
  const size_t length = strcspn(text, "x");
  if (length < sizeof width && text[length] == 'x') {
    memcpy(width, text, length);
    width[length] = '\0';
    if (supine_options_parse_count(width, &wanted->width) &&
        supine_options_parse_count(text + length + 1, &wanted->height) && wanted->width > 0 &&
        wanted->height > 0 && wanted->width <= 16384 && wanted->height <= 16384) {
      return SUPINE_EXIT_OK;
    }
  }
  return SUPINE_OPTION_MISFIT;
}

static int read_views(const char *command, const char *text, void *field) {
  request *wanted = field;
  wanted->view_count = 0;
  for (const char *at = text;;) {
    char word[32];
    const char *names[SUPINE_VIEW_COUNT + 1] = {[SUPINE_VIEW_COUNT] = "lateral"};
    const size_t length = strcspn(at, ",");
    size_t view = 0;
    (void)snprintf(word, sizeof word, "%.*s", (int)(length < 31 ? length : 31), at);
    for (supine_view i = 0; i < SUPINE_VIEW_COUNT; ++i) {
      names[i] = supine_render_view_name(i);
    }
    while (view <= SUPINE_VIEW_COUNT && strcmp(word, names[view]) != 0) {
      ++view;
    }
    if (view > SUPINE_VIEW_COUNT) {
      const char *nearest = supine_options_suggest(word, names, SUPINE_VIEW_COUNT + 1);
      return supine_options_usage(command, "no view '%s'; did you mean '%s'?", word,
                                  nearest != NULL ? nearest : "anterior");
    }
    if (wanted->view_count == SUPINE_VIEWS_MAX) {
      return supine_options_usage(command, "more than %d views: name fewer", SUPINE_VIEWS_MAX);
    }
    wanted->view[wanted->view_count++] =
        view == SUPINE_VIEW_COUNT ? SUPINE_VIEW_LEFT : (supine_view)view;
    if (at[length] == '\0') {
      return SUPINE_EXIT_OK;
    }
    at += length + 1;
  }
}

static int read_turn(const char *command, const char *text, void *field) {
  request *wanted = field;
  return supine_command_read_turn(command, text, &wanted->turn);
}

static const char *const themes[] = {"light", "dark", NULL};

static const supine_option table[] = {
    {"posture", 0, "LIST", "postures to draw, up to 8; --postures is the same",
     SUPINE_FILLS(request, postures), .alias = "postures"},
    {"turn", 0, "FROM:TO:SECONDS",
     "draw an animation instead: gravity turns from one posture to another at constant speed, "
     "as supine:left:5s, rests for a second, and starts again",
     .read = read_turn, .wants = "FROM:TO:SECONDS", SUPINE_SAYS_GIVEN(request, turns)},
    {.table = supine_options_volume, SUPINE_FILLS(request, volume)},
    {"scale", 0, "MM",
     "largest displacement in each posture, instead of a volume: for open surfaces",
     SUPINE_FILLS(request, scale), SUPINE_ABOVE_ZERO, .wants = "millimetres above 0",
     .rivals = "breath"},
    {"output", 'o', "FILE", ".png; with --turn, .webp, which browsers play",
     SUPINE_FILLS(request, output), .required = true, .file = SUPINE_FILE_OUT,
     .endings = ".png or .webp"},
    {"size", 0, "WxH", "pixels; default: as the postures and views want", .read = read_size,
     .wants = "WIDTHxHEIGHT, up to 16384 each"},
    {"view", 0, "LIST",
     "anterior (default), posterior, left, right, lateral (from the left), head, feet, oblique; "
     "several come below each other",
     .read = read_views},
    {.table = supine_options_from, SUPINE_FILLS(request, from)},
    {"largest", 0, "MM",
     "end of the colour bar; default: the 95th percentile over the surface, rounded up; a "
     "pointed end marks values beyond it",
     SUPINE_FILLS(request, largest), SUPINE_ABOVE_ZERO, .wants = "millimetres above 0",
     .more = true},
    {"inside", 0, "FILE",
     "structures from 'supine embed' with the same basis, seen through the lungs: points and "
     "meshes, with their names and displacements",
     SUPINE_FILLS(request, inside), .file = SUPINE_FILE_IN},
    {"opacity", 0, "SHARE",
     "opacity of the lungs, 0.05 to 1 (opaque); default 1, with --inside 0.35",
     SUPINE_FILLS(request, opacity), .range = {0.05, 1.0}, .wants = "a share from 0.05 to 1",
     .more = true},
    {"theme", 0, "light|dark", "of the page", SUPINE_FILLS(request, theme), .choices = themes,
     .standard = "light", .more = true},
    {"title", 0, "TEXT", "a heading", SUPINE_FILLS(request, title), .more = true},
    {.help = SUPINE_POSTURE_LIST_HELP},
    {.name = NULL}};

/* Check that the options fit each other, then read the postures. */
static int check(const request *wanted, supine_posture_list *postures) {
  const bool moving = strcasecmp(strrchr(wanted->output, '.'), ".webp") == 0; /* the other: .png */
  if (wanted->turns ? wanted->postures != NULL : wanted->postures == NULL) {
    return supine_options_usage(name, wanted->turns
                                          ? "give --posture or --turn, not both"
                                          : "which posture? Give --posture supine, for example");
  }
  if (wanted->turns != moving) {
    return supine_options_usage(name, "--turn makes a .webp, postures a .png");
  }
  const int result = wanted->turns
                         ? SUPINE_EXIT_OK
                         : supine_options_posture_list_parse(name, wanted->postures, postures);
  if (result != SUPINE_EXIT_OK) {
    return result;
  }
  return postures->count <= SUPINE_PANELS_MAX
             ? SUPINE_EXIT_OK
             : supine_options_usage(name, "a picture holds at most %d postures: name fewer",
                                    SUPINE_PANELS_MAX);
}

static void begin(void *chosen) {
  request *wanted = chosen;
  wanted->view[0] = SUPINE_VIEW_ANTERIOR;
  wanted->view_count = 1;
}

static int run(void *chosen, const supine_arguments *given) {
  const request *wanted = chosen;
  supine_posture_list postures = {.count = 0};
  supine_reference_pose from;
  supine_basis *basis = NULL;
  supine_error error;
  int result = check(wanted, &postures);
  if (result != SUPINE_EXIT_OK) {
    return result;
  }
  if (supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, &basis, &error) !=
      SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  if (supine_options_reference(basis, &wanted->from, true, &from, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
  } else {
    result = wanted->turns ? supine_command_drawing_turn(basis, wanted, &from)
                           : render(basis, wanted, &postures, &from);
  }
  supine_basis_close(basis);
  return result;
}

const supine_command supine_command_render = {
    name,
    "draw the lungs: postures side by side, or a turn that plays",
    .usage = "BASIS --posture NAME[,NAME...] -o lung.png [OPTIONS]\n"
             "BASIS --turn FROM:TO:SECONDS -o turn.webp [OPTIONS]",
    .about =
        "Draws the lungs in each posture, side by side and off screen: coloured by "
        "displacement, with contour lines at the ticks of the colour bar, and a ball that "
        "shows the body's axes (left, right, anterior, posterior, head, feet) and gravity (the "
        "arrow; a cross points away from you).",
    .options = table,
    .notes =
        "Examples:\n"
        "  supine render lungs.safetensors --posture supine,prone,left,right -o postures.png\n"
        "  supine render lungs.safetensors --turn supine:left:5s -o turn.webp\n"
        "  supine render lungs.safetensors --inside nodules.safetensors --posture supine,prone \\\n"
        "      -o inside.png\n"
        "  supine render lungs.safetensors --posture prone --from supine:rest \\\n"
        "      --view anterior,lateral,posterior --theme dark -o prone.png",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .begin = begin,
    .run = run};
