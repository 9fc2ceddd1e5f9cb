/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine export: a basis as a page for the browser, or as glTF morph targets. */
#include <string.h>
#include <strings.h>

#include <export.h>

#include "runtime/options/basis_input.h"

static const char name[] = "export";
static const double default_volume = 500.0; /* mL */
static const double default_largest = 10.0; /* mm */

static const char help[] =
    "Usage: supine export BASIS -o lungs.html\n"
    "       supine export BASIS -o lungs.glb [--profile NAME] [--quantise] [--animate]\n"
    "\n"
    "Writes a basis file in a form that other programs play; the ending of the name chooses it.\n"
    "\n"
    "  -o, --output FILE    .html  a page to explore the lungs in a browser: one file, no "
    "network;\n"
    "                              bases of up to 16 modes\n"
    "                       .glb   glTF 2.0 morph targets: any engine deforms the lungs\n"
    "  --volume ML          depth of the breath that is played, and up to which clamp-safe "
    "weights\n"
    "                       stay within 0 and 1; default 500\n"
    "  --scale MM           the same for an open surface, which has no volume: largest\n"
    "                       displacement when supine; default 10\n"
    "\n"
    "Of a page:\n"
    "  --title TEXT         its title; default the name of the basis file\n"
    "\n"
    "Of glTF:\n"
    "  --profile raw        a target for each mode of the basis; weights of either sign (default)\n"
    "            8          at most eight targets, for engines that promise no more: the best\n"
    "                       eight; says what they leave out\n"
    "            clamp-safe weights within 0 and 1 for every posture and every breath up to\n"
    "                       --volume, for engines that clamp them: the base is shifted and the\n"
    "                       targets are rescaled, so that rest is not at weight 0\n"
    "            8,clamp-safe   both\n"
    "  --quantise           targets as 16-bit integers (KHR_mesh_quantization): a third smaller,\n"
    "                       within a hundredth of a millimetre\n"
    "  --animate            adds an animation: the patient breathes, and turns from the back over\n"
    "                       the left side onto the belly and on\n"
    "\n"
    "In the .glb, the mesh's extras name the targets and say how their weights follow from "
    "gravity\n"
    "and volume: weight k is (s times mode k's sum over Y_lm(g), less offset k) over unit k.\n"
    "\n"
    "Examples:\n"
    "  supine export lungs.safetensors -o lungs.html\n"
    "  supine export lungs.safetensors -o lungs.glb --animate\n"
    "  supine export lungs.safetensors -o lungs.glb --profile 8,clamp-safe --volume 1000\n";

typedef struct request {
  const char *path;
  const char *title;
  double volume;
  double largest;
  bool page;
  bool glb_only; /* an option was given that a page has no use for */
  export_glb_options glb;
} request;

static bool ends_with(const char *path, const char *ending) {
  const size_t length = strlen(path);
  const size_t tail = strlen(ending);
  return length > tail && strcasecmp(path + length - tail, ending) == 0;
}

static int take_profile(const char *text, export_glb_options *glb) {
  static const char *const names[] = {"raw", "8", "clamp-safe", "8,clamp-safe"};
  enum { NAMES = sizeof names / sizeof *names };
  for (size_t i = 0; i < NAMES; ++i) {
    if (strcmp(text, names[i]) == 0) {
      glb->eight = i == 1 || i == 3;
      glb->clamp_safe = i >= 2;
      return SUPINE_EXIT_OK;
    }
  }
  const char *nearest = supine_options_suggest(text, names, NAMES);
  return supine_options_usage(name, "no profile '%s'%s%s", text,
                              nearest != NULL ? "; did you mean " : ": raw, 8 or clamp-safe",
                              nearest != NULL ? nearest : "");
}

static int take_depth(const char *option, const char *unit, const char *text, double *value) {
  if (!supine_options_parse_number(text, value) || *value <= 0) {
    return supine_options_usage(name, "--%s takes %s above 0, not '%s'", option, unit, text);
  }
  return SUPINE_EXIT_OK;
}

