/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read a patient's record from JSON. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <jansson.h>

#include "precompute/patient/patient_file.h"
#include "precompute/patient/patient_keys.h"

#include "base/arena.h"
#include "base/locale.h"

/* The first key that is missing or has an invalid value, with the key of the object that contains
 * it, such as "frame.lungs"; empty as long as all is valid. After a failure, readers return 0. */
typedef struct reader {
  char invalid[64];
} reader;

/* An object of the JSON text. */
typedef struct object {
  reader *reader;
  const char *key;    /* key in the root, or NULL for the root itself */
  const json_t *json; /* NULL if missing */
} object;

static void fail(const object *from, const char *key) {
  char *text = from->reader->invalid;
  if (text[0] == '\0') {
    (void)snprintf(text, sizeof from->reader->invalid, "%s%s%s", from->key != NULL ? from->key : "",
                   from->key != NULL ? "." : "", key);
  }
}

static bool failed(const object *from) {
  return from->reader->invalid[0] != '\0';
}

static bool has(const object *from, const char *key) {
  return json_object_get(from->json, key) != NULL;
}

/* Return an object of the root, which may be missing. */
static object find(const object *root, const char *key) {
  return (object){root->reader, key, json_object_get(root->json, key)};
}

static double read_number(const object *from, const char *key, const json_t *value) {
  const double number = json_number_value(value);
  if (!json_is_number(value) || !isfinite(number)) {
    fail(from, key);
    return 0.0;
  }
  return number;
}

static double read_real(const object *from, const char *key) {
  return read_number(from, key, json_object_get(from->json, key));
}

/* Return a number that is 0 if its key is missing. */
static double read_real_if(const object *from, const char *key) {
  return has(from, key) ? read_real(from, key) : 0.0;
}

static void read_reals(const object *from, const char *key, size_t count, double *values) {
  const json_t *array = json_object_get(from->json, key);
  if (!json_is_array(array) || json_array_size(array) != count) {
    fail(from, key);
    return;
  }
  for (size_t i = 0; i < count; ++i) {
    values[i] = read_number(from, key, json_array_get(array, i));
  }
}

/* Read numbers that stay as they are if their key is missing. */
static void read_reals_if(const object *from, const char *key, size_t count, double *values) {
  if (has(from, key)) {
    read_reals(from, key, count, values);
  }
}

static size_t read_count(const object *from, const char *key) {
  const json_t *value = json_object_get(from->json, key);
  if (!json_is_integer(value) || json_integer_value(value) < 0) {
    fail(from, key);
    return 0;
  }
  return (size_t)json_integer_value(value);
}

static bool read_bool(const object *from, const char *key) {
  const json_t *value = json_object_get(from->json, key);
  if (!json_is_boolean(value)) {
    fail(from, key);
  }
  return json_is_true(value);
}

static const char *read_text(const object *from, const char *key) {
  const char *text = json_string_value(json_object_get(from->json, key));
  if (text == NULL) {
    fail(from, key);
    return "";
  }
  return text;
}

/* Read one of `count` words, and return its index; 0 if it is another one. */
static size_t read_word(const object *from, const char *key, const char *const *words,
                        size_t count) {
  const char *text = read_text(from, key);
  for (size_t k = 0; k < count; ++k) {
    if (strcmp(text, words[k]) == 0) {
      return k;
    }
  }
  fail(from, key);
  return 0;
}

static int read_lung(const object *from) {
  const int side = (int)read_word(from, "lung", supine_patient_lungs_words, 3) - 1;
  if (side == 0) { /* "both" */
    fail(from, "lung");
  }
  return side;
}

static void read_box(const object *from, double low[3], double high[3]) {
  read_reals(from, "minimum_mm", 3, low);
  read_reals(from, "maximum_mm", 3, high);
  for (size_t k = 0; k < 3; ++k) {
    if (!(low[k] < high[k])) {
      fail(from, "maximum_mm");
    }
  }
}

static void read_frame(const object *root, supine_patient_record *record) {
  static const char *const measured_on[2] = {"landmarks", "surface"};
  supine_patient_frame *frame = &record->patient.frame;
  const object from = find(root, "frame");
  frame->only_side = (int)read_word(&from, "lungs", supine_patient_lungs_words, 3) - 1;
  record->from_surface = read_word(&from, "of", measured_on, 2) == 1;
  read_box(&from, frame->minimum, frame->maximum);
  frame->midline = read_real(&from, "midline_mm");
  const bool between = frame->midline > frame->minimum[0] && frame->midline < frame->maximum[0];
  if (frame->only_side == 0 && !between) {
    fail(&from, "midline_mm");
  }
}

