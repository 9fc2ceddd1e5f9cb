/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine export: write a basis as a page for the browser, or as glTF or OpenUSD morph targets. */
#include <string.h>

#include <export.h>

#include "base/arena.h"
#include "base/output.h"
#include "base/text.h"

#include "program/command/export_still.h"
#include "program/command/list.h"
#include "program/options/basis_input.h"
#include "program/options/breath_turn.h"
#include "program/options/inside.h"
#include "program/options/state_options.h"

static const char name[] = "export";
typedef struct request {
  const char *path;
  const char *title;
  supine_from from;
  bool glb_only; /* whether an option was given that applies to .glb files only */
  bool breathes; /* whether --breath was given */
  bool allow_folds;
  const char *inside;
  size_t simplify; /* 0 to keep all vertices */
  export_glb_options glb;
} request;

static const supine_option table[] = {
    {"output", 'o', "FILE",
     ".html: a page to explore the lungs in a browser, in one file that needs no network. The "
     "basis may have up to 128 modes\n.glb: glTF 2.0 morph targets, with which any engine deforms "
     "the lungs\n.usda: an OpenUSD text file with the same targets as blend shapes, and time "
     "samples of breaths during a full turn; about 5000 vertices, if --simplify gives no other "
     "number",
     SUPINE_FILLS(request, path), .required = true, .file = SUPINE_FILE_OUT,
     .endings = ".html, .glb or .usda"},
    {"breath", 0, "VOLUME",
     "tidal volume of the breath shown. Up to this volume, the weights of morph targets stay "
     "between 0 and 1",
     SUPINE_FILLS(request, glb.breath), .standard = "500mL", SUPINE_BREATH,
     SUPINE_SAYS_GIVEN(request, breathes)},
    {"simplify", 0, "N",
     "keep about N vertices, each with its own displacement, and span new triangles between them, "
     "for a smaller and faster file; the output says how far the new surface is from the whole one",
     SUPINE_FILLS(request, simplify), .range = {8, UINT32_MAX}},
    {.table = supine_options_folds, SUPINE_FILLS(request, allow_folds)},
    {.help = "For a page:"},
    {"inside", 0, "FILE",
     "structures made by 'supine embed' from the same basis, shown inside transparent lungs; the "
     "page shows the name and displacement of each part at the pointer and in a table",
     SUPINE_FILLS(request, inside), .file = SUPINE_FILE_IN},
    {"title", 0, "TEXT", "title of the page; default the name of the basis file",
     SUPINE_FILLS(request, title)},
    {.table = supine_options_from, SUPINE_FILLS(request, from)},
    {.help = "For glTF:"},
    {"plain", 0, NULL,
     "write float32 without compression, for engines that lack EXT_meshopt_compression or "
     "KHR_mesh_quantization. three.js reads the compressed file; model-viewer refuses it unless "
     "its meshoptDecoderLocation is set",
     SUPINE_FILLS(request, glb.plain), SUPINE_SAYS_GIVEN(request, glb_only)},
    {"animate", 0, NULL,
     "add animations of breathing: one while gravity turns from supine over the left side to prone "
     "and back over the right side, and one in each lying posture",
     SUPINE_FILLS(request, glb.animate), SUPINE_SAYS_GIVEN(request, glb_only)},
    {.name = NULL}};

/* Print how far a simplified surface is from the whole one. */
static void print_simplified(const supine_basis *basis, const export_written *written) {
  supine_options_line("simplified from %zu to %zu vertices: %.3f mm RMS and %.2f mm at most from "
                      "the whole surface\n",
                      supine_basis_get_info(basis)->vertex_count, written->vertices, written->rms,
                      written->largest);
  SUPINE_ADD_RESULT(json_pack("{s:{s:I, s:f, s:f}}", "simplified", "vertices",
                              (json_int_t)written->vertices, "rms_mm", written->rms, "largest_mm",
                              written->largest));
}

