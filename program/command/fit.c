/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine fit: fit a displacement law to one person's scans and landmarks. */
#include <math.h>
#include <string.h>

#include <jansson.h>

#include "base/text.h"

#include "precompute/patient/checks.h"
#include "precompute/patient/matching.h"
#include "precompute/patient/scans.h"
#include "program/command/list.h"
#include "program/options/model_options.h"
#include "program/options/surface_options.h"

static const char name[] = "fit";

typedef struct request {
  const char *path, *name, *map;
  supine_landmark_options landmarks;
  bool has_law, expandability;
  int law;
  supine_source_options source;

  supine_state state[2];    /* states of the lungs in the two scans */
  const char *scan_path[2]; /* surface files of the two scans; NULL if not given */
  size_t further_count;
  supine_state further[SUPINE_PATIENT_OTHERS_MAX];
  const char *further_path[SUPINE_PATIENT_OTHERS_MAX];
} request;

/* Read a state, such as "supine", "prone:rest", "supine:rest+500" or "2600mL". */
static supine_status read_state(const char *text, void *field, supine_error *error) {
  supine_state *state = field;
  SUPINE_TRY(supine_state_parse(text, state, error));
  SUPINE_REFUSE_IF(state->volume.kind == SUPINE_VOLUME_SCAN || state->lung_count > 0, error,
                   SUPINE_ERROR_ARGUMENT,
                   "'%s' cannot be the state of a scan: give rest, full or a volume of both lungs, "
                   "such as 2600mL",
                   text);
  return SUPINE_OK;
}

/* Append a further state, such as "prone:PAIRS.csv" or "prone:rest:PRONE.ply", to the request. */
static supine_status read_further(const char *text, void *field, supine_error *error) {
  request *wanted = field;
  const char *colon = strrchr(text, ':');
  char state[SUPINE_PATIENT_STATE_TEXT];
  if (wanted->further_count == SUPINE_PATIENT_OTHERS_MAX || colon == NULL || colon[1] == '\0' ||
      (size_t)(colon - text) >= sizeof state) {
    return SUPINE_ERROR_ARGUMENT;
  }
  (void)snprintf(state, sizeof state, "%.*s", (int)(colon - text), text);
  wanted->further_path[wanted->further_count] = colon + 1;
  wanted->further[wanted->further_count].gravity[1] = 1.0;
  return read_state(state, &wanted->further[wanted->further_count++], error);
}

#define FILLS(member) SUPINE_FILLS(request, member)

static const supine_option table[] = {
    {"output", 'o', "FILE", "patient model to write (JSON), for 'supine precompute --patient'",
     FILLS(path), .file = SUPINE_FILE_OUT},
    {.table = supine_options_landmarks, FILLS(landmarks)},
    {"rest", 0, "STATE",
     "state of the first scan: POSTURE, VOLUME or POSTURE:VOLUME. VOLUME is rest or full, each "
     "alone or with +ML or -ML, or the volume of both lungs measured in a CT, such as 2600mL",
     FILLS(state[0]), .read = read_state, .standard = "supine:rest"},
    {"other", 0, "STATE",
     "state of the second scan, in the same form; either scan may be the fuller one. A missing "
     "volume is taken from the surfaces. With landmarks alone, give both volumes in mL. If the "
     "states are only known by two volumes, the fuller scan is at full inflation and the other one "
     "at rest, or a breath above rest if it holds less than 1.23 times as much",
     FILLS(state[1]), .read = read_state, .standard = "supine"},
    {"law", 0, "LAW",
     "constants that are fitted\ndeep: the size of the displacement; the other constants stay "
     "close to those of the deep law of 'supine precompute'\npaper: all nine constants of "
     "(15)-(18) of Santhanam 2008\nKriging interpolates the residual of either law. Default deep",
     FILLS(law), SUPINE_SAYS_GIVEN(request, has_law), .choices = supine_patient_law_names},
    {"name", 0, "TEXT",
     "name of the patient; default the name of the file of landmarks, or of the second surface",
     FILLS(name), .more = true},
    {"state", 0, "STATE:FILE",
     "further state: its surface, or landmarks (.csv) from the first scan to this state. May be "
     "repeated, up to 8 times. A state in another posture determines how strongly the displacement "
     "depends on gravity (--gain of 'supine precompute'); for a state in the same posture, only "
     "the size of the displacement is fitted. All other constants come from the two scans",
     .read = read_further, .repeats = true,
     .wants = "STATE:FILE (at most 8 times), such as prone:rest:prone.ply"},
    {"midline", 0, "X",
     "x of the plane between the lungs, in mm and LPS; default the widest gap between landmarks "
     "near the middle",
     FILLS(source.midline), SUPINE_SAYS_GIVEN(request, source.has_midline), SUPINE_MEASURES(LENGTH),
     .more = true},
    {.table = supine_options_surface_frame, FILLS(source.load)},
    {"expandability", 0, NULL,
     "for surfaces: instead of kriging, fit the expandability (the inverse of the stiffness) of "
     "regions about 45 mm wide, relative to the deep law with one factor for each axis. The result "
     "is used only if it lowers the held-out residual by 5 % or more",
     FILLS(expandability), .more = true},
    {"map", 0, "FILE",
     "with --expandability: write the expandability of every vertex of the fuller scan, and how "
     "far the surfaces determine it, 0 (not at all) to 1. 'supine precompute --expandability' "
     "reads the .csv; a .vtp or .ply has both as colours of the surface",
     FILLS(map), .file = SUPINE_FILE_OUT, .endings = ".csv, .vtp or .ply", .more = true},
    {.name = NULL}};

