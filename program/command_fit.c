/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine fit: fit a law to one person's scans and landmarks. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "sh/base/text.h"

#include "precompute/inside/surface.h"
#include "precompute/patient/patient_file.h"
#include "program/model_options.h"
#include "program/options/surface_options.h"

static const char name[] = "fit";

/* Options: scans or landmarks of a person, and the posture and volume of each. */
typedef struct request {
  const char *path, *name;
  supine_landmark_options landmarks;
  bool has_law, expandability, json;
  int law;
  supine_source_options source; /* options for loading surfaces */

  supine_state rest, state; /* states of the first and of the second scan */
  size_t count;             /* number of further states */
  supine_state further[SUPINE_PATIENT_OTHERS_MAX];
  const char *further_path[SUPINE_PATIENT_OTHERS_MAX];
  const char *rest_path, *state_path; /* surfaces of the first and the second scan; NULL: none */
} request;

/* Scans and landmarks of the person. */
typedef struct scan_data {
  supine_lungs lungs[2]; /* in the fuller state, in the emptier one (once ordered) */
  supine_patient_pairs pairs;
  bool swapped; /* the state named second is the fuller one */
} scan_data;

static void begin(void *chosen) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  request *wanted = chosen;
  memcpy(wanted->rest.gravity, supine, sizeof supine);
  wanted->rest.volume.kind = SUPINE_VOLUME_REST;
  memcpy(wanted->state.gravity, supine, sizeof supine);
}

/* Read "supine", "prone:rest", "supine:rest+500" or "2600mL". */
static supine_status read_state(const char *text, void *field, supine_error *error) {
  supine_state *state = field;
  const supine_status status = supine_state_parse(text, state, error);
  return status == SUPINE_OK && (state->volume.kind == SUPINE_VOLUME_SCAN || state->lung_count > 0)
             ? supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                "'%s' is not a state here: give rest, full or a volume of both "
                                "lungs, as 2600mL",
                                text)
             : status;
}

/* Read "prone:PAIRS.csv" or "prone:rest:PRONE.ply" into the whole request. */
static supine_status read_further(const char *text, void *field, supine_error *error) {
  request *wanted = field;
  const char *colon = strrchr(text, ':');
  char state[SUPINE_PATIENT_STATE_TEXT];
  if (wanted->count == SUPINE_PATIENT_OTHERS_MAX || colon == NULL || colon[1] == '\0' ||
      (size_t)(colon - text) >= sizeof state) {
    return SUPINE_ERROR_ARGUMENT;
  }
  (void)snprintf(state, sizeof state, "%.*s", (int)(colon - text), text);
  wanted->further_path[wanted->count] = colon + 1;
  wanted->further[wanted->count].gravity[1] = 1.0;
  return read_state(state, &wanted->further[wanted->count++], error);
}

#define FILLS(member) SUPINE_FILLS(request, member)

static const supine_option table[] = {
    {"output", 'o', "FILE", "patient model to write (JSON), for 'supine precompute --patient'",
     FILLS(path), .file = SUPINE_FILE_OUT},
    {.table = supine_options_landmarks, FILLS(landmarks)},
    {"rest", 0, "STATE",
     "state of the first scan: POSTURE, VOLUME or POSTURE:VOLUME, where VOLUME is rest or "
     "full, either with +ML or -ML, or the volume measured in a CT, as 2600mL",
     FILLS(rest), .read = read_state, .standard = "supine:rest"},
    {"other", 0, "STATE",
     "state of the second scan, in the same form; without a volume, that of the surfaces. "
     "Either scan may be the fuller one",
     FILLS(state), .read = read_state, .standard = "supine"},
    {"law", 0, "LAW",
     "deep (default): only its size is fitted; paper: the law of Santhanam 2008, c1 to c9 "
     "fitted. Kriging interpolates the residual of either",
     FILLS(law), SUPINE_SAYS_GIVEN(request, has_law), .choices = supine_patient_law_names},
    {"name", 0, "TEXT", "name of the person; default: the landmarks' file", FILLS(name),
     .more = true},
    {"state", 0, "STATE:FILE",
     "further state: its surface, or landmarks from the first scan (.csv); may be repeated, up "
     "to 8. In a posture other than the fitted ones it determines the gravity-dependent part of "
     "the force (the gain), else how far that breath went; the other constants of the law stay "
     "those of the two states",
     .read = read_further, .wants = "(at most 8) a state, as prone:rest, a colon and a file"},
    {"midline", 0, "X", "x of the plane between the lungs, mm; default: the middle of the points",
     FILLS(source.midline), SUPINE_SAYS_GIVEN(request, source.has_midline), .wants = "an x in mm",
     .more = true},
    {.table = supine_options_surface_frame, FILLS(source.load)},
    {"expandability", 0, NULL,
     "for surfaces: fit the expandability of regions about 45 mm wide, with the paper law and "
     "the force of the law deep, instead of kriging; report the regions that cannot be "
     "determined; keep the result only where it lowers the held-out residual",
     FILLS(expandability), .more = true},
    {"json", 0, NULL, "print JSON instead of text", FILLS(json)},
    {.name = NULL}};

