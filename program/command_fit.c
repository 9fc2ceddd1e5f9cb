/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine fit: fit a displacement law to one person's scans and landmarks. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "base/arena.h"
#include "base/output.h"
#include "base/text.h"

#include "precompute/lungs/surface.h"
#include "precompute/patient/matching.h"
#include "precompute/patient/patient_file.h"
#include "program/options/model_options.h"
#include "program/options/surface_options.h"

static const char name[] = "fit";

typedef struct request {
  const char *path, *name, *map;
  supine_landmark_options landmarks;
  bool has_law, expandability, json;
  int law;
  supine_source_options source;

  supine_state first, second;           /* states of the lungs in the two scans */
  const char *first_path, *second_path; /* surface files of the two scans; NULL if not given */
  size_t further_count;
  supine_state further[SUPINE_PATIENT_OTHERS_MAX];
  const char *further_path[SUPINE_PATIENT_OTHERS_MAX];
} request;

typedef struct scan_data {
  supine_lungs lungs[2]; /* lungs in the two scans; order_states puts the fuller scan first */
  supine_patient_pairs pairs;
  bool second_is_fuller;
} scan_data;

static void begin(void *chosen) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  request *wanted = chosen;
  memcpy(wanted->first.gravity, supine, sizeof supine);
  wanted->first.volume.kind = SUPINE_VOLUME_REST;
  memcpy(wanted->second.gravity, supine, sizeof supine);
}

/* Read a state, such as "supine", "prone:rest", "supine:rest+500" or "2600mL". */
static supine_status read_state(const char *text, void *field, supine_error *error) {
  supine_state *state = field;
  const supine_status status = supine_state_parse(text, state, error);
  return status == SUPINE_OK && (state->volume.kind == SUPINE_VOLUME_SCAN || state->lung_count > 0)
             ? supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                "'%s' cannot be the state of a scan: give rest, full or a volume "
                                "of both lungs, such as 2600mL",
                                text)
             : status;
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
     FILLS(first), .read = read_state, .standard = "supine:rest"},
    {"other", 0, "STATE",
     "state of the second scan, in the same form; either scan may be the fuller one. A missing "
     "volume is taken from the surfaces. With landmarks alone, give both volumes in mL. If the "
     "states are only known by two volumes, the fuller scan is at full inflation and the other one "
     "at rest, or a breath above rest if it holds less than 1.23 times as much",
     FILLS(second), .read = read_state, .standard = "supine"},
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
     "repeated, up to 8 times. A state in another posture determines how strongly the "
     "displacement depends on gravity (--gain of 'supine precompute'); for a state in the same "
     "posture, only the size of the displacement is fitted. All other constants come from the two "
     "scans",
     .read = read_further, .wants = "STATE:FILE (at most 8 times), such as prone:rest:prone.ply"},
    {"midline", 0, "X",
     "x of the plane between the lungs, in mm and LPS; default the middle of the points",
     FILLS(source.midline), SUPINE_SAYS_GIVEN(request, source.has_midline),
     .wants = "a number of mm", .more = true},
    {.table = supine_options_surface_frame, FILLS(source.load)},
    {"expandability", 0, NULL,
     "for surfaces: instead of kriging, fit the expandability (the inverse of the stiffness) of "
     "regions about 45 mm wide, relative to the deep law with one factor for each axis. The result "
     "is used only if it lowers the held-out residual by 5 % or more",
     FILLS(expandability), .more = true},
    {"map", 0, "FILE",
     "with --expandability: write the expandability of every vertex of the fuller scan, and how "
     "far the surfaces determine it, 0 (not at all) to 1. 'supine precompute --expandability' "
     "reads "
     "the .csv; a .vtp or .ply has both as colours of the surface",
     FILLS(map), .file = SUPINE_FILE_OUT, .endings = ".csv, .vtp or .ply", .more = true},
    {"json", 0, NULL, "print JSON instead of text", FILLS(json)},
    {.name = NULL}};