static int write_glb(const export_source *source, const request *wanted) {
  export_glb_report report = {0};
  supine_error error;
  if (supine_export_glb_write(wanted->path, source, &wanted->glb, &report, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  (void)printf("%s: %zu morph targets%s, %.1f MB\n", wanted->path, report.targets,
               wanted->glb.animate ? " and an animation" : "", 1e-6 * (double)report.bytes);
  if (report.targets < source->info->mode_count) {
    (void)printf("  of %zu modes: leaves out %.3g %% of the RMS displacement\n",
                 source->info->mode_count, report.loss_percent);
  }
  return supine_options_finish(name);
}

static int write_page(const export_source *source, const request *wanted, const char *basis_path) {
  supine_error error;
  const char *slash = strrchr(basis_path, '/');
  const char *title = wanted->title != NULL ? wanted->title
                      : slash != NULL       ? slash + 1
                                            : basis_path;
  if (supine_export_html_write(wanted->path, source, &wanted->glb.breath, title, &error) !=
      SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  (void)printf("%s: a page of %zu vertices; open it in any browser\n", wanted->path,
               source->info->vertex_count);
  return supine_options_finish(name);
}

static int export_basis(const char *path, request *wanted) {
  export_source source = {0};
  supine_error error;
  int result = SUPINE_EXIT_OK;
  if (supine_export_source_open(path, &source, &error) != SUPINE_OK ||
      supine_export_breath_set(&source, wanted->volume, wanted->largest, &wanted->glb.breath,
                               &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
  } else {
    result = wanted->page ? write_page(&source, wanted, path) : write_glb(&source, wanted);
  }
  supine_export_source_close(&source);
  return result;
}

enum { PROFILE = 256, QUANTISE, ANIMATE, VOLUME, SCALE, TITLE };

/* Takes one option; an exit code. */
static int take_option(request *wanted, int option, const char *value) {
  switch (option) {
  case 'o':
    wanted->path = value;
    return SUPINE_EXIT_OK;
  case TITLE:
    wanted->title = value;
    return SUPINE_EXIT_OK;
  case VOLUME:
    return take_depth("volume", "millilitres", value, &wanted->volume);
  case SCALE:
    return take_depth("scale", "millimetres", value, &wanted->largest);
  case PROFILE:
    wanted->glb_only = true;
    return take_profile(value, &wanted->glb);
  case QUANTISE:
    wanted->glb_only = wanted->glb.quantise = true;
    return SUPINE_EXIT_OK;
  default:
    wanted->glb_only = wanted->glb.animate = true;
    return SUPINE_EXIT_OK;
  }
}

int supine_command_export(int argc, char **argv) {
  static const struct option options[] = {
      {"output", required_argument, NULL, 'o'},  {"profile", required_argument, NULL, PROFILE},
      {"quantise", no_argument, NULL, QUANTISE}, {"quantize", no_argument, NULL, QUANTISE},
      {"animate", no_argument, NULL, ANIMATE},   {"volume", required_argument, NULL, VOLUME},
      {"scale", required_argument, NULL, SCALE}, {"title", required_argument, NULL, TITLE},
      {"help", no_argument, NULL, 'h'},          {NULL, 0, NULL, 0}};
  request wanted = {.volume = default_volume, .largest = default_largest};
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":o:h", options, NULL)) != -1) {
    if (option == 'h') {
      (void)fputs(help, stdout);
      return supine_options_finish(name);
    }
    if (option == '?' || option == ':') {
      return supine_options_bad_option(name, options, option, argv);
    }
    const int result = take_option(&wanted, option, optarg);
    if (result != SUPINE_EXIT_OK) {
      return result;
    }
  }
  if (argc - optind != 1) {
    return supine_options_usage(name, "name one basis file (made by 'supine precompute')");
  }
  if (wanted.path == NULL) {
    return supine_options_usage(name, "-o FILE is missing");
  }
  wanted.page = ends_with(wanted.path, ".html") || ends_with(wanted.path, ".htm");
  if (!wanted.page && !ends_with(wanted.path, ".glb")) {
    return supine_options_usage(name, "%s: the name must end in .html or .glb", wanted.path);
  }
  if (wanted.page && wanted.glb_only) {
    return supine_options_usage(name, "--profile, --quantise and --animate are for .glb");
  }
  if (!wanted.page && wanted.title != NULL) {
    return supine_options_usage(name, "--title is for .html");
  }
  return export_basis(argv[optind], &wanted);
}
