/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine precompute: make a basis file from lung surfaces or a label map. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/text.h"
#include "base/vec3.h"
#include "precompute/library.h"
#include "precompute/names.h"
#include "program/command/list.h"
#include "program/options/basis_input.h"
#include "program/options/facts.h"
#include "program/options/model_options.h"
#include "program/options/surface_options.h"

static const char name[] = "precompute";

typedef struct request {
  supine_model_options model;
  const char *path; /* of the basis file */
  bool has_band, has_modes;
  size_t band, modes; /* 0 modes: harmonics */
  size_t directions;  /* number of directions of gravity to print; 0 to make a basis */
  size_t volumes;     /* number of volumes to print for each direction; 0 for none */
} request;

static supine_status read_modes(const char *text, void *field, supine_error *error) {
  size_t *modes = field;
  (void)error;
  if (strcmp(text, "harmonics") == 0) {
    *modes = 0;
    return SUPINE_OK;
  }
  return supine_options_fits(supine_options_parse_count(text, modes) && *modes >= 1 &&
                             *modes <= SUPINE_MODES_MADE_MAX);
}

#define FILLS(member) SUPINE_FILLS(request, member)

static const supine_option table[] = {
    {"output", 'o', "FILE", "basis file to write (.safetensors)", FILLS(path), .required = true,
     .file = SUPINE_FILE_OUT},
    {"band", 0, "L", "highest band L of the spherical harmonics, 0 to 64", FILLS(band),
     SUPINE_SAYS_GIVEN(request, has_band), .standard = "23", .range = {0.0, SUPINE_SH_BAND_MAX},
     .more = true},
    {"modes", 0, "K|harmonics",
     "basis functions to store\nharmonics: all (L+1)^2 spherical harmonics up to --band L, as in "
     "Santhanam 2008 with --band 3\nK: the K functions (modes) that describe the displacement "
     "best, or fewer if fewer suffice. More modes are more accurate, but each costs a "
     "multiplication per vertex at run time",
     FILLS(modes), SUPINE_SAYS_GIVEN(request, has_modes), .read = read_modes, .standard = "16",
     .wants = "1 to 64 or 'harmonics'", .more = true},
    {"held-out", 0, "N",
     "number of held-out directions in which the error is measured; default 1000; fewer, but at "
     "least 100, for more than 20000 vertices",
     FILLS(model.precompute.modes.held_out), .range = {1.0, 100000.0}, .more = true},
    {"without-normals", 0, NULL,
     "leave out the normals: 65 bytes a vertex for 95, and programs compute them from the "
     "triangles",
     FILLS(model.precompute.modes.without_normals), .more = true},
    {"patient", 0, "FILE",
     "model of the patient's motion, made by 'supine fit', to use instead of the built-in law",
     FILLS(model.precompute.patient), .file = SUPINE_FILE_IN, .rivals = "directions",
     .partners = "output band modes held-out without-normals axes units midline labels edge close "
                 "surfaces-out "
                 "scanned resting full height sex expandability lesion lung"},
    {.help = "Displacements from another simulator, instead of the built-in physics:"},
    {"fields", 0, "FILE",
     "safetensors file with three tensors: points [P,3], the positions of P points; gravity [M,3], "
     "the directions of M runs; and displacement [M,P,3], the displacement of each point in each "
     "run. With a fourth tensor, run [M], each row of displacement belongs to the row of gravity "
     "with this number, or whose fourth column is this number. All are in the axes and unit of "
     "MESH. Each vertex of MESH takes the displacement of the point at its position, so that the "
     "points may have any order and may include inner nodes of a volume mesh.\nRuns of one "
     "direction at several volumes: the basis has gravity and volume, and takes any volume between "
     "the smallest and the largest that were simulated. One run for each direction: it has gravity "
     "alone, no volumes and no breaths. Without --band and --modes, cross-validation chooses both",
     FILLS(model.precompute.fields), .file = SUPINE_FILE_IN, .rivals = "directions",
     .partners = "output band modes storage without-normals axes units midline labels edge close "
                 "surfaces-out scanned resting full"},
    {"storage", 0, "best|modes|clusters",
     "how the displacements of --fields are stored\nmodes: a vector for each mode and vertex, "
     "which costs 3 K + 3 multiplications a vertex\nclusters: vertices that move alike share "
     "vectors, which costs 15 multiplications and 15 additions a vertex, whatever K\nbest: "
     "clusters, if they raise the error by half at most",
     .offset = offsetof(request, model.precompute.modes.storage), .kind = SUPINE_OPTION_CHOICE,
     .size = sizeof(supine_precompute_storage), .choices = supine_precompute_storages,
     .standard = "best",
     .partners = "output fields band modes without-normals axes units midline labels edge close "
                 "surfaces-out scanned resting full",
     .more = true},
    {"directions", 0, "N",
     "only print N directions of gravity that cover the sphere evenly, as CSV, to simulate. Their "
     "order is shuffled, so that results in another order are noticed",
     FILLS(directions), .range = {2.0, 1000.0}, .partners = "volumes", .alone = true},
    {"volumes", 0, "N",
     "with --directions: print N rows for each direction, with a column 'fill' from 0, the "
     "smallest volume to simulate, to 1, the largest, and a column 'run', the number of the row. "
     "Six suit most tissue",
     FILLS(volumes), .range = {2.0, 100.0}, .partners = "directions"},
    {.table = supine_options_model, FILLS(model)},
    {.name = NULL}};