/* Print the fitted model as JSON, or as text without kriging centres and local expandability. */
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

/* Return the volume of the lungs in a scan, mL; 0 if it has no surface. */
static double volume_of(const supine_lungs *lungs) {
  return lungs->volume[0] + lungs->volume[1];
}

/* Assign each landmark to the lung whose surface is nearest to it in the first scan. */
static supine_status find_sides(const supine_lungs *lungs, supine_patient_pairs *pairs,
                                supine_error *error) {
  SUPINE_FREED_BY(supine_inside_surface_drop) supine_inside_surface *tree = NULL;
  pairs->side = malloc(pairs->count * sizeof *pairs->side);
  if (pairs->side == NULL) {
    return supine_error_memory(error, "%zu landmarks", pairs->count);
  }
  SUPINE_TRY(supine_inside_surface_create(lungs->mesh.vertices, lungs->mesh.triangle_count,
                                          lungs->mesh.triangles, false, &tree, error));
  for (size_t i = 0; i < pairs->count; ++i) {
    const supine_inside_place place =
        supine_inside_surface_nearest(tree, pairs->from + 3 * i, NULL);
    const size_t lung =
        lungs->lung_count == 2 && place.triangle >= lungs->triangle_begin[1] ? 1 : 0;
    pairs->side[i] = lungs->side[lung];
  }
  return SUPINE_OK;
}

static supine_status load_pairs(const request *wanted, const char *path,
                                supine_patient_pairs *pairs, supine_error *error) {
  const bool moved = wanted->landmarks.translation || wanted->landmarks.rigid;
  SUPINE_TRY(supine_patient_pairs_load(path, wanted->landmarks.reverse, pairs, error));
  return supine_patient_pairs_check(pairs, moved, error);
}

static supine_status load_scans(const request *wanted, scan_data *data, supine_error *error) {
  if (wanted->landmarks.path != NULL) {
    SUPINE_TRY(load_pairs(wanted, wanted->landmarks.path, &data->pairs, error));
  }
  if (wanted->first_path != NULL) {
    SUPINE_TRY(supine_command_load_lungs(name, wanted->first_path, &wanted->source, &data->lungs[0],
                                         error));
  }
  if (wanted->second_path != NULL) {
    SUPINE_TRY(supine_command_load_lungs(name, wanted->second_path, &wanted->source,
                                         &data->lungs[1], error));
  }
  if (wanted->first_path != NULL && data->pairs.count > 0) {
    SUPINE_TRY(find_sides(&data->lungs[0], &data->pairs, error));
  }
  return SUPINE_OK;
}

/* Return 1 if the options say that the second state is fuller, -1 if the first is, else 0. */
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

/* Put the fuller scan first. If the options do not tell which scan is fuller, compare the volumes
 * of the surfaces or, without two surfaces, use the volume change of an affine map of the
 * landmarks. */
static supine_status order_states(const request *wanted, scan_data *data, supine_error *error) {
  /* The measured volumes contradict the options only if they differ by more than this fraction. */
  static const double volume_error = 0.02;
  const double volume[2] = {volume_of(&data->lungs[0]), volume_of(&data->lungs[1])};
  const double growth = volume[0] > 0.0 && volume[1] > 0.0 ? volume[1] / volume[0]
                        : data->pairs.count > 0 ? supine_patient_pairs_growth(&data->pairs)
                                                : 1.0;
  const int named = named_order(&wanted->first, &wanted->second);
  if ((named > 0 && growth < 1.0 - volume_error) || (named < 0 && growth > 1.0 + volume_error)) {
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "the scan given as the fuller one has only %.0f %% of the volume of the "
        "other scan: exchange --rest and --other, or give --reverse",
        100.0 * (named > 0 ? growth : 1.0 / growth));
  }
  data->second_is_fuller = named > 0 || (named == 0 && growth > 1.0);
  if (data->second_is_fuller) {
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
  SUPINE_ARENA arena = {0};
  supine_patient_row *rows = supine_arena_take(&arena, pairs->count, 3 * sizeof *rows);
  if (rows == NULL) {
    return supine_error_memory(error, "%zu landmarks", pairs->count);
  }
  record->patient.frame = supine_patient_frame_of_points(
      pairs->count, pairs->from, wanted->source.has_midline ? &wanted->source.midline : NULL);
  supine_patient_rows_of_pairs(&record->patient.frame, pairs, rows);
  return supine_patient_fit(options, rows, 0, pairs->count, &record->patient, &record->report,
                            error);
}

