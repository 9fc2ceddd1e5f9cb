/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine render: a picture of the lungs in one or several postures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/output.h"
#include <supine/compare.h>

#include "runtime/command/inside.h"
#include "runtime/options/basis_input.h"
#include "runtime/options/posture_list.h"
#include "runtime/options/volume.h"
#include "runtime/render/render.h"

static const char name[] = "render";

typedef struct request {
  const char *output;
  const char *postures;
  supine_volume_options volume;
  const char *reference; /* posture that colours are the difference from, or NULL */
  const char *title;
  const char *inside; /* a file, or NULL */
  double scale;       /* mm, or 0: by volume */
  double largest;
  size_t width, height;
  supine_view view[SUPINE_VIEWS_MAX];
  size_t view_count;
  unsigned theme; /* 1: dark */
} request;

/* One posture, ready to be drawn. */
typedef struct state {
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  float *value; /* [N] */
  char subtitle[96];
  supine_command_marks marks;
} state;

static int find_state(const supine_basis *basis, const supine_compare *compare,
                      const request *wanted, const supine_posture_item *item, float *distance,
                      state *found) {
  const size_t lungs = supine_basis_get_info(basis)->lung_count;
  supine_error error = {SUPINE_ERROR_NUMERICAL, "gravity has no direction"};
  if (supine_basis_weights(basis, item->gravity, found->weights) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  if (wanted->scale == 0.0) {
    return supine_options_volume_scales(basis, name, &wanted->volume, item->gravity, found->weights,
                                        found->scales);
  }
  supine_distance_statistics statistics;
  for (size_t lung = 0; lung < lungs; ++lung) {
    found->scales[lung] = 1.0;
  }
  supine_compare_distances(compare, found->weights, found->scales, NULL, NULL, distance);
  supine_compare_statistics(compare, distance, &statistics);
  if (!(statistics.max > 0.0)) {
    supine_options_say(name, "nothing moves in %s: no scale gives %g mm", item->name,
                       wanted->scale);
    return SUPINE_EXIT_NUMERICAL;
  }
  for (size_t lung = 0; lung < lungs; ++lung) {
    found->scales[lung] = wanted->scale / statistics.max;
  }
  return SUPINE_EXIT_OK;
}

/* What the colours show, and the words below the posture's name. */
static void find_value(const supine_basis *basis, const supine_compare *compare,
                       const state *reference, state *shown, double *p95, double *largest) {
  supine_distance_statistics statistics;
  supine_compare_distances(compare, shown->weights, shown->scales,
                           reference != NULL ? reference->weights : NULL,
                           reference != NULL ? reference->scales : NULL, shown->value);
  supine_compare_statistics(compare, shown->value, &statistics);
  *p95 = fmax(*p95, statistics.p95);
  *largest = fmax(*largest, statistics.max);
  size_t used = 0;
  if (supine_basis_get_info(basis)->has_volume) {
    double gain = 0.0;
    for (size_t lung = 0; lung < supine_basis_get_info(basis)->lung_count; ++lung) {
      gain += supine_basis_lung_volume(basis, lung, shown->weights, shown->scales[lung]);
    }
    if (supine_basis_get_info(basis)->resting_volume != NULL) { /* what the lungs hold */
      double held[SUPINE_LUNGS_MAX];
      supine_options_volume_reference(basis, held);
      for (size_t lung = 0; lung < supine_basis_get_info(basis)->lung_count; ++lung) {
        gain += held[lung];
      }
    }
    used = (size_t)snprintf(
        shown->subtitle, sizeof shown->subtitle,
        supine_basis_get_info(basis)->resting_volume != NULL ? "%.0f mL, " : "%+.0f mL, ", gain);
  }
  (void)snprintf(shown->subtitle + used, sizeof shown->subtitle - used, "mean %.1f, max %.1f mm",
                 statistics.mean, statistics.max);
}

static int write_picture(const request *wanted, supine_renderer *renderer,
                         const supine_picture *picture) {
  supine_output output = {0};
  supine_error error;
  if (supine_output_open(wanted->output, &output, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  if (supine_render_picture_write(renderer, picture, output.file, &error) != SUPINE_OK) {
    if (ferror(output.file) != 0) { /* why a write failed, the output knows */
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

static void choose_size(const request *wanted, supine_picture *picture) {
  picture->width = wanted->width != 0 ? wanted->width : 20 + 440 * picture->panel_count;
  picture->height = wanted->height != 0 ? wanted->height : 120 + 480 * picture->view_count;
}

/* Draws and writes what states and colours were found for. */
static int draw(const supine_basis *basis, const request *wanted, supine_renderer *renderer,
                const supine_posture_list *postures, const char *reference, const state *states,
                const double ends[2]) {
  supine_panel panel[SUPINE_PANELS_MAX];
  char label[128];
  for (size_t i = 0; i < postures->count; ++i) {
    panel[i] = (supine_panel){.title = postures->item[i].name,
                              .subtitle = states[i].subtitle,
                              .weights = states[i].weights,
                              .scales = states[i].scales,
                              .value = states[i].value,
                              .marks = wanted->inside != NULL ? &states[i].marks.marks : NULL};
    memcpy(panel[i].gravity, postures->item[i].gravity, sizeof panel[i].gravity);
  }
  (void)snprintf(label, sizeof label, "%s%s, mm",
                 reference != NULL ? "difference from "
                 : supine_basis_get_info(basis)->resting_volume != NULL
                     ? "displacement from full inflation"
                     : "displacement from rest",
                 reference != NULL ? reference : "");
  supine_picture picture = {
      .panel = panel,
      .panel_count = postures->count,
      .view = wanted->view,
      .view_count = wanted->view_count,
      .heading = wanted->title,
      .bar_label = label,
      .colours = reference != NULL ? SUPINE_COLOURS_DIFFERENCE : SUPINE_COLOURS_DISPLACEMENT,
      .largest = wanted->largest > 0.0 ? wanted->largest : supine_render_bar_end(ends[0]),
      .dark = wanted->theme == 1};
  picture.beyond = ends[1] > picture.largest;
  choose_size(wanted, &picture);
  return write_picture(wanted, renderer, &picture);
}

/* What is inside, in each state. */
static supine_status find_marks(const supine_basis *basis, const char *path, state *states,
                                size_t count, const state *reference, supine_error *error) {
  supine_basis *inside = NULL;
  supine_command_names names = {0};
  supine_status status = supine_basis_open(path, &inside, error);
  status = status == SUPINE_OK ? supine_command_names_open(inside, &names, error) : status;
  status = status == SUPINE_OK ? supine_command_inside_check(basis, inside, path, error) : status;
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    status = supine_command_marks_make(inside, &names, states[i].weights, states[i].scales,
                                       reference != NULL ? reference->weights : NULL,
                                       reference != NULL ? reference->scales : NULL,
                                       &states[i].marks, error);
  }
  supine_command_names_close(&names);
  supine_basis_close(inside);
  return status;
}

static int render(const supine_basis *basis, const request *wanted,
                  const supine_posture_list *postures, const supine_posture_item *reference) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const size_t count = postures->count;
  supine_compare *compare = NULL;
  supine_renderer *renderer = NULL;
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  double ends[2] = {0.0, 0.0}; /* of the colours: 95th percentile, largest */
  int result = SUPINE_EXIT_OK;
  state *states = calloc(count + 1, sizeof *states); /* the reference is the last */
  float *values = malloc((count + 1) * n * sizeof *values);
  if (states == NULL || values == NULL ||
      supine_compare_create(basis, &compare, &error) != SUPINE_OK ||
      supine_render_create(basis, &renderer, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  for (size_t i = 0; i <= count && result == SUPINE_EXIT_OK; ++i) {
    states[i].value = values + i * n;
    if (i < count || reference != NULL) {
      result = find_state(basis, compare, wanted, i < count ? &postures->item[i] : reference,
                          states[i].value, &states[i]);
    }
  }
  if (result != SUPINE_EXIT_OK) {
    goto cleanup;
  }
  for (size_t i = 0; i < count; ++i) {
    find_value(basis, compare, reference != NULL ? &states[count] : NULL, &states[i], &ends[0],
               &ends[1]);
  }
  if (wanted->inside != NULL &&
      find_marks(basis, wanted->inside, states, count, reference != NULL ? &states[count] : NULL,
                 &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  result = draw(basis, wanted, renderer, postures, reference != NULL ? reference->name : NULL,
                states, ends);
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
      return supine_options_usage(command, "more than %d views", SUPINE_VIEWS_MAX);
    }
    wanted->view[wanted->view_count++] =
        view == SUPINE_VIEW_COUNT ? SUPINE_VIEW_LEFT : (supine_view)view;
    if (at[length] == '\0') {
      return SUPINE_EXIT_OK;
    }
    at += length + 1;
  }
}

static int read_colour(const char *command, const char *text, void *field) {
  request *wanted = field;
  (void)command;
  static const char difference[] = "difference:";
  if (strcmp(text, "displacement") == 0) {
    wanted->reference = NULL;
    return SUPINE_EXIT_OK;
  }
  if (strncmp(text, difference, strlen(difference)) == 0) {
    wanted->reference = text + strlen(difference);
    return SUPINE_EXIT_OK;
  }
  return SUPINE_OPTION_MISFIT;
}

static const char *const themes[] = {"light", "dark", NULL};

static const supine_option table[] = {
    {"posture", 0, "LIST", "up to 8; --postures is the same", SUPINE_FILLS(request, postures),
     .alias = "postures"},
    {.table = supine_options_volume, SUPINE_FILLS(request, volume)},
    {"scale", 0, "MM", "largest displacement in each posture instead: for open surfaces",
     SUPINE_FILLS(request, scale), SUPINE_ABOVE_ZERO, .wants = "millimetres above 0",
     .rivals = "breath"},
    {"output", 'o', "FILE", ".png", SUPINE_FILLS(request, output), .required = true,
     .file = SUPINE_FILE_OUT, .endings = ".png"},
    {"size", 0, "WxH", "pixels; default: as the postures and views want", .read = read_size,
     .wants = "WIDTHxHEIGHT, up to 16384 each"},
    {"view", 0, "LIST",
     "anterior (default), posterior, left, right, lateral (from the left), head, feet, oblique; "
     "several come below each other",
     .read = read_views},
    {"colour", 0, "WHAT", "displacement (default: from rest), or difference:POSTURE",
     .read = read_colour, .wants = "displacement or difference:POSTURE", .alias = "color"},
    {"largest", 0, "MM",
     "end of the colour bar; default: what 95 % of the surface does not exceed, rounded up; a "
     "pointed end says that some values lie beyond",
     SUPINE_FILLS(request, largest), SUPINE_ABOVE_ZERO, .wants = "millimetres above 0"},
    {"inside", 0, "FILE",
     "what is inside, of 'supine embed' from the same basis, seen through the lungs: points and "
     "meshes by name, with how far they have moved",
     SUPINE_FILLS(request, inside), .file = SUPINE_FILE_IN},
    {"theme", 0, "light|dark", "of the page", SUPINE_FILLS(request, theme), .choices = themes,
     .standard = "light"},
    {"title", 0, "TEXT", "a heading", SUPINE_FILLS(request, title)},
    {.help = SUPINE_POSTURE_LIST_HELP},
    {.name = NULL}};

/* The options make sense together; then the postures are read. */
static int check(const request *wanted, supine_posture_list *postures,
                 supine_posture_list *reference) {
  if (wanted->postures == NULL) {
    return supine_options_usage(name, "which posture? Give --posture supine, for example");
  }
  int result = supine_options_posture_list_parse(name, wanted->postures, postures);
  if (result == SUPINE_EXIT_OK && wanted->reference != NULL) {
    result = supine_options_posture_list_parse(name, wanted->reference, reference);
  }
  if (result != SUPINE_EXIT_OK) {
    return result;
  }
  if (reference->count > 1) {
    return supine_options_usage(name, "--colour difference: takes one posture");
  }
  return postures->count <= SUPINE_PANELS_MAX
             ? SUPINE_EXIT_OK
             : supine_options_usage(name, "at most %d postures in one picture", SUPINE_PANELS_MAX);
}

static void begin(void *chosen) {
  request *wanted = chosen;
  wanted->view[0] = SUPINE_VIEW_ANTERIOR;
  wanted->view_count = 1;
}

static int run(void *chosen, const supine_arguments *given) {
  const request *wanted = chosen;
  supine_posture_list postures = {.count = 0};
  supine_posture_list reference = {.count = 0};
  supine_basis *basis = NULL;
  supine_error error;
  int result = check(wanted, &postures, &reference);
  if (result != SUPINE_EXIT_OK) {
    return result;
  }
  if (supine_basis_open(given->operand[0], &basis, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  result = render(basis, wanted, &postures, reference.count == 1 ? &reference.item[0] : NULL);
  supine_basis_close(basis);
  return result;
}

const supine_command supine_command_render = {
    name,
    "draw the lungs: postures side by side, as PNG",
    .usage = "BASIS --posture NAME[,NAME...] -o lung.png [OPTIONS]",
    .about =
        "Draws the lungs, off screen, in each posture side by side: coloured by displacement, "
        "with lines at the ticks of the colour bar and a ball that shows the body's axes (left, "
        "right, anterior, posterior, head, feet) and where gravity points (the arrow; a cross "
        "points away from you).",
    .options = table,
    .notes =
        "Examples:\n"
        "  supine render lungs.safetensors --posture supine,prone,left,right -o "
        "postures.png\n"
        "  supine render lungs.safetensors --inside nodules.safetensors --posture supine,prone "
        "\\\n"
        "      -o inside.png\n"
        "  supine render lungs.safetensors --posture prone --colour difference:supine \\\n"
        "      --view anterior,lateral,posterior --theme dark -o prone.png",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .begin = begin,
    .run = run};
