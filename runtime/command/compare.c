/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine compare: how far postures differ, and where the lungs ventilate in each. */
#include <string.h>

#include "sh/base/output.h"

#include "runtime/options/basis_input.h"
#include "runtime/report/comparison.h"

static const char name[] = "compare";

static const char help[] =
    "Usage: supine compare BASIS [--postures LIST] [--volume ML] [--json] [--csv FILE]\n"
    "                            [-o report.html]\n"
    "\n"
    "Says how far the lungs move in each posture and between every two, how much each lung gains,\n"
    "and which heights ventilate; then searches all directions of gravity for the two that differ\n"
    "most and for the one that is farthest from supine.\n"
    "\n"
    "  --postures LIST      default supine,prone,left,right\n"
    "  --volume ML          air above the resting volume, the same in every posture; default 500\n"
    "  --rms MM             root-mean-square displacement in every posture instead: for open\n"
    "                       surfaces, which have no volume\n"
    "  --json               the same for programs, on standard output\n"
    "  --csv FILE           the same for spreadsheets, one number a row\n"
    "  -o, --output FILE    .html: a report of one file, with charts and pictures\n"
    "\n";

static const char notes[] =
    "\n"
    "Averages are over the surface's area; 95 % of the area moves no farther than the number "
    "under\n"
    "'95 %'. Ventilation by height: the lungs at rest are cut into ten slabs of equal thickness\n"
    "across gravity. What the tissue of a slab gains is the volume that its part of the surface\n"
    "sweeps, plus what crosses its lower cut, less what crosses its upper one; a cut's motion is\n"
    "the plane fitted to its outline's. The slabs' gains sum to the volume asked for; gain over\n"
    "volume is the regional expansion. Constant, odd and even are shares of the squared\n"
    "displacement over all directions: odd parts turn over with gravity, so without an even part\n"
    "prone is the exact reverse of supine about their mean.\n"
    "\n"
    "Examples:\n"
    "  supine compare lungs.safetensors --postures supine,prone,supine+15,0.6:0:-0.8\n"
    "  supine compare lungs.safetensors --volume 800 -o report.html\n";

typedef void writer(const supine_comparison *comparison, FILE *file);

/* Writes one form to a file, whole or not at all. */
static int write_file(const char *path, const supine_comparison *comparison, writer *form) {
  supine_output output = {0};
  supine_error error;
  if (supine_output_open(path, &output, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  form(comparison, output.file);
  if (supine_output_commit(&output, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  return SUPINE_EXIT_OK;
}

typedef struct request {
  const char *postures;
  const char *csv;
  const char *html;
  bool json;
  supine_inflation inflation;
} request;

static int compare(const char *path, const supine_basis *basis, const request *wanted) {
  supine_comparison comparison = {.path = path, .basis = basis, .inflation = wanted->inflation};
  supine_error error;
  int result = supine_options_posture_list_parse(name, wanted->postures, &comparison.postures);
  if (result != SUPINE_EXIT_OK) {
    return result;
  }
  if (wanted->inflation.kind == SUPINE_INFLATION_VOLUME &&
      !supine_basis_get_info(basis)->has_volume) {
    supine_options_say(name,
                       "%s: the surface is open and encloses no volume: give --rms MM, or close "
                       "the mesh before 'supine precompute'",
                       path);
    return SUPINE_EXIT_INPUT;
  }
  if (supine_report_find(&comparison, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  if (wanted->json && !supine_report_json(&comparison, stdout)) {
    supine_options_say(name, "cannot print JSON");
    result = SUPINE_EXIT_OUTPUT;
    goto cleanup;
  }
  if (!wanted->json) {
    supine_report_text(&comparison, stdout);
  }
  result = supine_options_finish(name);
  if (result == SUPINE_EXIT_OK && wanted->csv != NULL) {
    result = write_file(wanted->csv, &comparison, supine_report_csv);
  }
  if (result == SUPINE_EXIT_OK && wanted->html != NULL) {
    result = write_file(wanted->html, &comparison, supine_report_html);
  }
cleanup:
  supine_report_free(&comparison);
  return result;
}

static bool ends_in_html(const char *path) {
  const size_t length = strlen(path);
  return length > 5 && strcmp(path + length - 5, ".html") == 0;
}

int supine_command_compare(int argc, char **argv) {
  enum { POSTURES = 256, VOLUME, RMS, JSON, CSV };
  static const struct option options[] = {{"postures", required_argument, NULL, POSTURES},
                                          {"volume", required_argument, NULL, VOLUME},
                                          {"rms", required_argument, NULL, RMS},
                                          {"json", no_argument, NULL, JSON},
                                          {"csv", required_argument, NULL, CSV},
                                          {"output", required_argument, NULL, 'o'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
  request wanted = {.postures = "supine,prone,left,right",
                    .inflation = {SUPINE_INFLATION_VOLUME, 500.0}};
  int inflations = 0;
  int option;
  opterr = 0;
  while ((option = getopt_long(argc, argv, ":o:h", options, NULL)) != -1) {
    switch (option) {
    case POSTURES:
      wanted.postures = optarg;
      break;
    case VOLUME:
    case RMS:
      ++inflations;
      wanted.inflation.kind = option == RMS ? SUPINE_INFLATION_RMS : SUPINE_INFLATION_VOLUME;
      if (!supine_options_parse_number(optarg, &wanted.inflation.amount)) {
        return supine_options_usage(name, "--%s takes %s, not '%s'",
                                    option == RMS ? "rms" : "volume",
                                    option == RMS ? "millimetres" : "millilitres", optarg);
      }
      break;
    case JSON:
      wanted.json = true;
      break;
    case CSV:
      wanted.csv = optarg;
      break;
    case 'o':
      wanted.html = optarg;
      break;
    case 'h':
      (void)fputs(help, stdout);
      (void)fputs(supine_options_posture_list_help, stdout);
      (void)fputs(notes, stdout);
      return supine_options_finish(name);
    default:
      return supine_options_bad_option(name, options, option, argv);
    }
  }
  if (argc - optind != 1) {
    return supine_options_usage(name, "name one basis file (made by 'supine precompute')");
  }
  if (inflations > 1) {
    return supine_options_usage(name, "give --volume or --rms, once");
  }
  if (wanted.html != NULL && !ends_in_html(wanted.html)) {
    return supine_options_usage(name, "%s: the report's name must end in .html", wanted.html);
  }
  supine_basis *basis = NULL;
  supine_error error;
  if (supine_basis_open(argv[optind], &basis, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  const int result = compare(argv[optind], basis, &wanted);
  supine_basis_close(basis);
  return result;
}