/* Print the fitted model as JSON, or as text without kriging centres and local expandability. */
static void print(const supine_patient_record *record, const char *made_by) {
  json_t *root = supine_patient_encode(record, made_by);
  if (!supine_options_as_json()) {
    (void)json_object_del(root, "correction");
    (void)json_object_del(json_object_get(root, "expandability"), "regions");
  }
  supine_options_print(root);
}

static bool scans_moved(const request *wanted) {
  return wanted->landmarks.translation || wanted->landmarks.rigid;
}

static supine_status load_pairs(const request *wanted, const char *path,
                                supine_patient_pairs *pairs, supine_error *error) {
  SUPINE_TRY(supine_patient_pairs_load(path, wanted->landmarks.reverse, pairs, error));
  SUPINE_TRY(supine_options_drop_mismatched(name, path, pairs, error));
  return supine_patient_pairs_check(pairs, scans_moved(wanted), error);
}

static supine_status load_scans(const request *wanted, supine_patient_scans *scans,
                                supine_error *error) {
  if (wanted->landmarks.path != NULL) {
    SUPINE_TRY(load_pairs(wanted, wanted->landmarks.path, &scans->pairs, error));
  }
  for (size_t k = 0; k < 2; ++k) {
    if (wanted->scan_path[k] != NULL) {
      SUPINE_TRY(supine_options_load_lungs(name, wanted->scan_path[k], &wanted->source,
                                           &scans->lungs[k], error));
    }
  }
  scans->midline = wanted->source.has_midline ? &wanted->source.midline : NULL;
  return SUPINE_OK;
}

/* Fit a further scan, given by --state. Its landmarks pair points with those of the first scan. */
static supine_status fit_further(const request *wanted, size_t which, supine_patient_scans *scans,
                                 supine_patient_record *record, supine_error *error) {
  const char *path = wanted->further_path[which];
  const supine_state *state = &wanted->further[which];
  if (supine_text_ends_in(path, ".csv")) {
    SUPINE_FREED_BY(supine_patient_pairs_free) supine_patient_pairs pairs = {0};
    SUPINE_TRY(load_pairs(wanted, path, &pairs, error));
    return supine_patient_scans_fit_further_landmarks(scans, state, scans_moved(wanted), &pairs,
                                                      record, error);
  }
  SUPINE_FREED_BY(supine_lungs_free) supine_lungs lungs = {0};
  SUPINE_TRY(supine_options_load_lungs(name, path, &wanted->source, &lungs, error));
  return supine_patient_scans_fit_further_surface(scans, state, scans_moved(wanted), &lungs, record,
                                                  error);
}