static void read_scan(const object *root, size_t state, supine_patient_record *record) {
  const object from = find(root, supine_patient_state_words[state]);
  supine_state *shown = &record->state[state];
  const char *text = read_text(&from, "state");
  const supine_status status = supine_state_parse(text, shown, NULL);
  const double *g = shown->gravity;
  if (status != SUPINE_OK || (g[0] == 0.0 && g[1] == 0.0 && g[2] == 0.0)) {
    fail(&from, "state");
  }
  record->volume[state] = read_real_if(&from, "volume_ml");
  read_reals_if(&from, "left_right_ml", 2, record->measured_lung[state]);
}

/* Return the array `key`, of at most `most` objects, or NULL. */
static const json_t *read_list(const object *from, const char *key, size_t most) {
  const json_t *list = json_object_get(from->json, key);
  if (!json_is_array(list) || json_array_size(list) > most) {
    fail(from, key);
    return NULL;
  }
  return list;
}

static void read_correction(const object *root, supine_patient *patient) {
  const object from = find(root, "correction");
  const json_t *list = read_list(&from, "centres", SUPINE_PATIENT_CENTRES_MAX);
  patient->centre_count = json_array_size(list);
  for (size_t i = 0; i < patient->centre_count; ++i) {
    const object one = {root->reader, "centres", json_array_get(list, i)};
    supine_patient_centre *centre = &patient->centre[i];
    centre->side = read_lung(&one);
    read_reals(&one, "offset_mm", 3, centre->offset);
    centre->size = read_real(&one, "displacement_mm");
    read_reals(&one, "weight_per_mm", 3, centre->weight);
    if (centre->size < 0.0) {
      fail(&one, "displacement_mm");
    }
  }
}

static void read_scores(const object *from, double scores[SUPINE_PATIENT_SCORES]) {
  for (size_t k = 0; k < SUPINE_PATIENT_SCORES; ++k) {
    scores[k] = read_real(from, supine_patient_score_keys[k]);
  }
}

static void read_report(const object *root, supine_patient_fit_report *report) {
  const object fitted = find(root, "fitted_rms_mm");
  const object held_out = find(root, "held_out_rms_mm");
  report->points = read_count(root, "points");
  report->blocks = read_count(root, "blocks");
  read_scores(&fitted, report->fitted);
  read_scores(&held_out, report->held_out);
  report->baseline = read_real(&held_out, "baseline");
  report->explained = read_real(root, "explained_percent");
  report->stretch = read_real(root, "error_in_fuller_scan");
  report->expected_point = read_real(root, "expected_rms_mm");
  report->expected_constant = read_real(root, "expected_constant_mm");
  report->expected_from = read_real(root, "expected_from_mm");
  report->has_band = has(root, "band_95_percent_holds");
  report->band = read_real_if(root, "band_95_percent_holds");
  report->has_errors = has(root, "standard_errors");
  read_reals_if(root, "standard_errors", SUPINE_PATIENT_CONSTANTS, report->error);
}

static void read_law(const object *root, supine_patient_record *record) {
  supine_patient_power *power = &record->patient.power;
  const object box = find(root, "emptier_frame");
  const object force = find(root, "force");
  const object motion = find(root, "motion");
  record->patient.law = (supine_patient_law)read_word(root, "law", supine_patient_law_names,
                                                      SUPINE_PATIENT_LAW_COUNT);
  read_box(&box, record->emptier[0], record->emptier[1]);
  record->force.pair = true;
  record->force.base = read_real(&force, "base");
  record->force.gain = read_real(&force, "gain");
  record->gain_fitted = has(&force, "gain_standard_error");
  record->gain_error = read_real_if(&force, "gain_standard_error");
  read_reals(&force, "box", 3, record->force.box);
  read_reals(&motion, "translation_mm", 3, power->motion);
  read_reals(&motion, "rotation_rad", 3, power->motion + 3);
  read_reals(root, "c1_to_c9", SUPINE_PATIENT_CONSTANTS, power->c);
}

static void read_basis(const object *root, supine_patient_record *record) {
  const object from = find(root, "basis");
  record->in_basis = from.json != NULL;
  if (record->in_basis) {
    record->shown = read_word(&from, "scan", supine_patient_state_words, 2);
    read_reals(&from, "path_span", 3, record->path_span);
  }
}

static void read_surface(const object *root, supine_patient_surface_report *surface) {
  const object from = find(root, "surface");
  if (from.json != NULL) {
    surface->vertices = read_count(&from, "vertices");
    surface->matched = read_real_if(&from, "matched_share");
    surface->before = read_real_if(&from, "rms_before_mm");
    surface->after = read_real_if(&from, "rms_after_mm");
  }
}