/* Fit one further scan, given by --state. Its landmarks pair points of the first scan with points
 * of the further scan. If the first scan is the emptier one, move the points of the first scan to
 * the fuller scan. */
static supine_status fit_further(const request *wanted, const scan_data *data, size_t which,
                                 const supine_lungs *from, supine_patient_record *record,
                                 supine_error *error) {
  const bool moved = wanted->landmarks.translation || wanted->landmarks.rigid;
  const char *path = wanted->further_path[which];
  const bool landmarks = supine_text_ends_in(path, ".csv");
  SUPINE_FREED_BY(supine_patient_pairs_free) supine_patient_pairs pairs = {0};
  SUPINE_FREED_BY(supine_lungs_free) supine_lungs lungs = {0};
  supine_patient_further *further = &record->further[record->further_count++];
  *further = (supine_patient_further){.state = wanted->further[which]};
  SUPINE_TRY(landmarks ? load_pairs(wanted, path, &pairs, error)
                       : supine_command_load_lungs(name, path, &wanted->source, &lungs, error));
  if (landmarks && data->second_is_fuller) {
    supine_patient_points_to_fuller(&record->patient, pairs.count, pairs.from);
  }
  return supine_patient_gain_fit(record, from, landmarks ? &pairs : NULL,
                                 landmarks ? NULL : &lungs.mesh, moved, further, error);
}

/* Fit the scans given by --state, and set the factor of the gravity-dependent force. If the fuller
 * scan has no surface, move the surface of the emptier scan to the fuller state. */
static supine_status fit_gravity_factor(const request *wanted, scan_data *data,
                                        supine_patient_record *record, supine_error *error) {
  supine_lungs *from = &data->lungs[0];
  if (from->mesh.vertex_count == 0) {
    from = &data->lungs[1];
    supine_patient_points_to_fuller(&record->patient, from->mesh.vertex_count, from->mesh.vertices);
    supine_lungs_measure(from);
  }
  for (size_t k = 0; k < wanted->further_count; ++k) {
    SUPINE_TRY(fit_further(wanted, data, k, from, record, error));
  }
  supine_patient_gain_set(record);
  return SUPINE_OK;
}

/* If only the volumes of the scans are known, count the emptier scan as rest. Count the fuller scan
 * as full inflation, unless the other holds more of it than lungs at rest do. */
static void name_volumes(supine_patient_record *record) {
  static const double rest_most = 0.81; /* largest share at rest of ten patients with COPD */
  const double *v = record->volume;
  if (record->state[0].volume.kind == SUPINE_VOLUME_ABSOLUTE &&
      record->state[1].volume.kind == SUPINE_VOLUME_ABSOLUTE) {
    const bool breath = v[1] > rest_most * v[0];
    record->state[1].volume = (supine_volume){SUPINE_VOLUME_REST, 0.0};
    record->state[0].volume = breath ? (supine_volume){SUPINE_VOLUME_REST, v[0] - v[1]}
                                     : (supine_volume){SUPINE_VOLUME_FULL, 0.0};
    supine_options_say(name, "note: the scan of %.0f mL counts as rest, that of %.0f mL as %s",
                       v[1], v[0], breath ? "a breath above it" : "full inflation");
  }
}