/* Print the model without its long lists, which the file has. */
static supine_status print(const supine_patient_record *record, const char *made_by, bool json,
                           supine_error *error) {
  json_t *root = supine_patient_encode(record, made_by);
  if (root == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for the report");
  }
  if (!json) {
    (void)json_object_del(root, "correction");
    (void)json_object_del(json_object_get(root, "expandability"), "regions");
  }
  supine_options_print(root, json);
  return SUPINE_OK;
}

static void scan_data_free(scan_data *data) {
  supine_lungs_free(&data->lungs[0]);
  supine_lungs_free(&data->lungs[1]);
  supine_patient_pairs_free(&data->pairs);
}

/* Return the volume of lungs, mL; 0 without a surface. */
static double volume_of(const supine_lungs *lungs) {
  return lungs->mesh.vertex_count > 0 ? 1e-3 * supine_mesh_volume(&lungs->mesh) : 0.0;
}

/* Find the lung that each landmark lies in, by the surface of the first scan. */
static supine_status find_sides(const supine_lungs *lungs, supine_patient_pairs *pairs,
                                supine_error *error) {
  supine_inside_surface *tree = NULL;
  pairs->side = malloc(pairs->count * sizeof *pairs->side);
  supine_status status =
      pairs->side == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu landmarks",
                             pairs->count)
          : supine_inside_surface_create(lungs->mesh.vertices, lungs->mesh.triangle_count,
                                         lungs->mesh.triangles, true, &tree, error);
  for (size_t i = 0; i < pairs->count && status == SUPINE_OK; ++i) {
    const supine_inside_place place = supine_inside_surface_find(tree, pairs->from + 3 * i, NULL);
    const size_t lung =
        lungs->lung_count == 2 && place.triangle >= lungs->triangle_begin[1] ? 1 : 0;
    pairs->side[i] = lungs->side[lung];
  }
  supine_inside_surface_destroy(tree);
  return status;
}

static supine_status load_pairs(const request *wanted, const char *path,
                                supine_patient_pairs *pairs, supine_error *error) {
  const bool moved = wanted->landmarks.translation || wanted->landmarks.rigid;
  const supine_status status =
      supine_patient_pairs_load(path, wanted->landmarks.reverse, pairs, error);
  return status == SUPINE_OK ? supine_patient_pairs_check(pairs, moved, error) : status;
}

static supine_status load_scans(const request *wanted, scan_data *data, supine_error *error) {
  supine_status status = SUPINE_OK;
  if (wanted->landmarks.path != NULL) {
    status = load_pairs(wanted, wanted->landmarks.path, &data->pairs, error);
  }
  if (status == SUPINE_OK && wanted->rest_path != NULL) {
    status =
        supine_command_load_lungs(name, wanted->rest_path, &wanted->source, &data->lungs[0], error);
  }
  if (status == SUPINE_OK && wanted->state_path != NULL) {
    status = supine_command_load_lungs(name, wanted->state_path, &wanted->source, &data->lungs[1],
                                       error);
  }
  if (status == SUPINE_OK && wanted->rest_path != NULL && data->pairs.count > 0) {
    status = find_sides(&data->lungs[0], &data->pairs, error);
  }
  return status;
}