static const char *plural(size_t count) {
  return count == 1 ? "" : "s";
}

/* Print what the basis assumes and was given, the options that change it, and the boxes of the
 * scanned lungs. */
static void print_facts(const char *options, const supine_prepared *prepared,
                        const supine_basis *basis) {
  supine_options_line("%s\nassumed and given (%s change it):\n", prepared->source.summary, options);
  supine_options_facts_print(basis);
}

static void print_errors(const supine_precompute_report *report, const char *at,
                         const char *state) {
  supine_options_line("  %.3g %% RMS, %.3g %% 95th percentile, %.3g %% largest, of the RMS "
                      "displacement\n"
                      "  %s mm RMS, %s mm 95th percentile, %s mm largest%s%s\n",
                      100.0 * report->relative.rms, 100.0 * report->relative.p95,
                      100.0 * report->relative.largest, supine_text_distance(report->mm.rms).text,
                      supine_text_distance(report->mm.p95).text,
                      supine_text_distance(report->mm.largest).text, at, state);
  if (report->turning_rms > 0.0) {
    supine_options_line("  %.3g %% RMS, of the part of the displacement that depends on gravity\n",
                        100.0 * report->turning_rms);
  }
}

static json_t *errors_json(const supine_precompute_errors *errors, double factor) {
  return json_pack("{s:f, s:f, s:f}", "rms", factor * errors->rms, "p95", factor * errors->p95,
                   "largest", factor * errors->largest);
}

/* Add what --json prints of the basis: its size, what it assumes, and its errors. */
static void add_report(const request *wanted, const supine_basis *basis,
                       const supine_precompute_report *report) {
  SUPINE_ADD_RESULT(json_pack(
      "{s:o, s:I, s:I, s:I, s:I, s:o, s:I, s:o, s:o}", "file",
      supine_options_json_text(wanted->path), "lungs", (json_int_t)report->lung_count, "vertices",
      (json_int_t)report->vertex_count, "band", (json_int_t)report->band, "modes",
      (json_int_t)report->mode_count, "facts", supine_options_facts(basis, false), "directions",
      (json_int_t)report->direction_count, "error_percent", errors_json(&report->relative, 100.0),
      "error_mm", errors_json(&report->mm, 1.0)));
  if (report->volume_count > 0) {
    SUPINE_ADD_RESULT(json_pack("{s:I, s:I}", "volumes", (json_int_t)report->volume_count,
                                "clusters", (json_int_t)report->cluster_count));
  }
}

static void print_report(const request *wanted, const supine_prepared *prepared,
                         const supine_basis *basis, const supine_precompute_report *report) {
  char state[64];
  supine_precompute_report_state(report, state, sizeof state);
  supine_options_line("%s: %s, %zu vertices, band %zu, %zu %s%s\n", wanted->path,
                      report->lung_count == 2 ? "two lungs" : "one lung", report->vertex_count,
                      report->band, report->mode_count,
                      wanted->model.precompute.modes.harmonics ? "harmonic" : "mode",
                      plural(report->mode_count));
  print_facts("--axes, --units, --scanned, --law and --resting", prepared, basis);
  supine_options_line("error against the full solve, on %zu held-out direction%s:\n",
                      report->direction_count, plural(report->direction_count));
  print_errors(report, ", at ", state);
}

/* Return a number that the basis states about itself. */
static double stated_number(const supine_basis *basis, const char *key) {
  double value = 0.0;
  (void)supine_options_parse_number(supine_basis_metadata(basis, key), &value);
  return value;
}

