/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine render: draw the lungs in one or several postures, or during a turn. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "program/drawing.h"
#include "program/options/basis_input.h"

static const char name[] = "render";

typedef supine_command_drawing request;

static supine_status render(supine_command_studio *studio, const supine_posture_list *postures,
                            supine_error *error) {
  const size_t n = supine_basis_get_info(studio->basis)->vertex_count;
  const size_t count = postures->count;
  char label[128];
  supine_panel panel[SUPINE_PANELS_MAX];
  supine_command_drawn *states = calloc(count, sizeof *states);
  float *values = malloc(count * n * sizeof *values);
  supine_status status = SUPINE_OK;
  if (states == NULL || values == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    states[i].value = values + i * n;
    status = supine_command_drawn_find(studio, &postures->item[i], &states[i], error);
    if (status == SUPINE_OK) {
      status = supine_command_drawn_mark(studio, &states[i], error);
    }
    panel[i] = supine_command_drawn_panel(studio->wanted, &states[i],
                                          supine_options_posture_label(postures->item[i].name),
                                          postures->item[i].gravity);
  }
  if (status == SUPINE_OK) {
    const supine_picture picture = supine_command_drawing_picture(studio, panel, count, label);
    status = supine_render_picture_save(studio->renderer, &picture, studio->wanted->output, error);
    if (status == SUPINE_OK) {
      (void)printf("%s: %zu x %zu pixels\n", studio->wanted->output, picture.width, picture.height);
    }
  }
  for (size_t i = 0; states != NULL && i < count; ++i) {
    supine_command_marks_free(&states[i].marks);
  }
  free(states);
  free(values);
  return status;
}

static supine_status read_size(const char *text, void *field, supine_error *error) {
  request *wanted = field;
  (void)error;
  char width[16];
  const size_t length = strcspn(text, "x");
  if (length < sizeof width && text[length] == 'x') {
    memcpy(width, text, length);
    width[length] = '\0';
    if (supine_options_parse_count(width, &wanted->width) &&
        supine_options_parse_count(text + length + 1, &wanted->height) && wanted->width > 0 &&
        wanted->height > 0 && wanted->width <= 16384 && wanted->height <= 16384) {
      return SUPINE_OK;
    }
  }
  return SUPINE_ERROR_ARGUMENT;
}

static supine_status read_views(const char *text, void *field, supine_error *error) {
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
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "no view '%s'; did you mean '%s'?",
                              word, nearest != NULL ? nearest : "anterior");
    }
    if (wanted->view_count == SUPINE_VIEWS_MAX) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "more than %d views: name fewer",
                              SUPINE_VIEWS_MAX);
    }
    wanted->view[wanted->view_count++] =
        view == SUPINE_VIEW_COUNT ? SUPINE_VIEW_LEFT : (supine_view)view;
    if (at[length] == '\0') {
      return SUPINE_OK;
    }
    at += length + 1;
  }
}

static supine_status read_turn(const char *text, void *field, supine_error *error) {
  request *wanted = field;
  return supine_command_read_turn(text, &wanted->turn, error);
}

static const char *const themes[] = {"light", "dark", NULL};

static const supine_option table[] = {
    {"posture", 0, "LIST", "postures to draw, up to 8", SUPINE_FILLS(request, postures)},
    {"turn", 0, "FROM:TO:SECONDS",
     "draw an animation instead: gravity turns from one posture to another at constant speed, "
     "as supine:left:5s, stays for a second, and starts again",
     .read = read_turn, .wants = "FROM:TO:SECONDS", SUPINE_SAYS_GIVEN(request, turns)},
    {.table = supine_options_volume, SUPINE_FILLS(request, volume)},
    {"output", 'o', "FILE", ".png; with --turn, .webp, which browsers play",
     SUPINE_FILLS(request, output), .required = true, .file = SUPINE_FILE_OUT,
     .endings = ".png or .webp"},
    {"size", 0, "WxH", "pixels; default: 440 x 480 for each posture and view, and a margin",
     .read = read_size, .wants = "WIDTHxHEIGHT, up to 16384 each"},
    {"view", 0, "LIST",
     "anterior (default), posterior, left, right, lateral (from the left), head, feet, oblique; "
     "several are drawn below each other",
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
    {"theme", 0, "light|dark", "colours of the picture", SUPINE_FILLS(request, theme),
     .choices = themes, .standard = "light", .more = true},
    {.help = SUPINE_POSTURE_LIST_HELP},
    {.name = NULL}};

/* Check that the options fit each other, then read the postures. */
static supine_status check(const request *wanted, supine_posture_list *postures,
                           supine_error *error) {
  const bool moving = strcasecmp(strrchr(wanted->output, '.'), ".webp") == 0; /* else .png */
  if (wanted->turns ? wanted->postures != NULL : wanted->postures == NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            wanted->turns ? "give --posture or --turn, not both"
                                          : "which posture? Give --posture supine, for example");
  }
  if (wanted->turns != moving) {
    return supine_error_set(
        error, SUPINE_ERROR_ARGUMENT,
        wanted->turns ? "--turn writes an animation: let -o end in .webp"
                      : "postures make a still picture: let -o end in .png (.webp with --turn)");
  }
  const supine_status status =
      wanted->turns ? SUPINE_OK
                    : supine_options_posture_list_parse(wanted->postures, postures, error);
  return status == SUPINE_OK && postures->count > SUPINE_PANELS_MAX
             ? supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                "a picture holds at most %d postures: name fewer",
                                SUPINE_PANELS_MAX)
             : status;
}

static void begin(void *chosen) {
  request *wanted = chosen;
  wanted->view[0] = SUPINE_VIEW_ANTERIOR;
  wanted->view_count = 1;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  const request *wanted = chosen;
  supine_posture_list postures = {.count = 0};
  supine_reference_pose from;
  supine_basis *basis = NULL;
  supine_status status = check(wanted, &postures, error);
  if (status == SUPINE_OK) {
    status = supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, &basis, error);
  }
  if (status == SUPINE_OK) {
    status = supine_options_basis_closed(basis, given->operand[0], error);
  }
  if (status == SUPINE_OK) {
    status = supine_options_reference(basis, &wanted->from, true, &from, error);
  }
  if (status == SUPINE_OK) {
    supine_command_studio studio = {.basis = basis, .wanted = wanted, .from = &from};
    status = supine_command_studio_open(&studio, error);
    if (status == SUPINE_OK) {
      status = wanted->turns ? supine_command_drawing_turn(&studio, error)
                             : render(&studio, &postures, error);
    }
    supine_command_studio_close(&studio);
  }
  supine_basis_close(basis);
  return status;
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
