/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The options of `supine precompute`, and what they do. */
#include <string.h>

#include "base/arena.h"
#include "precompute/fields/fields.h"
#include "program/offline/basis.h"
#include "program/options/model_options.h"

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

#define FILLS(member) SUPINE_FILLS(supine_offline_request, member)

const supine_option supine_offline_options[] = {
    {"output", 'o', "FILE", "basis file to write (.safetensors)", FILLS(path), .required = true,
     .file = SUPINE_FILE_OUT},
    {"band", 0, "L", "highest band L of the spherical harmonics, 0 to 64", FILLS(basis.band),
     SUPINE_SAYS_GIVEN(supine_offline_request, has_band), .standard = "23",
     .range = {0.0, SUPINE_SH_BAND_MAX}, .more = true},
    {"modes", 0, "K|harmonics",
     "basis functions to store\nharmonics: all (L+1)^2 spherical harmonics up to --band L, as in "
     "Santhanam 2008 with --band 3\nK: the K functions (modes) that describe the displacement "
     "best, or fewer if fewer suffice. More modes are more accurate, but each costs a "
     "multiplication per vertex at run time",
     FILLS(basis.modes), SUPINE_SAYS_GIVEN(supine_offline_request, has_modes), .read = read_modes,
     .standard = "16", .wants = "1 to 64 or 'harmonics'", .more = true},
    {"held-out", 0, "N",
     "number of held-out directions in which the error is measured; default 1000; fewer, but at "
     "least 100, for more than 20000 vertices",
     FILLS(basis.held_out), .range = {1.0, 100000.0}, .more = true},
    {"without-normals", 0, NULL,
     "leave out the normals: 65 bytes a vertex for 95, and programs compute them from the "
     "triangles",
     FILLS(basis.without_normals), .more = true},
    {"patient", 0, "FILE",
     "model of the patient's motion, made by 'supine fit', to use instead of the built-in law",
     FILLS(patient), .file = SUPINE_FILE_IN, .rivals = "directions",
     .partners = "output band modes held-out without-normals axes units midline labels edge close "
                 "surfaces-out "
                 "scanned resting full height sex expandability lesion lung"},
    {.help = "Displacements from another simulator, instead of the built-in physics:"},
    {"fields", 0, "FILE",
     "safetensors file with three tensors: points [P,3], the positions of P points; gravity [M,3], "
     "M directions; and displacement [M,P,3], the displacement of each point for each direction. "
     "All three are in the axes and unit of MESH. Each vertex of MESH takes the displacement of "
     "the point at its position, so that the points may have any order and may include inner nodes "
     "of a volume mesh. The fields give gravity alone: the basis has no volumes and no breaths. "
     "Without --band and --modes, cross-validation chooses both",
     FILLS(fields), .file = SUPINE_FILE_IN, .rivals = "directions",
     .partners = "output band modes without-normals axes units midline labels edge close "
                 "surfaces-out scanned"},
    {"directions", 0, "N",
     "only print N directions of gravity that cover the sphere evenly, as CSV, to simulate",
     FILLS(directions), .range = {2.0, 1000.0}, .partners = ""},
    {.table = supine_command_model_options, FILLS(model)},
    {.name = NULL}};

/* Fraction of turned-over triangles above which a warning is printed. */
static const double turned_over_limit = 0.01;

static const char *plural(size_t count) {
  return count == 1 ? "" : "s";
}

/* Print the assumptions, one per line, and the options that change them. */
static void print_assumed(FILE *out, const char *options, const char *assumed) {
  (void)fprintf(out, "assumed (%s change it):\n", options);
  for (const char *item = assumed, *end; item != NULL; item = end) {
    end = strstr(item, "; ");
    (void)fprintf(out, "  %.*s\n", (int)(end != NULL ? end - item : 1000), item);
    end = end != NULL ? end + 2 : NULL;
  }
}

static void print_errors(FILE *out, const supine_accuracy *accuracy, const char *at,
                         const char *state) {
  (void)fprintf(out,
                "  %.3g %% RMS, %.3g %% 95th percentile, %.3g %% largest, of the RMS displacement\n"
                "  %.3g mm RMS, %.3g mm 95th percentile, %.3g mm largest%s%s\n",
                100.0 * accuracy->relative_rms, 100.0 * accuracy->relative_p95,
                100.0 * accuracy->relative_max, accuracy->rms_mm, accuracy->p95_mm,
                accuracy->max_mm, at, state);
}

static void report_result(FILE *out, const char *path, const supine_basis_choice *choice,
                          const supine_prepared *prepared, const supine_basis_report *report) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const supine_accuracy *accuracy = &report->accuracy;
  char state[64];
  if (!prepared->reference.known) {
    (void)snprintf(state, sizeof state, "%g mL", accuracy->volume);
  } else if (accuracy->volume == 1.0) {
    (void)snprintf(state, sizeof state, "rest");
  } else {
    (void)snprintf(state, sizeof state, "%g of the volume change from full to rest",
                   accuracy->volume);
  }
  (void)fprintf(out, "%s: %s, %zu vertices, band %zu, %zu %s%s\n", path,
                lungs->lung_count == 2 ? "two lungs" : "one lung", lungs->mesh.vertex_count,
                choice->band, report->mode_count, choice->modes == 0 ? "harmonic" : "mode",
                plural(report->mode_count));
  print_assumed(out, "--axes, --units, --scanned, --law and --resting", prepared->assumed);
  (void)fprintf(out, "error against the full solve, on %zu held-out direction%s:\n",
                accuracy->direction_count, plural(accuracy->direction_count));
  print_errors(out, accuracy, ", at ", state);
  if (report->turned_over > turned_over_limit) {
    (void)fprintf(
        out,
        "the surface folds: %.3g %% of its triangles turn over at %s in the worst of six\n"
        "postures. %s\n",
        100.0 * report->turned_over, state,
        prepared->model.reach == 0.0
            ? "The paper law spreads forces over a few mesh links, however short: give --reach 10"
            : "Give a longer --reach");
  }
}

