/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine render: a picture of the lungs in one or several postures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/output.h"
#include <supine/compare.h>

#include "runtime/options/basis_input.h"
#include "runtime/options/posture_list.h"
#include "runtime/render/render.h"

static const char name[] = "render";

static const char help[] =
    "Usage: supine render BASIS --posture NAME[,NAME...] -o lung.png [OPTIONS]\n"
    "\n"
    "Draws the lungs, off screen, in each posture side by side: coloured by displacement, with "
    "lines\n"
    "at the ticks of the colour bar and a ball that shows the body's axes (left, right, anterior,\n"
    "posterior, head, feet) and where gravity points (the arrow; a cross points away from you).\n"
    "\n"
    "  --posture LIST       up to 8; --postures is the same\n"
    "  --volume ML          air above the resting volume, default 500; or left=ML,right=ML\n"
    "  --scale MM           largest displacement in each posture instead: for open surfaces\n"
    "  -o, --output FILE    .png\n"
    "  --size WxH           pixels; default: as the postures and views want\n"
    "  --view LIST          anterior (default), posterior, left, right, lateral (from the left),\n"
    "                       head, feet, oblique; several come below each other\n"
    "  --colour WHAT        displacement (default: from rest), or difference:POSTURE\n"
    "  --largest MM         end of the colour bar; default: what 95 % of the surface does not "
    "exceed,\n"
    "                       rounded up; a pointed end says that some values lie beyond\n"
    "  --theme light|dark   default light\n"
    "  --title TEXT         a heading\n"
    "\n";

static const char examples[] =
    "\n"
    "Examples:\n"
    "  supine render lungs.safetensors --posture supine,prone,left,right -o postures.png\n"
    "  supine render lungs.safetensors --posture prone --colour difference:supine \\\n"
    "      --view anterior,lateral,posterior --theme dark -o prone.png\n";

typedef struct request {
  const char *output;
  const char *postures;
  const char *volume;
  const char *reference; /* posture that colours are the difference from, or NULL */
  const char *title;
  double scale; /* mm, or 0: by volume */
  double largest;
  size_t width, height;
  supine_view view[SUPINE_VIEWS_MAX];
  size_t view_count;
  bool dark;
} request;

/* One posture, ready to be drawn. */
typedef struct state {
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  float *value; /* [N] */
  char subtitle[96];
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
    return supine_options_basis_volume_scales(basis, name, found->weights, wanted->volume,
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
    used = (size_t)snprintf(shown->subtitle, sizeof shown->subtitle, "%+.0f mL, ", gain);
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

static int render(const supine_basis *basis, const request *wanted,
                  const supine_posture_list *postures, const supine_posture_item *reference) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const size_t count = postures->count;
  supine_compare *compare = NULL;
  supine_renderer *renderer = NULL;
  supine_panel panel[SUPINE_PANELS_MAX];
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  double p95 = 0.0;
  double largest = 0.0;
  char label[128];
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
    find_value(basis, compare, reference != NULL ? &states[count] : NULL, &states[i], &p95,
               &largest);
    panel[i] = (supine_panel){.title = postures->item[i].name,
                              .subtitle = states[i].subtitle,
                              .weights = states[i].weights,
                              .scales = states[i].scales,
                              .value = states[i].value};
    memcpy(panel[i].gravity, postures->item[i].gravity, sizeof panel[i].gravity);
  }
  (void)snprintf(label, sizeof label, "%s%s, mm",
                 reference != NULL ? "difference from " : "displacement from rest",
                 reference != NULL ? reference->name : "");
  supine_picture picture = {.panel = panel,
                            .panel_count = count,
                            .view = wanted->view,
                            .view_count = wanted->view_count,
                            .heading = wanted->title,
                            .bar_label = label,
                            .largest = wanted->largest > 0.0 ? wanted->largest
                                                             : supine_render_bar_end(p95),
                            .dark = wanted->dark};
  picture.beyond = largest > picture.largest;
  choose_size(wanted, &picture);
  result = write_picture(wanted, renderer, &picture);
cleanup:
  supine_render_destroy(renderer);
  supine_compare_destroy(compare);
  free(states);
  free(values);
  return result;
}

static int take_size(const char *text, request *wanted) {
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
  return supine_options_usage(name, "--size takes WIDTHxHEIGHT, up to 16384 each, not '%s'", text);
}

static int take_views(const char *text, request *wanted) {
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
      return supine_options_usage(name, "no view '%s'; did you mean '%s'?", word,
                                  nearest != NULL ? nearest : "anterior");
    }
    if (wanted->view_count == SUPINE_VIEWS_MAX) {
      return supine_options_usage(name, "more than %d views", SUPINE_VIEWS_MAX);
    }
    wanted->view[wanted->view_count++] =
        view == SUPINE_VIEW_COUNT ? SUPINE_VIEW_LEFT : (supine_view)view;
    if (at[length] == '\0') {
      return SUPINE_EXIT_OK;
    }
    at += length + 1;
  }
}

