/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine compare: compare postures by displacement, and ventilation by height in each. */
#include <errno.h>
#include <string.h>

#include "sh/base/output.h"

#include "program/compare_content.h"
#include "program/options/basis_input.h"
#include "program/options/state_options.h"
#include "program/report/comparison.h"

static const char name[] = "compare";

static supine_status write_file(const char *path, const supine_comparison *comparison, bool html,
                                supine_error *error) {
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status == SUPINE_OK && html) {
    status = supine_report_html(comparison, output.file, error);
  } else if (status == SUPINE_OK) {
    supine_report_csv(comparison, output.file);
  }
  if (status == SUPINE_OK) {
    status = supine_output_commit(&output, error);
  }
  supine_output_abandon(&output);
  return status;
}

typedef struct request {
  const char *postures;
  const char *csv;
  const char *html;
  bool json;
  bool by_rms;
  supine_volume_options volume;
  supine_from from;
  double breath; /* mL */
  double rms;    /* mm */
} request;

static const supine_option table[] = {
    {"postures", 0, "LIST", "postures to compare", SUPINE_FILLS(request, postures),
     .standard = "supine,prone,left,right"},
    {.table = supine_options_volume, SUPINE_FILLS(request, volume)},
    {.table = supine_options_from, SUPINE_FILLS(request, from)},
    {"breath", 0, "ML", "tidal volume of the breath whose ventilation by height is computed",
     SUPINE_FILLS(request, breath), .standard = "500", SUPINE_ABOVE_ZERO},
    {"rms", 0, "MM",
     "root-mean-square displacement in each posture, instead of a volume: for open surfaces",
     SUPINE_FILLS(request, rms), SUPINE_SAYS_GIVEN(request, by_rms), .wants = "millimetres",
     .rivals = "breath"},
    {"json", 0, NULL, "print JSON to standard output instead of text", SUPINE_FILLS(request, json)},
    {"csv", 0, "FILE", "also write a table for spreadsheets, one number per row",
     SUPINE_FILLS(request, csv), .file = SUPINE_FILE_OUT},
    {"output", 'o', "FILE", ".html: a report of one file, with charts and pictures",
     SUPINE_FILLS(request, html), .file = SUPINE_FILE_OUT, .endings = ".html"},
    {.help = SUPINE_POSTURE_LIST_HELP},
    {.name = NULL}};

/* Write the report in every form requested. */
static supine_status write_all(const supine_comparison *comparison, const request *wanted,
                               supine_error *error) {
  supine_status status = SUPINE_OK;
  if (!wanted->json) {
    supine_report_text(comparison, stdout);
  } else if (!supine_report_json(comparison, stdout)) {
    return supine_error_set(error, SUPINE_ERROR_WRITE, "cannot print JSON: %s", strerror(errno));
  }
  if (wanted->csv != NULL) {
    status = write_file(wanted->csv, comparison, false, error);
  }
  if (status == SUPINE_OK && wanted->html != NULL) {
    status = write_file(wanted->html, comparison, true, error);
  }
  return status;
}

static supine_status compare(const char *path, const supine_basis *basis, const request *wanted,
                             supine_error *error) {
  supine_comparison comparison = {.path = path,
                                  .command = name,
                                  .allow_folds = wanted->volume.allow_folds,
                                  .basis = basis,
                                  .state = wanted->volume.state,
                                  .rms = wanted->rms,
                                  .from = wanted->from,
                                  .breath = wanted->breath};
  comparison.state.gravity[1] = 1.0;
  if (comparison.state.lung_count == 0 && comparison.state.volume.kind == SUPINE_VOLUME_DEFAULT) {
    comparison.state.volume = supine_basis_default_volume(basis);
  }
  supine_status status =
      supine_options_posture_list_parse(wanted->postures, &comparison.postures, error);
  if (status != SUPINE_OK) {
    return status;
  }
  if (!wanted->by_rms && !supine_basis_get_info(basis)->has_volume) {
    return supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                            "%s: the surface is open and encloses no volume: give --rms MM, or "
                            "close the mesh before 'supine precompute'",
                            path);
  }
  if (supine_basis_metadata(basis, "content") != NULL) { /* the basis is from 'supine embed' */
    return wanted->html != NULL || wanted->by_rms
               ? supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                  "-o and --rms are for lungs, and this basis holds structures "
                                  "inside: give the lungs' basis, or leave them out")
               : supine_command_compare_content(basis, &comparison.postures, &comparison.state,
                                                wanted->json, wanted->csv, error);
  }
  status = supine_report_find(&comparison, error);
  if (status == SUPINE_OK) {
    status = write_all(&comparison, wanted, error);
  }
  supine_report_free(&comparison);
  return status;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  supine_basis *basis = NULL;
  supine_status status =
      supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, &basis, error);
  if (status == SUPINE_OK) {
    status = compare(given->operand[0], basis, chosen, error);
  }
  supine_basis_close(basis);
  return status;
}

const supine_command supine_command_compare = {
    name,
    "compare postures: displacement, and ventilation by height",
    .usage = "BASIS [--postures LIST] [--volume VOLUME] [-o report.html] [OPTIONS]",
    .about = "Reports how far the lungs move from supine at rest to each posture and between every "
             "two, how much each lung holds, and which heights ventilate in a breath; then finds "
             "the direction of gravity farthest from supine. For "
             "structures inside ('supine embed'), reports how far and where each named part moves "
             "between every two postures.",
    .options = table,
    .notes =
        "Averages are over the surface's area; 95 % of the area moves no farther than the number "
        "under '95 %'. Ventilation by height: the lungs before a breath are cut into ten slabs of "
        "equal thickness across gravity. What the tissue of a slab gains is the volume "
        "that its part of the surface and its two cuts enclose after the breath, less that before; "
        "a cut follows its outline. The slabs' gains sum to the volume asked for; gain over volume "
        "is the regional expansion. Constant, odd and even are "
        "shares of the squared displacement over all directions: odd parts change sign with "
        "gravity, "
        "so that without an even part prone is the exact reverse of supine about their mean. "
        "Structures "
        "inside: move is the mean over a part, mm to the left, to the back and to the head; mm is "
        "its "
        "length.\n"
        "\n"
        "Examples:\n"
        "  supine compare lungs.safetensors --postures supine,prone,supine+15,0.6:0:-0.8\n"
        "  supine compare lungs.safetensors --volume rest --breath 800 -o report.html",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