/* Print the highest band (degree) of spherical harmonics that the given directions of gravity
 * determine, and the leave-one-out error of each band. */
static void report_fit(FILE *out, const char *path, const char *assumed,
                       const supine_fields *fields, const supine_basis_report *report) {
  const supine_fit_report *fit = &report->fit;
  const size_t highest = fit->band_highest;
  (void)fprintf(out, "%s: fields of gravity: %zu vertices, %zu directions, band %zu, %zu mode%s\n",
                path, fields->vertex_count, fields->direction_count, fit->band, report->mode_count,
                plural(report->mode_count));
  print_assumed(out, "--axes, --units and --scanned", assumed);
  (void)fprintf(out,
                "the directions determine bands up to %zu (%zu harmonic%s); leave-one-out error:\n",
                highest, (highest + 1) * (highest + 1), highest > 0 ? "s" : "");
  for (size_t band = 0; band <= highest; ++band) {
    (void)fprintf(out, "  band %-2zu  %8.3g %%%s\n", band, 100.0 * fit->error[band],
                  band == fit->band ? "  <- chosen" : "");
  }
  if (fit->band == highest && highest < SUPINE_FIT_BAND_MAX) {
    (void)fprintf(out,
                  "the error is still falling at the highest band, so detail beyond band %zu is "
                  "missing: about\n%zu evenly spread directions would determine band %zu\n",
                  highest, 2 * (highest + 2) * (highest + 2), highest + 1);
  }
  (void)fprintf(out, "error of the basis, each direction predicted from the others:\n");
  print_errors(out, &report->accuracy, "", "");
}

/* Compress the fields, and write a basis of them. */
static supine_status compress_fields(const supine_offline_request *wanted,
                                     supine_prepared *prepared, FILE *out, supine_error *error) {
  const supine_scan *scan = &wanted->posture;
  supine_basis_choice basis = wanted->basis;
  basis.modes = wanted->has_modes ? basis.modes : SUPINE_MODES_MADE_MAX;
  basis.choose_band = !wanted->has_band;
  basis.keep_modes = wanted->has_modes;
  basis.scan_gravity = scan->known ? scan->state.gravity : NULL;
  char posture[160] = "not displaced by gravity";
  SUPINE_FREED_BY(supine_fields_free) supine_fields fields = {0};
  supine_basis_report report;
  if (scan->known) {
    (void)supine_state_describe(&scan->state, posture, sizeof posture);
  }
  (void)snprintf(prepared->assumed, sizeof prepared->assumed, "%s; scan %s",
                 prepared->source.summary, posture);
  SUPINE_TRY(supine_fields_load(wanted->fields, &prepared->source.lungs, &prepared->source.frame,
                                &fields, error));
  basis.fields = &fields;
  SUPINE_TRY(supine_precompute_write(wanted->path, prepared, &basis, &report, error));
  report_fit(out, wanted->path, prepared->assumed, &fields, &report);
  return SUPINE_OK;
}

void supine_offline_begin(void *request) {
  ((supine_offline_request *)request)->model = supine_precompute_choice_default();
}

supine_status supine_offline_check(supine_offline_request *wanted, supine_error *error) {
  supine_scan *scan = &wanted->model.scan;
  SUPINE_REFUSE_IF(supine_mesh_save_supports(wanted->path), error, SUPINE_ERROR_ARGUMENT,
                   "%s: this is the name of a mesh: give a name that ends in .safetensors",
                   wanted->path);
  if (wanted->fields != NULL) { /* they displace the surface as it is */
    SUPINE_REFUSE_IF(scan->known && scan->state.volume.kind != SUPINE_VOLUME_DEFAULT, error,
                     SUPINE_ERROR_ARGUMENT,
                     "--scanned: with --fields, give the posture alone, such as supine, as fields "
                     "of gravity have no volume");
    wanted->posture = *scan;
    scan->known = false;
    wanted->model.has_scan = true;
  }
  if (wanted->patient != NULL) {
    wanted->model.patient = &wanted->record;
    return supine_patient_read(wanted->patient, &wanted->record, error);
  }
  return SUPINE_OK;
}

supine_status supine_offline_write(const supine_offline_request *wanted, supine_prepared *prepared,
                                   FILE *out, supine_error *error) {
  supine_basis_report report;
  if (wanted->fields != NULL) {
    return compress_fields(wanted, prepared, out, error);
  }
  if (prepared->patient != NULL) {
    (void)fprintf(out, "%s\n", prepared->fit);
  }
  SUPINE_TRY(supine_precompute_write(wanted->path, prepared, &wanted->basis, &report, error));
  report_result(out, wanted->path, &wanted->basis, prepared, &report);
  return SUPINE_OK;
}