/* Print what the runs that were left out say of other states: over all directions of gravity, and
 * where it is largest: in the direction farthest from those of the runs, at one volume. */
static void print_between(const supine_basis *basis) {
  supine_options_line("states between the runs: %.3g %%, %s mm RMS over all directions of gravity; "
                      "largest in a\n"
                      "gap between the directions: %.3g %%, %s mm RMS\n",
                      stated_number(basis, "error_between_percent"),
                      supine_text_distance(stated_number(basis, "error_between_mm")).text,
                      stated_number(basis, "error_gap_percent"),
                      supine_text_distance(stated_number(basis, "error_gap_mm")).text);
}

/* Print the highest band (degree) of spherical harmonics that the given directions of gravity
 * determine, and the leave-one-out error of each band. */
static void print_fit(const request *wanted, const supine_prepared *prepared,
                      const supine_basis *basis, const supine_precompute_report *report) {
  const size_t highest = report->band_count - 1;
  supine_options_line("%s: fields of gravity", wanted->path);
  if (report->volume_count > 1) {
    supine_options_line(" and volume");
  }
  supine_options_line(": %zu vertices, %zu directions", report->vertex_count,
                      report->direction_count);
  if (report->volume_count > 1) {
    supine_options_line(", %zu volumes each", report->volume_count);
  }
  supine_options_line(", band %zu", report->band);
  if (report->volume_count > 1) {
    supine_options_line(", order %zu of volume", report->order);
  }
  supine_options_line(", %zu mode%s", report->mode_count, plural(report->mode_count));
  if (report->cluster_count > 0) {
    supine_options_line(", %zu clusters", report->cluster_count);
  }
  supine_options_line("\n");
  print_facts("--axes, --units and --scanned", prepared, basis);
  const double *nearest = report->nearest_supine;
  supine_options_line(
      "displacement: %s mm RMS; with gravity along %.2f,%.2f,%.2f (LPS), nearest to supine, %s mm\n"
      "%s gravity on average\n",
      supine_text_distance(report->displacement).text, nearest[0], nearest[1], nearest[2],
      supine_text_distance(fabs(report->along_gravity)).text,
      report->along_gravity < 0.0 ? "against" : "along");
  supine_options_line(
      "the directions determine bands up to %zu (%zu harmonic%s); leave-one-out error:\n", highest,
      (highest + 1) * (highest + 1), highest > 0 ? "s" : "");
  for (size_t band = 0; band <= highest; ++band) {
    supine_options_line("  band %-2zu  %8.3g %%%s\n", band, 100.0 * report->band_error[band],
                        band == report->band ? "  <- chosen" : "");
  }
  if (report->band == highest && highest + 1 < SUPINE_PRECOMPUTE_BANDS_MAX) {
    supine_options_line(
        "the error is still falling at the highest band, so detail beyond band %zu is "
        "missing: about\n%zu evenly spread directions would determine band %zu\n",
        highest, 2 * (highest + 2) * (highest + 2), highest + 1);
  }
  supine_options_line("error of the basis, each direction%s predicted from the others:\n",
                      report->volume_count > 2 ? " and each inner volume" : "");
  print_errors(report, "", "");
  print_between(basis);
  if (report->six_volumes > 0.0) {
    supine_options_line(
        "between the volumes: about %.2g %% RMS; six volumes for each direction would "
        "make it about %.2g %%\n",
        100.0 * report->volume_error, 100.0 * report->six_volumes);
  }
  if (report->extrapolated > 0.0) {
    supine_options_line("the smallest and the largest volumes, predicted from the others (an "
                        "extrapolation): %.3g %% RMS\n",
                        100.0 * report->extrapolated);
  }
}

/* Shuffle the numbers 0 to count - 1, always in the same way (Fisher and Yates). In a sorted plan,
 * results that are shifted by some rows are turned by almost the same rotation in each row, which
 * looks like another tissue. */
static void shuffle(size_t count, size_t *order) {
  uint64_t state = 1;
  for (size_t i = 0; i < count; ++i) {
    state = state * 6364136223846793005U + 1442695040888963407U;
    const size_t at = (size_t)((state >> 33) % (i + 1));
    order[i] = order[at];
    order[at] = i;
  }
}

/* Print a plan of simulations: directions of gravity and, if `volumes` is not 0, parts of the way
 * from the smallest to the largest volume, and the number of the run. */