/* Set the volume of scan k (0 or 1), if it was not given, to that of its surface. If the volume of
 * the other scan is relative to full inflation, or to rest in the same posture, make this one
 * relative too; otherwise absolute. */
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
  record->from_surface = wanted->second_path != NULL;
  record->state[data->second_is_fuller ? 1 : 0] = wanted->first;
  record->state[data->second_is_fuller ? 0 : 1] = wanted->second;
  for (size_t k = 0; k < 2; ++k) {
    const supine_volume *volume = &record->state[k].volume;
    record->volume[k] = volume_of(&data->lungs[k]);
    if (record->volume[k] == 0.0 && volume->kind == SUPINE_VOLUME_ABSOLUTE) {
      record->volume[k] = volume->ml;
    }
  }
  complete_state(record, 0);
  complete_state(record, 1);
  name_volumes(record);
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

/* Warn if the volume at rest in the scans differs from the volume at rest of healthy people. */
static void warn_of_rest(const supine_patient_record *record) {
  const supine_resting usual = supine_reference_resting_default();
  const double *g = record->state[1].gravity;
  supine_resting shown = usual;
  supine_patient_resting(record, &shown);
  const double share[2] = {supine_reference_resting_total(&usual, g),
                           supine_reference_resting_total(&shown, g)};
  if (fabs(share[1] - share[0]) > SUPINE_REST_SPREAD) {
    supine_options_say(name,
                       "warning: the volume at rest is %.0f %% of full inflation in the two "
                       "scans, but %.0f %% in healthy people: check --rest. 'supine precompute "
                       "--patient' uses the volume in the scans",
                       100.0 * share[1], 100.0 * share[0]);
  }
}

static void set_name_and_force(const request *wanted, supine_patient_record *record) {
  const supine_model deep = supine_physics_model(SUPINE_LAW_DEEP);
  const char *path = wanted->landmarks.path != NULL ? wanted->landmarks.path : wanted->second_path;
  (void)snprintf(record->name, sizeof record->name, "%s",
                 wanted->name != NULL ? wanted->name : basename(path));
  record->force =
      supine_patient_force(&record->patient.power, deep.force.gain, record->state[1].gravity);
}

/* Write the expandability of every vertex, and how far it is determined, to a CSV file or as
 * scalars of the surface. */
static supine_status write_map(const char *path, const supine_lungs *lungs,
                               const supine_patient_stiffness *stiffness, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  supine_output output = {0};
  SUPINE_ARENA arena = {0};
  float *a = supine_arena_take(&arena, n, sizeof *a);
  float *determined = supine_arena_zeros(&arena, n, sizeof *determined);
  if (arena.failed) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  for (size_t i = 0; i < n; ++i) {
    double shares[SUPINE_PATIENT_REGIONS_MAX];
    supine_patient_stiffness_shares(stiffness, lungs, i, shares);
    a[i] = stiffness->count == 0 ? 1.0F : 0.0F;
    for (size_t k = 0; k < stiffness->count; ++k) {
      a[i] += (float)(shares[k] * stiffness->region[k].expandability);
      determined[i] += (float)(shares[k] * stiffness->region[k].determined);
    }
  }
  if (!supine_text_ends_in(path, ".csv")) {
    const supine_mesh_save_options save = {
        .scalars = {{"expandability", a}, {"determined", determined}}};
    return supine_mesh_save(path, &lungs->mesh, &save, error);
  }
  SUPINE_TRY(supine_output_open(path, &output, error));
  (void)fputs("vertex,x_mm,y_mm,z_mm,expandability,determined\n", output.file);
  for (size_t i = 0; i < n; ++i) {
    const double *p = lungs->mesh.vertices + 3 * i;
    (void)fprintf(output.file, "%zu,%.6g,%.6g,%.6g,%.5g,%.3g\n", i, p[0], p[1], p[2], (double)a[i],
                  (double)determined[i]);
  }
  return supine_output_commit(&output, error);
}