/* Take the file names from the command line, and check that they fit the options. */
static supine_status check(request *wanted, const supine_arguments *given, supine_error *error) {
  bool further_surfaces = false;
  wanted->scan_path[0] = given->count > 0 ? given->operand[0] : NULL;
  wanted->scan_path[1] = given->count > 1 ? given->operand[1] : NULL;
  for (size_t k = 0; k < wanted->further_count; ++k) {
    further_surfaces = further_surfaces || !supine_text_ends_in(wanted->further_path[k], ".csv");
  }
  const supine_status wrong = SUPINE_ERROR_ARGUMENT;
  SUPINE_REFUSE_IF(wanted->landmarks.path == NULL && wanted->scan_path[1] == NULL, error, wrong,
                   "nothing to fit to: give --landmarks, the surfaces of both scans, or both");
  SUPINE_REFUSE_IF(
      further_surfaces && wanted->scan_path[0] == NULL, error, wrong,
      "--state with a surface needs a first scan: name the surface of the first scan too");
  SUPINE_REFUSE_IF(wanted->expandability && wanted->scan_path[1] == NULL, error, wrong,
                   "--expandability needs surfaces: give those of both scans");
  SUPINE_REFUSE_IF(wanted->map != NULL && !wanted->expandability, error, wrong,
                   "--map writes what --expandability finds: give both");
  SUPINE_REFUSE_IF(wanted->expandability && wanted->has_law && wanted->law == SUPINE_PATIENT_PAPER,
                   error, wrong, "--expandability uses the deep law: leave --law out");
  return SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  static supine_patient_record record; /* static, as it is too large for the stack */
  SUPINE_TRY(check(wanted, given, error));
  const supine_patient_fit_options options = {.law = (supine_patient_law)wanted->law,
                                              .scan_motion =
                                                  supine_options_scan_motion(&wanted->landmarks)};
  const char *named_for =
      wanted->landmarks.path != NULL ? wanted->landmarks.path : wanted->scan_path[1];
  SUPINE_FREED_BY(supine_patient_scans_free) supine_patient_scans scans = {0};
  SUPINE_REFUSE_IF(wanted->name != NULL && !supine_text_is_utf8(wanted->name), error,
                   SUPINE_ERROR_ARGUMENT, "--name is not UTF-8: give it in this encoding");
  (void)snprintf(record.name, sizeof record.name, "%s",
                 wanted->name != NULL ? wanted->name : supine_text_file_name(named_for));
  (void)supine_text_make_utf8(record.name); /* of a file, or cut off */
  SUPINE_TRY(load_scans(wanted, &scans, error));
  memcpy(record.state, wanted->state, sizeof record.state);
  SUPINE_TRY(supine_patient_scans_order(&scans, &record, error));
  supine_options_say_findings(name, &scans.findings);
  scans.findings.count = 0; /* said */
  SUPINE_TRY(supine_patient_scans_fit(&scans, &options, wanted->expandability, &record, error));
  for (size_t k = 0; k < wanted->further_count; ++k) {
    SUPINE_TRY(fit_further(wanted, k, &scans, &record, error));
  }
  supine_options_say_findings(name, &scans.findings);
  supine_patient_gain_set(&record);
  if (wanted->map != NULL) {
    SUPINE_TRY(
        supine_patient_stiffness_write(wanted->map, &record.stiffness, &scans.lungs[0], error));
  }
  print(&record, given->made_by);
  /* Write the file last, so that a failure leaves no file. */
  return wanted->path != NULL ? supine_patient_write(wanted->path, &record, given->made_by, error)
                              : SUPINE_OK;
}

const supine_command supine_command_fit = {
    name,
    "fit a model to a patient's scans and landmarks",
    .usage = "--landmarks PAIRS.csv -o patient.json [OPTIONS]\n"
             "SCAN SCAN [--state STATE:FILE]... -o patient.json [OPTIONS]",
    .about = "Fits a model of one patient's motion between two scans: a law with few constants "
             "describes the motion, and kriging interpolates the residual of the law. SCAN is the "
             "surface of the lungs; two files, one for each lung, are joined by a comma "
             "(left.ply,right.ply). Landmarks determine the motion best. Surfaces alone do not "
             "show how tissue slides along the surface; the expected error then includes the "
             "sliding seen in other patients. 'supine precompute --patient' makes a basis from the "
             "model and either scan.",
    .options = table,
    .notes =
        "Residuals are given for no motion, a translation, an affine map, the law, and the law "
        "corrected by kriging. Held-out residuals are from cross-validation: 5 folds of blocks of "
        "40 mm, repeated 3 times. A small distance between surfaces does not prove that the motion "
        "inside is right: points inside have been 14 mm off where the surfaces were 5 mm apart. "
        "The report also gives the force that the measured displacement implies, and the part of "
        "it that equation (18) of Santhanam 2008 does not explain. It is computed from landmarks; "
        "without them it is computed from the surfaces, which in real people do not show it: in "
        "five people it correlates with the height by -0.28 to 0.03.\n"
        "\n"
        "Examples:\n"
        "  supine fit --landmarks pairs.csv --translation --rest 2600mL --other 5400mL -o "
        "patient.json\n"
        "  supine fit rest.ply full.ply --other supine:full --landmarks pairs.csv -o patient.json\n"
        "  supine fit rest.ply later.ply --other supine:rest+500 -o patient.json\n"
        "  supine fit rest.ply full.ply --other supine:full --state prone:rest:prone.ply --law "
        "paper \\\n"
        "      -o patient.json\n"
        "  supine precompute rest.ply --patient patient.json -o lungs.safetensors",
    .operands_least = 0,
    .operands_most = 2,
    .operands_missing = "more than two scans: give further ones as --state STATE:FILE",
    .request_size = sizeof(request),
    .uses_blas = true,
    .run = run};
