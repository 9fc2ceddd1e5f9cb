/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write and read patient.json. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "precompute/patient/patient_file.h"

#include "base/arena.h"
#include "base/locale.h"
#include "base/output.h"

static const char format[] = "supine-patient";
enum {
  VERSION = 4,
  CENTRE = sizeof(supine_patient_centre) / sizeof(double),
  REGION = sizeof(supine_patient_region) / sizeof(double)
};

/* Where a number or an array of numbers is in supine_patient_record and in the JSON file. */
typedef struct numbers {
  const char *group; /* key of the enclosing object, or NULL for the root */
  const char *key;
  size_t count;  /* 1 for a number, more for an array */
  size_t offset; /* offset of the first number in supine_patient_record, bytes */
  bool optional; /* may be missing in the file; not written if all numbers are 0 */
} numbers;

#define AT(member) offsetof(supine_patient_record, member)
#define SCORE(key, score)                                                                          \
  {"fitted_rms_mm", key, 1, AT(report.fitted[SUPINE_PATIENT_SCORE_##score]), false}, {             \
    "held_out_rms_mm", key, 1, AT(report.held_out[SUPINE_PATIENT_SCORE_##score]), false            \
  }

static const numbers table[] = {
    {NULL, "points", 1, AT(report.points), false},
    {NULL, "blocks", 1, AT(report.blocks), false},
    SCORE("none", NONE),
    SCORE("translation", TRANSLATION),
    SCORE("affine", AFFINE),
    SCORE("law", LAW),
    SCORE("corrected", CORRECTED),
    {"held_out_rms_mm", "baseline", 1, AT(report.baseline), false},
    {NULL, "explained_percent", 1, AT(report.explained), false},
    {NULL, "error_in_fuller_scan", 1, AT(report.stretch), true},
    {NULL, "expected_rms_mm", 1, AT(report.expected_point), false},
    {NULL, "expected_constant_mm", 1, AT(report.expected_constant), false},
    {NULL, "expected_from_mm", 1, AT(report.expected_from), false},
    {NULL, "band_95_percent_holds", 1, AT(report.band), true},
    {"frame", "minimum_mm", 3, AT(patient.frame.minimum), false},
    {"frame", "maximum_mm", 3, AT(patient.frame.maximum), false},
    {"frame", "midline_mm", 1, AT(patient.frame.midline), false},
    {"emptier_frame", "minimum_mm", 3, AT(emptier[0]), false},
    {"emptier_frame", "maximum_mm", 3, AT(emptier[1]), false},
    {"fuller", "volume_ml", 1, AT(volume[0]), true},
    {"emptier", "volume_ml", 1, AT(volume[1]), true},
    {"force", "base", 1, AT(force.base), false},
    {"force", "gain", 1, AT(force.gain), false},
    {"force", "gain_standard_error", 1, AT(gain_error), true},
    {"force", "box", 3, AT(force.box), false},
    {"motion", "translation_mm", 3, AT(patient.power.motion[0]), false},
    {"motion", "rotation_rad", 3, AT(patient.power.motion[3]), false},
    {NULL, "c1_to_c9", SUPINE_PATIENT_CONSTANTS, AT(patient.power.c), false},
    {NULL, "standard_errors", SUPINE_PATIENT_CONSTANTS, AT(report.error), true},
    {"basis", "emptier_scan", 1, AT(shown), true},
    {"basis", "path_span", 3, AT(path_span), true},
    {"surface", "vertices", 1, AT(surface.vertices), true},
    {"surface", "matched_share", 1, AT(surface.matched), true},
    {"surface", "rms_before_mm", 1, AT(surface.before), true},
    {"surface", "rms_after_mm", 1, AT(surface.after), true},
    {"expandability", "unseen_regions", 1, AT(expand.undetermined), true},
    {"expandability", "fitted_without_and_with_mm", 2, AT(expand.fitted), true},
    {"expandability", "held_out_without_and_with_mm", 2, AT(expand.held_out), true},
    {"applied_force", "blocks", 1, AT(applied.blocks), true},
    {"applied_force", "correlation_with_height", 1, AT(applied.correlation), true},
    {"applied_force", "c7_to_c9", 3, AT(applied.slopes), true},
    {"applied_force", "left_rms", 1, AT(applied.residual), true},
    {"applied_force", "spread_rms", 1, AT(applied.spread), true}};

static json_t *array_of(const double *values, size_t count) {
  json_t *array = json_array();
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(array, json_real(values[i]));
  }
  return array;
}

/* Return the root if `key` is NULL. Otherwise, return its member `key`; add it if missing. */
static json_t *group_of(json_t *root, const char *key) {
  if (key != NULL && json_object_get(root, key) == NULL) {
    (void)json_object_set_new(root, key, json_object());
  }
  return key != NULL ? json_object_get(root, key) : root;
}

static json_t *state_text(const supine_state *state) {
  char text[SUPINE_PATIENT_STATE_TEXT];
  (void)supine_state_print(state, text, sizeof text);
  return json_string(text);
}

static const char *const sides[3] = {"right", "both", "left"};

static json_t *list_of(const void *values, size_t width, size_t count) {
  json_t *all = json_array();
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(all, array_of((const double *)values + width * i, width));
  }
  return all;
}

json_t *supine_patient_encode(const supine_patient_record *record, const char *made_by) {
  const supine_patient *patient = &record->patient;
  json_t *further_states = json_array();
  json_t *root = json_pack(
      "{s:s, s:i, s:s, s:s, s:{s:s, s:s}, s:{s:o}, s:{s:o}, s:{s:o}, s:o, s:s*}", "format", format,
      "version", VERSION, "name", record->name, "law", supine_patient_law_names[patient->law],
      "frame", "lungs", sides[1 + patient->frame.only_side], "of",
      record->from_surface ? "surface" : "landmarks", "fuller", "state",
      state_text(&record->state[0]), "emptier", "state", state_text(&record->state[1]),
      "correction", "centres", list_of(patient->centre, CENTRE, patient->centre_count),
      "further_states", further_states, "made_by", made_by);
  for (size_t i = 0; i < sizeof table / sizeof *table && root != NULL; ++i) {
    const double *values = (const double *)((const char *)record + table[i].offset);
    bool present = !table[i].optional;
    for (size_t k = 0; k < table[i].count; ++k) {
      present = present || values[k] != 0.0;
    }
    if (present) {
      (void)json_object_set_new(group_of(root, table[i].group), table[i].key,
                                table[i].count == 1 ? json_real(*values)
                                                    : array_of(values, table[i].count));
    }
  }
  for (size_t k = 0; k < record->further_count && root != NULL; ++k) {
    const supine_patient_further *further = &record->further[k];
    (void)json_array_append_new(
        further_states,
        json_pack("{s:o, s:o, s:f, s:f}", "state", state_text(&further->state), "scale",
                  array_of(further->scale, 2), "left_rms_mm", further->residual,
                  "left_without_gain_mm", further->residual_without_gain));
  }
  if (record->stiffness.count > 0) {
    (void)json_object_set_new(group_of(root, "expandability"), "regions",
                              list_of(record->stiffness.region, REGION, record->stiffness.count));
  }
  if (record->expand.tried) {
    (void)json_object_set_new(group_of(root, "expandability"), "kept",
                              json_boolean(record->expand.kept));
  }
  (void)json_object_set_new(
      group_of(root, "force"), "gain_from",
      json_string(
          record->gain_undetermined ? "the deep law: the scans of --state do not determine the gain"
          : record->gain_error > 0.0 ? "the states in other postures"
                                     : "the deep law: scans in one posture do not determine the "
                                       "gain; give --state in another posture"));
  return root;
}

char *supine_patient_text(const supine_patient_record *record, const char *made_by) {
  SUPINE_C_LOCALE;
  json_t *root = supine_patient_encode(record, made_by);
  char *text = root == NULL ? NULL : json_dumps(root, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
  json_decref(root);
  return text;
}

supine_status supine_patient_write(const char *path, const supine_patient_record *record,
                                   const char *made_by, supine_error *error) {
  supine_output output = {0};
  char *text = supine_patient_text(record, made_by);
  SUPINE_REFUSE_IF(text == NULL, error, SUPINE_ERROR_MEMORY, "no memory for %s", path);
  supine_status status = supine_output_open(path, &output, error);
  if (status == SUPINE_OK) {
    (void)fprintf(output.file, "%s\n", text);
    status = supine_output_commit(&output, error);
  }
  free(text);
  return status;
}

/* Read `count` finite numbers: an array, or a number if the count is 1. */
static bool read_numbers(const json_t *from, size_t count, double *values) {
  bool valid = count == 1 || json_array_size(from) == count;
  for (size_t i = 0; valid && i < count; ++i) {
    const json_t *value = count == 1 ? from : json_array_get(from, i);
    values[i] = json_number_value(value);
    valid = json_is_number(value) && isfinite(values[i]);
  }
  return valid;
}

static const char *text_of(const json_t *root, const char *group, const char *key) {
  const char *text =
      json_string_value(json_object_get(group != NULL ? json_object_get(root, group) : root, key));
  return text != NULL ? text : "";
}

/* Return the index of a word in a list, or `count` if the word is missing. */
static int find_word(const char *word, const char *const *words, int count) {
  int k = 0;
  while (k < count && strcmp(word, words[k]) != 0) {
    ++k;
  }
  return k;
}

static bool read_state(const char *text, supine_state *state) {
  return supine_state_parse(text, state, NULL) == SUPINE_OK &&
         (state->gravity[0] != 0.0 || state->gravity[1] != 0.0 || state->gravity[2] != 0.0);
}

static bool is_box(const double low[3], const double high[3]) {
  return low[0] < high[0] && low[1] < high[1] && low[2] < high[2];
}

static bool read_frame(const json_t *root, supine_patient_record *record) {
  supine_patient_frame *frame = &record->patient.frame;
  const int side = find_word(text_of(root, "frame", "lungs"), sides, 3);
  const char *measured_on = text_of(root, "frame", "of");
  frame->only_side = side - 1;
  record->from_surface = strcmp(measured_on, "surface") == 0;
  return side < 3 && measured_on[0] != '\0' && is_box(frame->minimum, frame->maximum) &&
         (frame->only_side != 0 ||
          (frame->midline > frame->minimum[0] && frame->midline < frame->maximum[0]));
}

/* Read an array that contains at most `limit` arrays, each with `width` numbers. */
static bool read_list(const json_t *from, size_t width, size_t limit, void *values, size_t *count) {
  bool valid = json_is_array(from) && json_array_size(from) <= limit;
  *count = 0;
  for (; valid && *count < json_array_size(from); ++*count) {
    valid = read_numbers(json_array_get(from, *count), width, (double *)values + width * *count);
  }
  return valid;
}

static bool read_correction(const json_t *root, supine_patient *patient) {
  bool valid = read_list(json_object_get(json_object_get(root, "correction"), "centres"), CENTRE,
                         SUPINE_PATIENT_CENTRES_MAX, patient->centre, &patient->centre_count);
  for (size_t i = 0; i < patient->centre_count; ++i) {
    valid = valid && patient->centre[i].size >= 0.0;
  }
  return valid;
}

static bool read_regions(const json_t *root, supine_patient_stiffness *stiffness) {
  const json_t *regions = json_object_get(json_object_get(root, "expandability"), "regions");
  bool valid = regions == NULL || read_list(regions, REGION, SUPINE_PATIENT_REGIONS_MAX,
                                            stiffness->region, &stiffness->count);
  for (size_t k = 0; k < stiffness->count; ++k) {
    const supine_patient_region *region = &stiffness->region[k];
    valid =
        valid && fabs(region->side) == 1.0 && region->expandability > 0.0 && region->radius > 0.0;
  }
  return valid;
}

/* Read a patient's record from JSON. Return the first key that is missing or invalid, or NULL. */
static const char *read_record(const json_t *root, supine_patient_record *record) {
  supine_patient *patient = &record->patient;
  for (size_t i = 0; i < sizeof table / sizeof *table; ++i) {
    const numbers *entry = &table[i];
    const json_t *group = entry->group != NULL ? json_object_get(root, entry->group) : root;
    const json_t *value = json_object_get(group, entry->key);
    if (!(entry->optional && value == NULL) &&
        !read_numbers(value, entry->count, (double *)((char *)record + entry->offset))) {
      return entry->group != NULL ? entry->group : entry->key;
    }
  }
  patient->law = (supine_patient_law)find_word(text_of(root, NULL, "law"), supine_patient_law_names,
                                               SUPINE_PATIENT_LAW_COUNT);
  record->force.pair = true;
  (void)snprintf(record->name, sizeof record->name, "%s", text_of(root, NULL, "name"));
  return patient->law == SUPINE_PATIENT_LAW_COUNT                            ? "law"
         : !read_frame(root, record)                                         ? "frame"
         : !read_state(text_of(root, "fuller", "state"), &record->state[0])  ? "fuller"
         : !read_state(text_of(root, "emptier", "state"), &record->state[1]) ? "emptier"
         : !is_box(record->emptier[0], record->emptier[1])                   ? "emptier_frame"
         : !read_correction(root, patient)                                   ? "correction"
         : !read_regions(root, &record->stiffness)                           ? "expandability"
                                                                             : NULL;
}

/* Decode the record in `root`, which is NULL if the text is no JSON, and release `root`. */
static supine_status decode(const char *name, json_t *root, const json_error_t *where,
                            supine_patient_record *record, supine_error *error) {
  double version = 0.0;
  SUPINE_REFUSE_IF(root == NULL, error, SUPINE_ERROR_FORMAT, "%s:%d: %s", name, where->line,
                   where->text);
  memset(record, 0, sizeof *record);
  const bool known = strcmp(text_of(root, NULL, "format"), format) == 0 &&
                     read_numbers(json_object_get(root, "version"), 1, &version) &&
                     version == VERSION;
  const char *invalid_key = known ? read_record(root, record) : NULL;
  json_decref(root);
  return !known ? supine_error_set(
                      error, SUPINE_ERROR_FORMAT,
                      "%s: not a patient file of version %d: make a new one with 'supine fit'",
                      name, VERSION)
         : invalid_key != NULL
             ? supine_error_set(
                   error, SUPINE_ERROR_FORMAT,
                   "%s: \"%s\" is missing or invalid: make a new file with 'supine fit'", name,
                   invalid_key)
             : SUPINE_OK;
}

supine_status supine_patient_decode(const char *name, const char *text,
                                    supine_patient_record *record, supine_error *error) {
  SUPINE_C_LOCALE;
  json_error_t where;
  json_t *root = json_loads(text, 0, &where);
  return decode(name, root, &where, record, error);
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
  return decode(path, root, &where, record, error);
}
