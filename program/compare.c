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

static supine_status write_html(const char *path, const supine_comparison *comparison,
                                supine_error *error) {
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status == SUPINE_OK) {
    status = supine_report_html(comparison, output.file, error);
  }
  if (status == SUPINE_OK) {
    status = supine_output_commit(&output, error);
  }
  supine_output_abandon(&output);
  return status;
}

typedef struct request {
  const char *postures;
  const char *html;
  bool json;
  supine_volume_options volume;
  supine_from from;
  double breath; /* mL */
} request;

static const supine_option table[] = {
    {"postures", 0, "LIST", "postures to compare", SUPINE_FILLS(request, postures),
     .standard = "supine,prone,left,right"},
    {.table = supine_options_volume, SUPINE_FILLS(request, volume)},
    {.table = supine_options_from, SUPINE_FILLS(request, from)},
    {"breath", 0, "ML", "tidal volume of the breath whose ventilation by height is computed",
     SUPINE_FILLS(request, breath), .standard = "500", SUPINE_ABOVE_ZERO},
    {"json", 0, NULL, "print JSON to standard output instead of text", SUPINE_FILLS(request, json)},
    {"output", 'o', "FILE", ".html: a report of one file, with charts and pictures",
     SUPINE_FILLS(request, html), .file = SUPINE_FILE_OUT, .endings = ".html"},
    {.help = SUPINE_POSTURE_LIST_HELP},
    {.name = NULL}};

static supine_status compare(const char *path, const char *made_by, const supine_basis *basis,
                             const request *wanted, supine_error *error) {
  supine_comparison comparison = {.path = path,
                                  .command = name,
                                  .made_by = made_by,
                                  .allow_folds = wanted->volume.allow_folds,
                                  .basis = basis,
                                  .state = wanted->volume.state,
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
  status = supine_options_basis_closed(basis, path, error);
  if (status != SUPINE_OK) {
    return status;
  }
  if (supine_basis_metadata(basis, "content") != NULL) { /* the basis is from 'supine embed' */
    return wanted->html != NULL
               ? supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                  "-o is for lungs, and this basis holds structures inside: give "
                                  "the lungs' basis, or leave -o out")
               : supine_command_compare_content(basis, &comparison.postures, &comparison.state,
                                                wanted->json, error);
  }
  status = supine_report_find(&comparison, error);
  if (status == SUPINE_OK) {
    if (!wanted->json) {
      supine_report_text(&comparison, stdout);
    } else if (!supine_report_json(&comparison, stdout)) {
      status =
          supine_error_set(error, SUPINE_ERROR_WRITE, "cannot print JSON: %s", strerror(errno));
    }
  }
  if (status == SUPINE_OK && wanted->html != NULL) {
    status = write_html(wanted->html, &comparison, error);
  }
  supine_report_free(&comparison);
  return status;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  supine_basis *basis = NULL;
  supine_status status =
      supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, &basis, error);
  if (status == SUPINE_OK) {
    status = compare(given->operand[0], given->made_by, basis, chosen, error);
  }
  supine_basis_close(basis);
  return status;
}

const supine_command supine_command_compare = {
    name,
    "compare postures: displacement, and ventilation by height",
    .usage = "BASIS [--postures LIST] [--volume VOLUME] [-o report.html] [OPTIONS]",
    .about = "Reports how far the lungs move from supine at rest (or from --from) to each posture, "
             "how much each lung holds, and which heights ventilate in a breath; then finds the "
             "direction of gravity farthest from supine. For structures inside ('supine embed'), "
             "reports how far and where each named part moves between every two postures.",
    .options = table,
    .notes =
        "Averages are over the surface's area; 95 % of the area moves no farther than the number "
        "under '95 %'. Ventilation by height: the lungs before a breath are cut into ten slabs of "
        "equal thickness across gravity. What the tissue of a slab gains is the volume "
        "that its part of the surface and its two cuts enclose after the breath, less that before; "
        "a cut follows its outline. The slabs' gains sum to the volume asked for; gain over volume "
        "is the regional expansion. Structures inside: move is the mean over a part, mm to the "
        "left, "
        "to the back and to the head; mm is its length.\n"
        "\n"
        "Examples:\n"
        "  supine compare lungs.safetensors --postures supine,prone,supine+15,0.6:0:-0.8\n"
        "  supine compare lungs.safetensors --volume rest --breath 800 -o report.html",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