static void free_scans(scan_data *data) {
  supine_lungs_free(&data->lungs[0]);
  supine_lungs_free(&data->lungs[1]);
  supine_patient_pairs_free(&data->pairs);
}

static supine_status fit(const request *wanted, supine_patient_record *record,
                         supine_error *error) {
  supine_patient_fit_options options = {
      .law = (supine_patient_law)wanted->law,
      .scan_motion = wanted->landmarks.rigid         ? SUPINE_PATIENT_RIGID
                     : wanted->landmarks.translation ? SUPINE_PATIENT_TRANSLATION
                                                     : SUPINE_PATIENT_STILL};
  SUPINE_FREED_BY(free_scans) scan_data data = {0};
  double gains[2][3];
  SUPINE_TRY(load_scans(wanted, &data, error));
  SUPINE_TRY(order_states(wanted, &data, error));
  set_states(wanted, &data, record);
  if (wanted->second_path == NULL && !(record->volume[0] > 0.0 && record->volume[1] > 0.0)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "landmarks do not show the volume of the lungs, which decides what "
                            "rest and full inflation are: give both volumes of gas and tissue, "
                            "such as --rest 2600mL --other 5400mL, or both surfaces");
  }
  memcpy(options.gravity, record->state[1].gravity, sizeof options.gravity);
  warn_of_rest(record);
  supine_patient_path(record, gains);
  for (size_t k = 0; k < 3; ++k) {
    options.path_span[k] = gains[1][k] - gains[0][k];
  }
  SUPINE_TRY(wanted->second_path != NULL
                 ? supine_patient_fit_surface(&data.lungs[0], &data.lungs[1].mesh, &data.pairs,
                                              &options, wanted->expandability, record, error)
                 : fit_landmarks(wanted, &data.pairs, &options, record, error));
  set_name_and_force(wanted, record);
  SUPINE_TRY(fit_gravity_factor(wanted, &data, record, error));
  return wanted->map != NULL ? write_map(wanted->map, &data.lungs[0], &record->stiffness, error)
                             : SUPINE_OK;
}

/* Take the file names from the command line, and check that they fit the options. */
static supine_status check(request *wanted, const supine_arguments *given, supine_error *error) {
  bool further_surfaces = false;
  wanted->first_path = given->count > 0 ? given->operand[0] : NULL;
  wanted->second_path = given->count > 1 ? given->operand[1] : NULL;
  for (size_t k = 0; k < wanted->further_count; ++k) {
    further_surfaces = further_surfaces || !supine_text_ends_in(wanted->further_path[k], ".csv");
  }
  const char *wrong =
      wanted->landmarks.path == NULL && wanted->second_path == NULL
          ? "nothing to fit to: give --landmarks, the surfaces of both scans, or both"
      : further_surfaces && wanted->first_path == NULL
          ? "--state with a surface needs a first scan: name the surface of the first scan too"
      : wanted->expandability && wanted->second_path == NULL
          ? "--expandability needs surfaces: give those of both scans"
      : wanted->map != NULL && !wanted->expandability
          ? "--map writes what --expandability finds: give both"
      : wanted->expandability && wanted->has_law && wanted->law == SUPINE_PATIENT_PAPER
          ? "--expandability uses the deep law: leave --law out"
          : NULL;
  return wrong != NULL ? supine_error_set(error, SUPINE_ERROR_ARGUMENT, "%s", wrong) : SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  static supine_patient_record record; /* static, as it is too large for the stack */
  SUPINE_TRY(check(wanted, given, error));
  SUPINE_TRY(fit(wanted, &record, error));
  SUPINE_TRY(print(&record, given->made_by, wanted->json, error));
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
        "For surfaces, the report also gives the force that the measured displacement implies, and "
        "the part of it that equation (18) of Santhanam 2008 does not explain.\n"
        "\n"
        "Examples:\n"
        "  supine fit --landmarks pairs.csv --translation --rest 2600mL --other 5400mL "
        "-o patient.json\n"
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