static supine_status print_plan(size_t directions, size_t volumes, supine_error *error) {
  const size_t each = volumes > 0 ? volumes : 1;
  SUPINE_ARENA arena = {0};
  size_t *order = supine_arena_take(&arena, directions * each, sizeof *order);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu runs", directions * each));
  shuffle(directions * each, order);
  json_t *plan = json_array();
  for (size_t run = 0; run < directions * each; ++run) {
    double g[3];
    supine_spiral((double)(order[run] / each), (double)directions, 0.0, g);
    json_t *row = json_pack("{s:f, s:f, s:f}", "x", g[0], "y", g[1], "z", g[2]);
    if (volumes > 0) {
      const double fill = (double)(order[run] % each) / (double)(volumes - 1);
      (void)json_object_update_new(row,
                                   json_pack("{s:f, s:I}", "fill", fill, "run", (json_int_t)run));
    }
    (void)json_array_append_new(plan, row);
  }
  supine_options_print_rows(plan, 9);
  return SUPINE_OK;
}

static void free_bytes(supine_bytes *bytes) {
  free(bytes->data);
}

/* Make the basis of the lungs, open it, and write its file. */
static supine_status write_basis(request *wanted, const supine_prepared *prepared,
                                 supine_bytes *bytes, supine_basis **basis,
                                 supine_precompute_report *report, supine_error *error) {
  supine_precompute_options *options = &wanted->model.precompute;
  supine_findings findings = {.count = 0};
  supine_progress progress = supine_options_progress_begin(name);
  options->progress = supine_options_progress_show;
  options->context = &progress;
  const supine_status status =
      supine_precompute_make(options, prepared, &findings, bytes, report, error);
  supine_options_progress_end(&progress);
  supine_options_say_findings(name, &findings);
  SUPINE_TRY(status);
  SUPINE_TRY(supine_basis_open_memory(bytes->data, bytes->size, basis, error));
  return supine_precompute_save(wanted->path, bytes, error);
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  supine_precompute_options *options = &wanted->model.precompute;
  supine_precompute_report report;
  SUPINE_FREED_BY(supine_precompute_prepared_free) supine_prepared prepared = {.fit = ""};
  if (wanted->directions > 0) {
    return print_plan(wanted->directions, wanted->volumes, error);
  }
  SUPINE_REFUSE_IF(supine_mesh_save_supports(wanted->path), error, SUPINE_ERROR_ARGUMENT,
                   "%s: this is the name of a mesh: give a name that ends in .safetensors",
                   wanted->path);
  options->made_by = given->made_by;
  options->modes.has_band = wanted->has_band;
  if (wanted->has_band) {
    options->modes.band = wanted->band;
  }
  if (wanted->has_modes) {
    options->modes.count = wanted->modes;
    options->modes.harmonics = wanted->modes == 0;
  }
  SUPINE_TRY(supine_options_prepare(name, &wanted->model, given, &prepared, error));
  if (prepared.patient != NULL) {
    supine_options_line("%s\n", prepared.fit);
  }
  SUPINE_FREED_BY(free_bytes) supine_bytes bytes = {.data = NULL};
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *basis = NULL;
  SUPINE_TRY(write_basis(wanted, &prepared, &bytes, &basis, &report, error));
  if (options->fields != NULL) {
    print_fit(wanted, &prepared, basis, &report);
  } else {
    print_report(wanted, &prepared, basis, &report);
  }
  add_report(wanted, basis, &report);
  return SUPINE_OK;
}

const supine_command supine_command_precompute = {
    name,
    "solve the physics once, and write a basis file for any posture",
    .usage = "MESH... -o FILE [OPTIONS]\n"
             "LABELS... -o FILE [OPTIONS]\n"
             "--directions N [--volumes N]",
    .about = "Solves the physics of one or two lungs for all directions of gravity, and writes a "
             "basis file. From this file, 'supine export' makes a page, and 'supine deform' and "
             "the run-time library compute deformed lungs in real time. MESH is any surface that "
             "assimp reads (PLY, OBJ, STL, OFF, ...), with both lungs in one file or a file for "
             "each; LABELS is the label map of a segmentation (NRRD, NIfTI, MetaImage, or DICOM "
             "SEG, for which dcm2json of DCMTK must be installed). Surfaces must be closed.",
    .options = table,
    .notes = "Examples:\n"
             "  supine precompute left.ply right.ply -o lungs.safetensors\n"
             "  supine precompute lungs.nii.gz -o lungs.safetensors\n"
             "  supine precompute lungs.stl --axes RAS --units cm -o lungs.safetensors",
    SUPINE_SURFACES,
    .request_size = sizeof(request),
    .uses_blas = true,
    .run = run};
