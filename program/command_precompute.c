/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine precompute: make a basis file from lung surfaces or a label map. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "precompute/fields/fields.h"
#include "precompute/precompute.h"
#include "program/options/model_options.h"

static const char name[] = "precompute";

typedef struct request {
  supine_model_choice model;
  size_t band, modes, held_out;
  const char *path;
  const char *fields, *patient;
  bool has_band, has_modes;
  size_t directions; /* number of directions of gravity to print; 0 to make a basis */
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

static const supine_option table[] = {
    {"output", 'o', "FILE", "basis file to write (.safetensors)", SUPINE_FILLS(request, path),
     .required = true, .file = SUPINE_FILE_OUT},
    {"band", 0, "L", "highest band L of the spherical harmonics, 0 to 64",
     SUPINE_FILLS(request, band), SUPINE_SAYS_GIVEN(request, has_band), .standard = "23",
     .range = {0.0, SUPINE_SH_BAND_MAX}, .more = true},
    {"modes", 0, "K|harmonics",
     "basis functions to store\nharmonics: all (L+1)^2 spherical harmonics up to --band L, as in "
     "Santhanam 2008 with --band 3\nK: the K functions (modes) that describe the displacement "
     "best, or fewer if fewer suffice. More modes are more accurate, but each costs a "
     "multiplication per vertex at run time",
     SUPINE_FILLS(request, modes), SUPINE_SAYS_GIVEN(request, has_modes), .read = read_modes,
     .standard = "16", .wants = "1 to 64 or 'harmonics'", .more = true},
    {"held-out", 0, "N",
     "number of held-out directions in which the error is measured; default 1000; fewer, but at "
     "least 100, for more than 20000 vertices",
     SUPINE_FILLS(request, held_out), .range = {1.0, 100000.0}, .more = true},
    {"patient", 0, "FILE",
     "model of the patient's motion, made by 'supine fit', to use instead of the built-in law",
     SUPINE_FILLS(request, patient), .file = SUPINE_FILE_IN, .rivals = "directions",
     .partners = "output band modes held-out axes units midline labels edge close surfaces-out "
                 "scanned resting full height sex expandability lesion lung"},
    {.help = "Displacements from another simulator, instead of the built-in physics:"},
    {"fields", 0, "FILE",
     "safetensors file with three tensors: points [P,3], the positions of P points; gravity [M,3], "
     "M directions; and displacement [M,P,3], the displacement of each point for each direction. "
     "All three are in the axes and unit of MESH. Each vertex of MESH takes the displacement of "
     "the point at its position, so that the points may have any order and may include inner nodes "
     "of a volume mesh. The fields give gravity alone: the basis has no volumes and no breaths. "
     "Without --band and --modes, cross-validation chooses both",
     SUPINE_FILLS(request, fields), .file = SUPINE_FILE_IN, .rivals = "directions",
     .partners = "output band modes axes units midline labels edge close surfaces-out scanned"},
    {"directions", 0, "N",
     "only print N directions of gravity that cover the sphere evenly, as CSV, to simulate",
     SUPINE_FILLS(request, directions), .range = {2.0, 1000.0}, .partners = ""},
    {.table = supine_command_model_options, SUPINE_FILLS(request, model)},
    {.name = NULL}};

/* Fraction of turned-over triangles above which a warning is printed. */
static const double turned_over_limit = 0.01;

static const char *plural(size_t count) {
  return count == 1 ? "" : "s";
}

/* Print the assumptions, one per line, and the options that change them. */
static void print_assumed(const char *options, const char *assumed) {
  (void)printf("assumed (%s change it):\n", options);
  for (const char *item = assumed, *end; item != NULL; item = end) {
    end = strstr(item, "; ");
    (void)printf("  %.*s\n", (int)(end != NULL ? end - item : 1000), item);
    end = end != NULL ? end + 2 : NULL;
  }
}

static void report_result(const char *path, const supine_lungs *lungs,
                          const supine_precompute_options *options,
                          const supine_precompute_report *report) {
  const supine_accuracy *accuracy = &report->accuracy;
  char state[64];
  if (!options->reference->known) {
    (void)snprintf(state, sizeof state, "%g mL", accuracy->volume);
  } else if (accuracy->volume == 1.0) {
    (void)snprintf(state, sizeof state, "rest");
  } else {
    (void)snprintf(state, sizeof state, "%g of the volume change from full to rest",
                   accuracy->volume);
  }
  (void)printf("%s: %s, %zu vertices, band %zu, %zu %s%s\n", path,
               lungs->lung_count == 2 ? "two lungs" : "one lung", lungs->mesh.vertex_count,
               options->band, report->mode_count, options->modes == 0 ? "harmonic" : "mode",
               plural(report->mode_count));
  print_assumed("--axes, --units, --scanned, --law and --resting", options->assumed);
  (void)printf("error against the full solve, on %zu held-out direction%s:\n  %.3g %% RMS, %.3g %% "
               "95th percentile, %.3g %% largest, of the RMS displacement\n",
               accuracy->direction_count, plural(accuracy->direction_count),
               100.0 * accuracy->relative_rms, 100.0 * accuracy->relative_p95,
               100.0 * accuracy->relative_max);
  if (accuracy->volume > 0.0) {
    (void)printf("  %.3g mm RMS, %.3g mm 95th percentile, %.3g mm largest, at %s\n",
                 accuracy->rms_mm, accuracy->p95_mm, accuracy->max_mm, state);
  }
  if (report->turned_over > turned_over_limit) {
    (void)printf(
        "the surface folds: %.3g %% of its triangles turn over at %s in the worst of six\n"
        "postures. %s\n",
        100.0 * report->turned_over, state,
        options->model.reach == 0.0
            ? "The paper law spreads forces over a few mesh links, however short: give --reach 10"
            : "Give a longer --reach");
  }
}

/* Print the highest band (degree) of spherical harmonics that the given directions of gravity
 * determine, and the leave-one-out error of each band. */
static void report_fit(const char *path, const char *assumed, const supine_fields *fields,
                       const supine_fit_report *fit) {
  const size_t highest = fit->band_highest;
  (void)printf("%s: fields of gravity: %zu vertices, %zu directions, band %zu, %zu mode%s\n", path,
               fields->vertex_count, fields->direction_count, fit->band, fit->mode_count,
               plural(fit->mode_count));
  print_assumed("--axes, --units and --scanned", assumed);
  (void)printf("the directions determine bands up to %zu (%zu harmonic%s); leave-one-out error:\n",
               highest, (highest + 1) * (highest + 1), highest > 0 ? "s" : "");
  for (size_t band = 0; band <= highest; ++band) {
    (void)printf("  band %-2zu  %8.3g %%%s\n", band, 100.0 * fit->error[band],
                 band == fit->band ? "  <- chosen" : "");
  }
  if (fit->band == highest && highest < SUPINE_FIT_BAND_MAX) {
    (void)printf("the error is still falling at the highest band, so detail beyond band %zu is "
                 "missing: about\n%zu evenly spread directions would determine band %zu\n",
                 highest, 2 * (highest + 2) * (highest + 2), highest + 1);
  }
  (void)printf("error of the basis, each direction predicted from the others:\n"
               "  %.3g %% RMS, %.3g %% 95th percentile, %.3g %% largest, of the RMS displacement\n"
               "  %.3g mm RMS, %.3g mm 95th percentile, %.3g mm largest\n",
               100.0 * fit->accuracy.relative_rms, 100.0 * fit->accuracy.relative_p95,
               100.0 * fit->accuracy.relative_max, fit->accuracy.rms_mm, fit->accuracy.p95_mm,
               fit->accuracy.max_mm);
}

/* Compress the fields, and write a basis of them.
 * @param scan  posture of the scan; a copy, as the model takes the scan as it is */
static supine_status compress_fields(const request *wanted, const supine_scan *scan,
                                     const supine_source *source,
                                     supine_precompute_options *options, supine_error *error) {
  options->modes = wanted->has_modes ? wanted->modes : SUPINE_MODES_MADE_MAX;
  const supine_fit_options fit = {.band = wanted->has_band ? (int)wanted->band : -1,
                                  .modes = options->modes,
                                  .fewest_modes = !wanted->has_modes,
                                  .scan_gravity = scan->known ? scan->state.gravity : NULL};
  char posture[160] = "not displaced by gravity";
  char assumed[sizeof source->summary + sizeof posture + 8];
  SUPINE_FREED_BY(supine_fields_free) supine_fields fields = {0};
  supine_fit_report report;
  if (scan->known) {
    (void)supine_state_describe(&scan->state, posture, sizeof posture);
  }
  (void)snprintf(assumed, sizeof assumed, "%s; scan %s", source->summary, posture);
  options->assumed = assumed;
  SUPINE_TRY(supine_fields_load(wanted->fields, &source->lungs, &source->frame, &fields, error));
  SUPINE_TRY(
      supine_fields_write(&source->lungs, &fields, &fit, options, wanted->path, &report, error));
  report_fit(wanted->path, assumed, &fields, &report);
  return SUPINE_OK;
}

static supine_status compute(const request *wanted, const supine_lungs *lungs,
                             const supine_precompute_options *options, supine_error *error) {
  supine_precompute_report report;
  SUPINE_TRY(supine_precompute(lungs, options, wanted->path, &report, error));
  report_result(wanted->path, lungs, options, &report);
  return SUPINE_OK;
}

/* Read the model that was fitted to a patient, and describe it in `summary`. */
static supine_status read_patient(const char *path, supine_patient_record *record, char *summary,
                                  size_t size, supine_error *error) {
  const supine_patient_fit_report *report = &record->report;
  SUPINE_TRY(supine_patient_read(path, record, error));
  (void)snprintf(summary, size,
                 "%s: %s law%s from %.0f points; held-out residual %.1f of %.1f mm RMS, %.0f %% "
                 "explained; expected error %.1f mm RMS",
                 record->name, supine_patient_law_names[record->patient.law],
                 record->patient.centre_count > 0 ? " and kriging" : "", report->points,
                 report->held_out[SUPINE_PATIENT_SCORE_CORRECTED], report->baseline,
                 report->explained, report->expected_point);
  (void)printf("%s\n", summary);
  return SUPINE_OK;
}

static void print_directions(size_t count) {
  (void)puts("x,y,z");
  for (size_t i = 0; i < count; ++i) {
    double g[3];
    supine_spiral((double)i, (double)count, 0.0, g);
    (void)printf("%.9g,%.9g,%.9g\n", g[0], g[1], g[2]);
  }
}

static void begin(void *chosen) {
  ((request *)chosen)->model = supine_precompute_choice_default();
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  const bool fields = wanted->fields != NULL;
  const supine_scan scan = wanted->model.scan;
  supine_prepared prepared = {.source = {.is_map = false}};
  static supine_patient_record record; /* static, as it is too large for the stack */
  char summary[256];
  if (wanted->directions > 0) {
    print_directions(wanted->directions);
    return SUPINE_OK;
  }
  if (supine_mesh_save_supports(wanted->path)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%s: this is the name of a mesh: give a name that ends in .safetensors",
                            wanted->path);
  }
  if (fields && scan.known && scan.state.volume.kind != SUPINE_VOLUME_DEFAULT) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "--scanned: with --fields, give the posture alone, such as supine, as "
                            "fields of gravity have no volume");
  }
  if (wanted->patient != NULL) {
    SUPINE_TRY(read_patient(wanted->patient, &record, summary, sizeof summary, error));
    wanted->model.patient = &record;
  }
  if (fields) { /* they displace the surface as it is */
    wanted->model.scan.known = false;
    wanted->model.has_scan = true;
  }
  supine_status status =
      supine_command_prepare(name, &wanted->model, given->operand, given->count, &prepared, error);
  supine_precompute_options options = {
      .model = prepared.model,
      .reference = &prepared.reference,
      .band = wanted->band,
      .modes = wanted->modes,
      .held_out = wanted->held_out,
      .expected_error = prepared.patient != NULL ? supine_patient_expected(prepared.patient) : 0.0,
      .expected_from = record.report.expected_from,
      .turn_fitted = record.gain_error > 0.0,
      .frame = prepared.source.frame,
      .made_by = given->made_by,
      .patient = prepared.patient != NULL ? supine_patient_text(prepared.patient, NULL) : NULL,
      .patient_summary = summary,
      .assumed = prepared.assumed,
      .findings = prepared.source.findings.text};
  if (status == SUPINE_OK && prepared.patient != NULL && options.patient == NULL) {
    status = supine_error_memory(error, "%s", wanted->patient);
  }
  if (status == SUPINE_OK) {
    status = fields ? compress_fields(wanted, &scan, &prepared.source, &options, error)
                    : compute(wanted, &prepared.source.lungs, &options, error);
  }
  free((char *)options.patient);
  supine_precompute_prepared_free(&prepared);
  return status;
}

const supine_command supine_command_precompute = {
    name,
    "solve the physics once, and write a basis file for any posture",
    .usage = "MESH... -o FILE [OPTIONS]\n"
             "LABELS... -o FILE [OPTIONS]\n"
             "--directions N",
    .about = "Solves the physics of one or two lungs for all directions of gravity, and writes a "
             "basis file. From this file, 'supine deform' and the run-time library compute "
             "deformed lungs in real time. MESH is any surface that assimp reads (PLY, OBJ, STL, "
             "OFF, ...), with both lungs in one file or a file for each; LABELS is the label map "
             "of a segmentation (NRRD, NIfTI, MetaImage). Surfaces must be closed.",
    .options = table,
    .notes = "Examples:\n"
             "  supine precompute left.ply right.ply -o lungs.safetensors\n"
             "  supine precompute lungs.nii.gz -o lungs.safetensors\n"
             "  supine precompute lungs.stl --axes RAS --units cm -o lungs.safetensors",
    SUPINE_SURFACES,
    .request_size = sizeof(request),
    .begin = begin,
    .run = run};