/* Write a model for engines, and print what it holds. */
static supine_status write_model(const supine_basis *basis, const request *wanted,
                                 supine_error *error) {
  const bool usd = supine_text_ends_in(wanted->path, ".usda");
  export_written written;
  const char *holds = wanted->glb.animate ? "morph targets and animations" : "morph targets";
  const char *after = "";
  if (usd) {
    holds = "blend shapes and an animation";
    SUPINE_TRY(supine_export_usd_write(wanted->path, basis, wanted->glb.breath, wanted->simplify,
                                       &written, error));
  } else {
    SUPINE_TRY(supine_export_glb_write(wanted->path, basis, &wanted->glb, &written, error));
    if (!wanted->glb.plain) {
      after = ", compressed; for model-viewer, set its meshoptDecoderLocation or use --plain";
    }
  }
  const size_t bytes = written.bytes;
  const size_t lungs = supine_basis_get_info(basis)->lung_count;
  const char *plural = lungs == 1 ? "" : "s";
  supine_options_line("%s: %zu lung%s with %s, ", wanted->path, lungs, plural, holds);
  if (bytes < 100000) {
    supine_options_line("%.0f kB%s\n", 1e-3 * (double)bytes, after);
  } else {
    supine_options_line("%.2f MB%s\n", 1e-6 * (double)bytes, after);
  }
  SUPINE_ADD_RESULT(json_pack("{s:o, s:I, s:I}", "file", supine_options_json_text(wanted->path),
                              "lungs", (json_int_t)lungs, "bytes", (json_int_t)bytes));
  if (written.vertices < supine_basis_get_info(basis)->vertex_count) {
    print_simplified(basis, &written);
  }
  return SUPINE_OK;
}

/* Return whether a state is the scan of a lung that the basis holds as collapsed. The page moves
 * the lungs by modes alone, so that it cannot show this state. */
static bool is_before_collapse(const supine_basis *basis,
                               const supine_options_reference_pose *state) {
  for (size_t lung = 0; lung < supine_basis_get_info(basis)->lung_count; ++lung) {
    if (state->pose.expansion[lung] != 0.0) {
      return true;
    }
  }
  return false;
}

/* Find the states from which the page measures displacements: that of --from or its default, the
 * scan, and supine at rest, each once. */
static supine_status find_references(const supine_basis *basis, const supine_from *from,
                                     supine_options_reference_pose found[3], size_t *count,
                                     supine_error *error) {
  const supine_from none = {.given = false};
  for (size_t i = 0; i < 3; ++i) {
    SUPINE_TRY(supine_options_reference(basis, name, i == 0 ? from : &none, i != 1, &found[*count],
                                        error));
    bool again = is_before_collapse(basis, &found[*count]);
    SUPINE_REFUSE_IF(again && from->given && i == 0, error, SUPINE_ERROR_UNSUPPORTED,
                     "--from: a page cannot show lungs before their collapse, as in the scan: give "
                     "another state, such as supine:rest");
    for (size_t j = 0; j < *count; ++j) {
      again = again || strcmp(found[j].name, found[*count].name) == 0;
    }
    *count += !again;
  }
  return SUPINE_OK;
}

static supine_status write_page(supine_basis *basis, const request *wanted, const char *basis_path,
                                supine_error *error) {
  supine_options_reference_pose from[3];
  char title[256];
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *inside = NULL;
  SUPINE_FREED_BY(supine_options_names_close) supine_options_names names = {0};
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  supine_options_basis_title(basis_path, title, sizeof title);
  export_written written;
  export_page page = {.breath = wanted->glb.breath,
                      .simplify = wanted->simplify,
                      .from = from,
                      .title = wanted->title != NULL ? wanted->title : title,
                      .names = &names};
  SUPINE_TRY(find_references(basis, &wanted->from, from, &page.from_count, error));
  if (wanted->inside != NULL) {
    SUPINE_TRY(supine_options_inside_open(basis, wanted->inside, &inside, &names, error));
    page.inside = inside;
  }
  const supine_still still = {.path = basis_path,
                              .basis = basis,
                              .inside_path = wanted->inside,
                              .inside = inside,
                              .names = &names,
                              .from = wanted->from,
                              .allow_folds = wanted->allow_folds};
  json_auto_t *shown = NULL;
  SUPINE_TRY(supine_command_still(&still, &shown, error));
  page.still = shown;
  SUPINE_TRY(supine_output_open(wanted->path, &output, error));
  SUPINE_TRY(supine_export_html_print(output.file, basis, &page, &written, error));
  SUPINE_TRY(supine_output_commit(&output, error));
  supine_options_line("%s: HTML page of %zu vertices", wanted->path, written.vertices);
  if (inside != NULL) {
    supine_options_line(" and %zu structure%s inside the lungs", names.count,
                        names.count == 1 ? "" : "s");
  }
  supine_options_line("; open it in any browser\n");
  SUPINE_ADD_RESULT(json_pack("{s:o, s:I, s:I}", "file", supine_options_json_text(wanted->path),
                              "vertices", (json_int_t)written.vertices, "structures",
                              (json_int_t)names.count));
  if (wanted->simplify > 0) {
    print_simplified(basis, &written);
  }
  return SUPINE_OK;
}