static int take_colour(const char *text, request *wanted) {
  static const char difference[] = "difference:";
  if (strcmp(text, "displacement") == 0) {
    wanted->reference = NULL;
    return SUPINE_EXIT_OK;
  }
  if (strncmp(text, difference, strlen(difference)) == 0) {
    wanted->reference = text + strlen(difference);
    return SUPINE_EXIT_OK;
  }
  return supine_options_usage(name, "--colour takes displacement or difference:POSTURE, not '%s'",
                              text);
}

static int take_theme(const char *text, request *wanted) {
  wanted->dark = strcmp(text, "dark") == 0;
  return wanted->dark || strcmp(text, "light") == 0
             ? SUPINE_EXIT_OK
             : supine_options_usage(name, "--theme takes light or dark, not '%s'", text);
}

static int take_positive(const char *option, const char *text, double *value) {
  return supine_options_parse_number(text, value) && *value > 0.0
             ? SUPINE_EXIT_OK
             : supine_options_usage(name, "--%s takes millimetres above 0, not '%s'", option, text);
}

static bool ends_in_png(const char *path) {
  const size_t length = strlen(path);
  return length > 4 && strcmp(path + length - 4, ".png") == 0;
}

/* The options make sense together; then the postures are read. */
static int check(const request *wanted, int operands, supine_posture_list *postures,
                 supine_posture_list *reference) {
  if (operands != 1) {
    return supine_options_usage(name, "name one basis file (made by 'supine precompute')");
  }
  if (wanted->output == NULL || !ends_in_png(wanted->output)) {
    return supine_options_usage(name, "give -o FILE, with a name that ends in .png");
  }
  if (wanted->postures == NULL) {
    return supine_options_usage(name, "which posture? Give --posture supine, for example");
  }
  if (wanted->volume != NULL && wanted->scale > 0.0) {
    return supine_options_usage(name, "give --volume or --scale, not both");
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

int supine_command_render(int argc, char **argv) {
  enum { POSTURE = 256, VOLUME, SCALE, SIZE, VIEW, COLOUR, LARGEST, THEME, TITLE };
  static const struct option options[] = {{"posture", required_argument, NULL, POSTURE},
                                          {"postures", required_argument, NULL, POSTURE},
                                          {"volume", required_argument, NULL, VOLUME},
                                          {"scale", required_argument, NULL, SCALE},
                                          {"output", required_argument, NULL, 'o'},
                                          {"size", required_argument, NULL, SIZE},
                                          {"view", required_argument, NULL, VIEW},
                                          {"colour", required_argument, NULL, COLOUR},
                                          {"color", required_argument, NULL, COLOUR},
                                          {"largest", required_argument, NULL, LARGEST},
                                          {"theme", required_argument, NULL, THEME},
                                          {"title", required_argument, NULL, TITLE},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
  request wanted = {.view = {SUPINE_VIEW_ANTERIOR}, .view_count = 1};
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":o:h", options, NULL)) != -1) {
    int result = SUPINE_EXIT_OK;
    switch (option) {
    case POSTURE:
      wanted.postures = optarg;
      break;
    case VOLUME:
      wanted.volume = optarg;
      break;
    case SCALE:
      result = take_positive("scale", optarg, &wanted.scale);
      break;
    case 'o':
      wanted.output = optarg;
      break;
    case SIZE:
      result = take_size(optarg, &wanted);
      break;
    case VIEW:
      result = take_views(optarg, &wanted);
      break;
    case COLOUR:
      result = take_colour(optarg, &wanted);
      break;
    case LARGEST:
      result = take_positive("largest", optarg, &wanted.largest);
      break;
    case THEME:
      result = take_theme(optarg, &wanted);
      break;
    case TITLE:
      wanted.title = optarg;
      break;
    case 'h':
      (void)fputs(help, stdout);
      (void)fputs(supine_options_posture_list_help, stdout);
      (void)fputs(examples, stdout);
      return supine_options_finish(name);
    default:
      return supine_options_bad_option(name, options, option, argv);
    }
    if (result != SUPINE_EXIT_OK) {
      return result;
    }
  }
  supine_posture_list postures = {.count = 0};
  supine_posture_list reference = {.count = 0};
  int result = check(&wanted, argc - optind, &postures, &reference);
  if (result != SUPINE_EXIT_OK) {
    return result;
  }
  supine_basis *basis = NULL;
  supine_error error;
  if (supine_basis_open(argv[optind], &basis, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  result = render(basis, &wanted, &postures, reference.count == 1 ? &reference.item[0] : NULL);
  supine_basis_close(basis);
  return result;
}