/* Return +1 where the second state was named as the fuller one, -1 the emptier one, 0 neither. */
static int named_order(const supine_state *first, const supine_state *second) {
  const supine_volume *a = &first->volume;
  const supine_volume *b = &second->volume;
  if (a->kind == b->kind && a->kind != SUPINE_VOLUME_DEFAULT) {
    const bool same = a->kind != SUPINE_VOLUME_REST ||
                      memcmp(first->gravity, second->gravity, sizeof first->gravity) == 0;
    return !same || a->ml == b->ml ? 0 : b->ml > a->ml ? 1 : -1;
  }
  return a->kind == SUPINE_VOLUME_REST && b->kind == SUPINE_VOLUME_FULL   ? 1
         : a->kind == SUPINE_VOLUME_FULL && b->kind == SUPINE_VOLUME_REST ? -1
                                                                          : 0;
}

/* Find which of the two states is fuller, by the volumes of the surfaces or the spread of the
 * landmarks. If it is the second, exchange the surfaces and landmarks of the two. */
static supine_status order_states(const request *wanted, scan_data *data, supine_error *error) {
  static const double doubt =
      0.02; /* relative difference of volumes that is not yet a contradiction */
  const double volume[2] = {volume_of(&data->lungs[0]), volume_of(&data->lungs[1])};
  const double growth = volume[0] > 0.0 && volume[1] > 0.0 ? volume[1] / volume[0]
                        : data->pairs.count > 0 ? supine_patient_pairs_growth(&data->pairs)
                                                : 1.0;
  const int named = named_order(&wanted->rest, &wanted->state);
  if ((named > 0 && growth < 1.0 - doubt) || (named < 0 && growth > 1.0 + doubt)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "the state named as the fuller one holds %.0f %% of the other: "
                            "exchange --rest and --other, or give --reverse",
                            100.0 * (named > 0 ? growth : 1.0 / growth));
  }
  data->swapped = named > 0 || (named == 0 && growth > 1.0);
  if (data->swapped) {
    const supine_lungs lungs = data->lungs[0];
    data->lungs[0] = data->lungs[1];
    data->lungs[1] = lungs;
    double *from = data->pairs.from;
    data->pairs.from = data->pairs.to;
    data->pairs.to = from;
  }
  return SUPINE_OK;
}

static supine_status fit_landmarks(const request *wanted, const supine_patient_pairs *pairs,
                                   const supine_patient_fit_options *options,
                                   supine_patient_record *record, supine_error *error) {
  supine_patient_row *rows = malloc(3 * pairs->count * sizeof *rows);
  if (rows == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu landmarks",
                            pairs->count);
  }
  record->patient.frame = supine_patient_frame_of_points(
      pairs->count, pairs->from, wanted->source.has_midline ? &wanted->source.midline : NULL);
  supine_patient_rows_of_pairs(&record->patient.frame, pairs, rows);
  const supine_status status =
      supine_patient_fit(options, rows, 0, pairs->count, &record->patient, &record->report, error);
  free(rows);
  return status;
}

/* Fit a further state. Its landmarks start in the first scan: move them to the fuller state where
 * the first is the emptier one. */
static supine_status fit_further(const request *wanted, const scan_data *data, size_t which,
                                 const supine_lungs *from, supine_patient_record *record,
                                 supine_error *error) {
  const bool moved = wanted->landmarks.translation || wanted->landmarks.rigid;
  const char *path = wanted->further_path[which];
  const bool landmarks = supine_text_ends_in(path, ".csv");
  supine_patient_pairs pairs = {0};
  supine_lungs lungs = {0};
  supine_patient_further *further = &record->further[record->further_count++];
  *further = (supine_patient_further){.state = wanted->further[which]};
  supine_status status =
      landmarks ? load_pairs(wanted, path, &pairs, error)
                : supine_command_load_lungs(name, path, &wanted->source, &lungs, error);
  if (status == SUPINE_OK && landmarks && data->swapped) {
    supine_patient_points_to_fuller(&record->patient, pairs.count, pairs.from);
  }
  if (status == SUPINE_OK) {
    status = supine_patient_gain_fit(record, from, landmarks ? &pairs : NULL,
                                     landmarks ? NULL : &lungs.mesh, moved, further, error);
  }
  supine_patient_pairs_free(&pairs);
  supine_lungs_free(&lungs);
  return status;
}