/* Judge the lungs at both ends of the breath that is shown, in supine posture. */
static supine_status judge_breath(const supine_basis *basis, double breath, supine_error *error) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  if (supine_basis_get_info(basis)->is_fields) {
    return SUPINE_OK; /* the simulated volumes limit the breath */
  }
  for (int end = 0; end < 2; ++end) {
    const supine_state state = supine_options_breath_state(basis, supine, end * breath);
    supine_pose pose;
    supine_error wrong;
    if (supine_options_pose(basis, name, &state, &pose, &wrong) != SUPINE_OK) {
      return supine_error_wrap(error, &wrong, "--breath: ");
    }
  }
  return SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  const char *path = given->operand[0];
  wanted->glb.simplify = wanted->simplify;
  const bool page = supine_text_ends_in(wanted->path, ".html");
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *basis = NULL;
  SUPINE_REFUSE_IF(wanted->glb_only && !supine_text_ends_in(wanted->path, ".glb"), error,
                   SUPINE_ERROR_ARGUMENT, "--plain and --animate need an output that ends in .glb");
  const char *of_page =
      wanted->title != NULL ? "--title" : NULL; /* an option that only pages take */
  if (wanted->from.given) {
    of_page = "--from";
  } else if (wanted->inside != NULL) {
    of_page = "--inside";
  }
  SUPINE_REFUSE_IF(!page && of_page != NULL, error, SUPINE_ERROR_ARGUMENT,
                   "%s needs an output that ends in .html", of_page);
  SUPINE_TRY(
      supine_options_basis_open(path, SUPINE_STORAGE_EXACT, wanted->allow_folds, &basis, error));
  SUPINE_REFUSE_IF(supine_basis_get_info(basis)->is_fields &&
                       supine_basis_get_info(basis)->order == 0 &&
                       (wanted->breathes || wanted->glb.animate),
                   error, SUPINE_ERROR_ARGUMENT,
                   "%s holds another simulator's fields of gravity, which have no breaths: leave "
                   "--breath and --animate out",
                   path);
  if (wanted->breathes) {
    SUPINE_TRY(judge_breath(basis, wanted->glb.breath, error));
  }
  return page ? write_page(basis, wanted, path, error) : write_model(basis, wanted, error);
}

const supine_command supine_command_export = {
    name,
    "write a basis as a page, or as glTF or OpenUSD morph targets",
    .usage = "BASIS -o lungs.html [OPTIONS]\nBASIS -o lungs.glb [OPTIONS]\n"
             "BASIS -o lungs.usda [OPTIONS]",
    .about =
        "Writes a page that shows, in any browser, how the lungs deform as the patient turns and "
        "breathes and, with --inside, where each target goes and how sure that is; or a glTF or "
        "OpenUSD model for engines. The ending of the output's name selects the format.",
    .options = table,
    .notes = "In a .glb file, each lung is a mesh with its own weights; the file's extras say how "
             "to compute them from gravity and volume.\n"
             "\n"
             "Examples:\n"
             "  supine export lungs.safetensors -o lungs.html\n"
             "  supine embed lungs.safetensors nodules.csv -o inside.safetensors\n"
             "  supine export lungs.safetensors --inside inside.safetensors -o lungs.html\n"
             "  supine export lungs.safetensors -o lungs.html --from scan\n"
             "  supine export lungs.safetensors -o lungs.html --simplify 5000\n"
             "  supine export lungs.safetensors -o lungs.glb --animate\n"
             "  supine export lungs.safetensors -o lungs.glb --plain --breath 1000mL",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