static void read_regions(const object *from, supine_patient_stiffness *stiffness) {
  const json_t *list = read_list(from, "regions", SUPINE_PATIENT_REGIONS_MAX);
  stiffness->count = json_array_size(list);
  for (size_t k = 0; k < stiffness->count; ++k) {
    const object one = {from->reader, "regions", json_array_get(list, k)};
    supine_patient_region *region = &stiffness->region[k];
    region->side = read_lung(&one);
    region->expandability = read_real(&one, "expandability");
    read_reals(&one, "centre_mm", 3, region->centre);
    region->radius = read_real(&one, "radius_mm");
    region->determined = read_real(&one, "determined");
    if (!(region->expandability > 0.0)) {
      fail(&one, "expandability");
    }
    if (!(region->radius > 0.0)) {
      fail(&one, "radius_mm");
    }
  }
}

static void read_expandability(const object *root, supine_patient_record *record) {
  supine_patient_expand_report *expand = &record->expand;
  const object from = find(root, "expandability");
  expand->tried = from.json != NULL;
  if (expand->tried) {
    expand->undetermined = read_count(&from, "unseen_regions");
    read_reals_if(&from, "fitted_without_and_with_mm", 2, expand->fitted);
    read_reals_if(&from, "held_out_without_and_with_mm", 2, expand->held_out);
    expand->kept = read_bool(&from, "kept");
  }
  if (has(&from, "regions")) {
    read_regions(&from, &record->stiffness);
  }
}

static void read_applied(const object *root, supine_patient_applied *applied) {
  const object from = find(root, "applied_force");
  if (from.json != NULL) {
    applied->from_landmarks =
        has(&from, "computed_from") &&
        read_word(&from, "computed_from", supine_patient_applied_words, 2) == 1;
    applied->blocks = read_count(&from, "blocks");
    applied->correlation = read_real_if(&from, "correlation_with_height");
    read_reals_if(&from, "c7_to_c9", 3, applied->slopes);
    applied->residual = read_real_if(&from, "left_rms");
    applied->spread = read_real_if(&from, "spread_rms");
  }
}

/* Read the members of a file of the version that this program writes. */
static void read_record(const object *root, supine_patient_record *record) {
  (void)snprintf(record->name, sizeof record->name, "%s", read_text(root, "name"));
  read_frame(root, record);
  read_scan(root, 0, record);
  read_scan(root, 1, record);
  read_correction(root, &record->patient);
  read_report(root, &record->report);
  read_law(root, record);
  read_basis(root, record);
  read_surface(root, &record->surface);
  read_expandability(root, record);
  read_applied(root, &record->applied);
}

static supine_status check_version(const char *name, const json_t *root, supine_error *error) {
  const char *format = json_string_value(json_object_get(root, "format"));
  const json_t *version = json_object_get(root, "version");
  const bool known = format != NULL && strcmp(format, SUPINE_PATIENT_FORMAT) == 0;
  SUPINE_REFUSE_IF(!known || !json_is_integer(version), error, SUPINE_ERROR_FORMAT,
                   "%s: not a patient file: make one with 'supine fit'", name);
  SUPINE_REFUSE_IF(json_integer_value(version) != SUPINE_PATIENT_VERSION, error,
                   SUPINE_ERROR_FORMAT,
                   "%s: a patient file of version %" JSON_INTEGER_FORMAT
                   ", but only version %d can be read: make a new one with 'supine fit'",
                   name, json_integer_value(version), SUPINE_PATIENT_VERSION);
  return SUPINE_OK;
}

/* Decode the record in `json`, which is NULL if the text is no JSON. */
static supine_status decode(const char *name, const json_t *json, const json_error_t *where,
                            supine_patient_record *record, supine_error *error) {
  reader state = {.invalid = ""};
  const object root = {&state, NULL, json};
  SUPINE_REFUSE_IF(json == NULL, error, SUPINE_ERROR_FORMAT, "%s:%d: %s", name, where->line,
                   where->text);
  SUPINE_TRY(check_version(name, json, error));
  memset(record, 0, sizeof *record);
  read_record(&root, record);
  SUPINE_REFUSE_IF(failed(&root), error, SUPINE_ERROR_FORMAT,
                   "%s: \"%s\" is missing or invalid: make a new file with 'supine fit'", name,
                   state.invalid);
  return SUPINE_OK;
}

supine_status supine_patient_decode(const char *name, const char *text,
                                    supine_patient_record *record, supine_error *error) {
  SUPINE_C_LOCALE;
  json_error_t where;
  json_t *root = json_loads(text, 0, &where);
  const supine_status status = decode(name, root, &where, record, error);
  json_decref(root);
  return status;
}

supine_status supine_patient_read(const char *path, supine_patient_record *record,
                                  supine_error *error) {
  SUPINE_C_LOCALE;
  json_error_t where;
  FILE *file = fopen(path, "rb");
  SUPINE_REFUSE_IF(file == NULL, error, SUPINE_ERROR_READ, "%s: cannot open: %s", path,
                   strerror(errno));
  json_t *root = json_loadf(file, 0, &where);
  (void)fclose(file);
  const supine_status status = decode(path, root, &where, record, error);
  json_decref(root);
  return status;
}