/* Fit the gravity-dependent share of the force to the further states. */
static supine_status find_gain(const request *wanted, scan_data *data,
                               supine_patient_record *record, supine_error *error) {
  supine_lungs *from = &data->lungs[0];
  supine_status status = SUPINE_OK;
  if (from->mesh.vertex_count == 0) { /* only the emptier scan has a surface */
    from = &data->lungs[1];
    supine_patient_points_to_fuller(&record->patient, from->mesh.vertex_count, from->mesh.vertices);
    supine_mesh_box(&from->mesh, from->minimum, from->maximum);
  }
  for (size_t k = 0; k < wanted->count && status == SUPINE_OK; ++k) {
    status = fit_further(wanted, data, k, from, record, error);
  }
  supine_patient_gain_set(record);
  return status;
}

/* Set the volume of a state without one to that of its surface: relative to the other state where
 * that is known, else absolute. */
static void complete_state(supine_patient_record *record, size_t k) {
  supine_volume *of = &record->state[k].volume;
  const supine_state *other = &record->state[1 - k];
  const bool same = memcmp(record->state[k].gravity, other->gravity, sizeof other->gravity) == 0;
  if (of->kind != SUPINE_VOLUME_DEFAULT || record->volume[k] <= 0.0) {
    return;
  }
  *of = (supine_volume){SUPINE_VOLUME_ABSOLUTE, record->volume[k]};
  if (record->volume[1 - k] > 0.0 && (other->volume.kind == SUPINE_VOLUME_FULL ||
                                      (other->volume.kind == SUPINE_VOLUME_REST && same))) {
    *of = (supine_volume){other->volume.kind,
                          other->volume.ml + record->volume[k] - record->volume[1 - k]};
  }
}

static void set_states(const request *wanted, const scan_data *data,
                       supine_patient_record *record) {
  record->from_surface = wanted->state_path != NULL;
  record->state[data->swapped ? 1 : 0] = wanted->rest;
  record->state[data->swapped ? 0 : 1] = wanted->state;
  for (size_t k = 0; k < 2; ++k) {
    const supine_volume *volume = &record->state[k].volume;
    record->volume[k] = volume_of(&data->lungs[k]);
    if (record->volume[k] == 0.0 && volume->kind == SUPINE_VOLUME_ABSOLUTE) {
      record->volume[k] = volume->ml;
    }
  }
  complete_state(record, 0);
  complete_state(record, 1);
  if (record->from_surface) {
    memcpy(record->emptier[0], data->lungs[1].minimum, sizeof record->emptier[0]);
    memcpy(record->emptier[1], data->lungs[1].maximum, sizeof record->emptier[1]);
  } else {
    const supine_patient_frame frame =
        supine_patient_frame_of_points(data->pairs.count, data->pairs.to, NULL);
    memcpy(record->emptier[0], frame.minimum, sizeof record->emptier[0]);
    memcpy(record->emptier[1], frame.maximum, sizeof record->emptier[1]);
  }
}

/* Warn where the volume at rest that the two scans show differs from that of healthy people. */
static void warn_of_rest(const supine_patient_record *record) {
  static const double apart_least =
      0.07; /* share of full inflation; the standard deviation in healthy people is 0.04 */
  const supine_resting usual = supine_reference_resting_default();
  const double *g = record->state[1].gravity;
  supine_resting shown = usual;
  supine_findings findings = {""};
  supine_patient_resting(record, &shown);
  const double share[2] = {supine_reference_resting_total(&usual, g),
                           supine_reference_resting_total(&shown, g)};
  if (fabs(share[1] - share[0]) > apart_least) {
    supine_findings_add(&findings,
                        "warning: at rest the lungs hold %.0f %% of full inflation by the two "
                        "scans, where %.0f %% is assumed of healthy people. Is --rest right? "
                        "'supine precompute --patient' takes what the scans show",
                        100.0 * share[1], 100.0 * share[0]);
    supine_options_say_findings(name, &findings);
  }
}

/* Set the name, and the force with the gain of the law deep. */
static void set_name_and_force(const request *wanted, supine_patient_record *record) {
  const supine_model deep = supine_physics_model(SUPINE_LAW_DEEP);
  const char *source = wanted->landmarks.path != NULL ? wanted->landmarks.path : wanted->state_path;
  const char *slash = strrchr(source, '/');
  (void)snprintf(record->name, sizeof record->name, "%s",
                 wanted->name != NULL ? wanted->name
                 : slash != NULL      ? slash + 1
                                      : source);
  record->force =
      supine_patient_force(&record->patient.power, deep.force.gain, record->state[1].gravity);
}

static supine_status fit(const request *wanted, supine_patient_record *record,
                         supine_error *error) {
  supine_patient_fit_options options = {
      .law = (supine_patient_law)wanted->law,
      .scan_motion = wanted->landmarks.rigid         ? SUPINE_PATIENT_RIGID
                     : wanted->landmarks.translation ? SUPINE_PATIENT_TRANSLATION
                                                     : SUPINE_PATIENT_STILL};
  scan_data data = {0};
  double gains[2][3];
  supine_status status = load_scans(wanted, &data, error);
  if (status == SUPINE_OK) {
    status = order_states(wanted, &data, error);
  }
  if (status == SUPINE_OK) {
    set_states(wanted, &data, record);
    memcpy(options.gravity, record->state[1].gravity, sizeof options.gravity);
    warn_of_rest(record);
    supine_patient_path(record, gains);
    for (size_t k = 0; k < 3; ++k) {
      options.path_span[k] = gains[1][k] - gains[0][k];
    }
    status = wanted->state_path != NULL
                 ? supine_patient_fit_surface(&data.lungs[0], &data.lungs[1].mesh, &data.pairs,
                                              &options, wanted->expandability, record, error)
                 : fit_landmarks(wanted, &data.pairs, &options, record, error);
  }
  if (status == SUPINE_OK) {
    set_name_and_force(wanted, record);
    status = find_gain(wanted, &data, record, error);
  }
  scan_data_free(&data);
  return status;
}

/* Check the operands and options. */
static supine_status check(request *wanted, const supine_arguments *given, supine_error *error) {
  bool surfaces = false; /* further states as surfaces */
  wanted->rest_path = given->count > 0 ? given->operand[0] : NULL;
  wanted->state_path = given->count > 1 ? given->operand[1] : NULL;
  for (size_t k = 0; k < wanted->count; ++k) {
    surfaces = surfaces || !supine_text_ends_in(wanted->further_path[k], ".csv");
  }
  const char *wrong =
      wanted->landmarks.path == NULL && wanted->state_path == NULL
          ? "nothing to fit to: give --landmarks, or the surfaces of both states, or all three"
      : surfaces && wanted->rest_path == NULL
          ? "a --state is a surface: name that of the first scan as well"
      : wanted->expandability && wanted->state_path == NULL
          ? "--expandability needs surfaces: give those of both states"
      : wanted->expandability && wanted->has_law && wanted->law == SUPINE_PATIENT_DEEP
          ? "--expandability uses the paper law: leave --law out"
          : NULL;
  return wrong != NULL ? supine_error_set(error, SUPINE_ERROR_ARGUMENT, "%s", wrong) : SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  static supine_patient_record record; /* about 90 kB, too large for the stack */
  supine_status status = check(wanted, given, error);
  if (status == SUPINE_OK) {
    status = fit(wanted, &record, error);
  }
  if (status == SUPINE_OK) {
    status = print(&record, given->made_by, wanted->json, error);
  }
  if (status == SUPINE_OK && wanted->path != NULL) { /* last: no failure follows */
    status = supine_patient_write(wanted->path, &record, given->made_by, error);
  }
  return status;
}

const supine_command supine_command_fit = {
    name,
    "fit a model to a person's scans and landmarks",
    .usage = "--landmarks PAIRS.csv -o patient.json [OPTIONS]\n"
             "SCAN SCAN [--state STATE:FILE]... -o patient.json [OPTIONS]",
    .about = "Fits a model to one person's lungs in two scans: a law of motion, and its residual "
             "interpolated by kriging. Reports the measured and the expected error at held-out "
             "points. Landmarks determine most; surfaces alone do not show sliding along them, so "
             "their expected error includes that seen in other patients. 'supine precompute "
             "--patient' makes a basis from the model and either scan.",
    .options = table,
    .notes =
        "The residuals are those of no motion, a translation, an affine map, the law, and the law "
        "corrected by kriging; held out in 5 folds of blocks of 40 mm, repeated 3 times. A small "
        "distance between surfaces does not prove the motion inside: points have been off by 14 mm "
        "where surfaces were 5 mm apart. The applied force is found from the displacement by the "
        "inverse of the operator; its residual is what (18) of Santhanam 2008 does not explain.\n"
        "\n"
        "Examples:\n"
        "  supine fit --landmarks pairs.csv --translation --rest supine:rest "
        "--other supine:full -o patient.json\n"
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
    .begin = begin,
    .run = run};
