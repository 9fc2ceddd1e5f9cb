/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write and read patient.json. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "precompute/patient/patient_file.h"

#include "sh/base/output.h"

static const char format[] = "supine-patient";
enum { VERSION = 2, CENTRE = sizeof(supine_patient_centre) / sizeof(double) };

/* A number of a record, or an array of numbers. */
typedef struct numbers {
  const char *group; /* key of the object that holds them; NULL: the root */
  const char *key;
  size_t count;  /* 1: no array */
  size_t offset; /* in the record, bytes */
} numbers;

#define AT(member) offsetof(supine_patient_record, member)

/* All of them are written, and required when reading. */
static const numbers table[] = {{NULL, "points", 1, AT(points)},
                                {NULL, "held_out_rms_mm", 1, AT(held_out)},
                                {NULL, "held_out_baseline_mm", 1, AT(held_out_baseline)},
                                {NULL, "expected_rms_mm", 1, AT(expected)},
                                {NULL, "band_95_percent_holds", 1, AT(band)},
                                {NULL, "fitted_rms_mm", 1, AT(fitted)},
                                {NULL, "explained_percent", 1, AT(explained)},
                                {"frame", "minimum_mm", 3, AT(patient.frame.minimum)},
                                {"frame", "maximum_mm", 3, AT(patient.frame.maximum)},
                                {"frame", "midline_mm", 1, AT(patient.frame.midline)},
                                {"emptier_frame", "minimum_mm", 3, AT(emptier[0])},
                                {"emptier_frame", "maximum_mm", 3, AT(emptier[1])},
                                {"fuller", "volume_ml", 1, AT(volume[0])},
                                {"emptier", "volume_ml", 1, AT(volume[1])},
                                {NULL, "reach_mm", 1, AT(reach)},
                                {"force", "base", 1, AT(force.base)},
                                {"force", "gain", 1, AT(force.gain)},
                                {"force", "box", 3, AT(force.box)},
                                {"motion", "translation_mm", 3, AT(patient.power.motion[0])},
                                {"motion", "rotation_rad", 3, AT(patient.power.motion[3])},
                                {NULL, "lengths_mm", 3, AT(patient.power.lengths)},
                                {NULL, "powers", 6, AT(patient.power.powers)},
                                {NULL, "expected_constant_mm", 1, AT(expected_constant)}};

/* --- writing --------------------------------------------------------------------------------- */

static json_t *array_of(const double *values, size_t count) {
  json_t *array = json_array();
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(array, json_real(values[i]));
  }
  return array;
}

/* Find an object of the root, or make it. */
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

static void add_report(json_t *root, const supine_patient_record *record) {
  static const char *const names[SUPINE_PATIENT_CONSTANTS] = {"c1", "c2", "c3", "c4", "c5",
                                                              "c6", "c7", "c8", "c9"};
  const supine_patient_fit_report *report = &record->report;
  double c[SUPINE_PATIENT_CONSTANTS];
  json_t *constants = group_of(root, "paper_constants");
  supine_patient_constants(&record->patient.power, c);
  for (size_t k = 0; k < SUPINE_PATIENT_CONSTANTS && record->patient.law == SUPINE_PATIENT_PAPER;
       ++k) {
    (void)json_object_set_new(
        constants, names[k],
        json_pack("{s:f, s:f}", "value", c[k], "standard_error", report->error[k]));
  }
  for (size_t k = 0; k < SUPINE_PATIENT_SCORES; ++k) {
    (void)json_object_set_new(group_of(root, "fitted"), supine_patient_score_names[k],
                              json_real(report->fitted[k]));
    (void)json_object_set_new(group_of(root, "held_out"), supine_patient_score_names[k],
                              json_real(report->held_out[k]));
  }
  (void)json_object_set_new(root, "blocks", json_integer((json_int_t)report->blocks));
  (void)json_object_set_new(root, "explained_fitted_percent",
                            json_real(100.0 * report->explained_fitted));
}

static json_t *expandability(const supine_patient_record *record) {
  const supine_patient_expand_report *report = &record->expand;
  json_t *of = json_object();
  if (report->tried) {
    (void)json_object_update_new(
        of, json_pack("{s:b, s:o, s:o, s:f, s:f}", "kept", report->kept ? 1 : 0,
                      "fitted_without_and_with_mm", array_of(report->fitted, 2),
                      "held_out_without_and_with_mm", array_of(report->held_out, 2), "softest",
                      report->softest, "stiffest", report->stiffest));
  }
  for (size_t k = 0; k < record->stiffness.count; ++k) {
    const supine_patient_mode *mode = &record->stiffness.mode[k];
    const char *side = sides[1 + mode->side];
    if (json_object_get(of, side) == NULL) {
      (void)json_object_set_new(of, side, json_array());
    }
    (void)json_array_append_new(json_object_get(of, side),
                                json_pack("{s:f, s:f, s:o, s:f}", "expandability", mode->value,
                                          "seen", mode->seen, "centre_mm",
                                          array_of(mode->centre, 3), "radius_mm", mode->radius));
  }
  return of;
}

static json_t *applied(const supine_patient_applied *of) {
  return json_pack("{s:i, s:f, s:f, s:o, s:f, s:f}", "blocks", (int)of->blocks, "matched_percent",
                   100.0 * of->matched, "correlation_with_height", of->correlation, "c7_to_c9",
                   array_of(of->slopes, 3), "left_rms", of->left, "spread_rms", of->spread);
}

static json_t *further(const supine_patient_record *record) {
  json_t *all = json_array();
  for (size_t k = 0; k < record->told_count; ++k) {
    const supine_patient_told *told = &record->told[k];
    (void)json_array_append_new(all,
                                json_pack("{s:o, s:f, s:f, s:f}", "state", state_text(&told->state),
                                          "scale", told->scale, "left_rms_mm", told->left,
                                          "left_without_gain_mm", told->left_without));
  }
  return all;
}

static json_t *encode(const supine_patient_record *record, const char *made_by) {
  const supine_patient *patient = &record->patient;
  json_t *centres = json_array();
  json_t *root = json_pack("{s:s, s:i, s:s, s:s, s:{s:s, s:s}, s:{s:o}, s:{s:o}, s:{s:o}}",
                           "format", format, "version", VERSION, "name", record->name, "law",
                           supine_patient_law_names[patient->law], "frame", "lungs",
                           sides[1 + patient->frame.only_side], "of",
                           record->from_surface ? "surface" : "landmarks", "fuller", "state",
                           state_text(&record->state[0]), "emptier", "state",
                           state_text(&record->state[1]), "correction", "centres", centres);
  if (root == NULL) {
    return NULL;
  }
  for (size_t i = 0; i < sizeof table / sizeof *table; ++i) {
    const double *values = (const double *)((const char *)record + table[i].offset);
    (void)json_object_set_new(group_of(root, table[i].group), table[i].key,
                              table[i].count == 1 ? json_real(*values)
                                                  : array_of(values, table[i].count));
  }
  for (size_t i = 0; i < patient->centre_count; ++i) {
    (void)json_array_append_new(centres, array_of((const double *)&patient->centre[i], CENTRE));
  }
  if (record->told_count > 0) {
    (void)json_object_set_new(root, "further_states", further(record));
  }
  if (record->gain_told) {
    (void)json_object_set_new(root, "gain_determined", json_boolean(!record->gain_open));
    (void)json_object_set_new(root, "gain_standard_error", json_real(record->gain_error));
  }
  if (record->expand.tried || record->stiffness.count > 0) {
    (void)json_object_set_new(root, "expandability", expandability(record));
  }
  if (record->applied.blocks > 0) {
    (void)json_object_set_new(root, "applied_force", applied(&record->applied));
  }
  if (record->report.blocks > 0) {
    add_report(root, record);
  }
  if (made_by != NULL) {
    (void)json_object_set_new(root, "made_by", json_string(made_by));
  }
  return root;
}

char *supine_patient_text(const supine_patient_record *record, const char *made_by) {
  json_t *root = encode(record, made_by);
  char *text = root == NULL ? NULL : json_dumps(root, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
  json_decref(root);
  return text;
}

supine_status supine_patient_write(const char *path, const supine_patient_record *record,
                                   const char *made_by, supine_error *error) {
  supine_output output = {0};
  char *text = supine_patient_text(record, made_by);
  if (text == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %s", path);
  }
  supine_status status = supine_output_open(path, &output, error);
  if (status == SUPINE_OK) {
    (void)fprintf(output.file, "%s\n", text);
    status = supine_output_commit(&output, error);
  }
  free(text);
  return status;
}

/* --- reading --------------------------------------------------------------------------------- */

/* Read finite numbers, one or an array; false if any is missing. */
static bool take_numbers(const json_t *from, size_t count, double *values) {
  bool right = count == 1 || json_array_size(from) == count;
  for (size_t i = 0; right && i < count; ++i) {
    const json_t *value = count == 1 ? from : json_array_get(from, i);
    values[i] = json_number_value(value);
    right = json_is_number(value) && isfinite(values[i]);
  }
  return right;
}

static const char *text_of(const json_t *root, const char *group, const char *key) {
  const char *text =
      json_string_value(json_object_get(group != NULL ? json_object_get(root, group) : root, key));
  return text != NULL ? text : "";
}

/* Find a word in a list; `count` if it is not there. */
static int find_word(const char *word, const char *const *words, int count) {
  int k = 0;
  while (k < count && strcmp(word, words[k]) != 0) {
    ++k;
  }
  return k;
}

static bool take_state(const char *text, supine_state *of) {
  return supine_state_parse(text, of, NULL) == SUPINE_OK &&
         (of->gravity[0] != 0.0 || of->gravity[1] != 0.0 || of->gravity[2] != 0.0);
}

static bool is_box(const double low[3], const double high[3]) {
  return low[0] < high[0] && low[1] < high[1] && low[2] < high[2];
}

static bool take_frame(const json_t *root, supine_patient_record *record) {
  supine_patient_frame *frame = &record->patient.frame;
  const int side = find_word(text_of(root, "frame", "lungs"), sides, 3);
  const char *of = text_of(root, "frame", "of");
  frame->only_side = side - 1;
  record->from_surface = strcmp(of, "surface") == 0;
  return side < 3 && of[0] != '\0' && is_box(frame->minimum, frame->maximum) &&
         (frame->only_side != 0 ||
          (frame->midline > frame->minimum[0] && frame->midline < frame->maximum[0]));
}

static bool take_correction(const json_t *centres, supine_patient *patient) {
  patient->centre_count = json_array_size(centres);
  bool right = json_is_array(centres) && patient->centre_count <= SUPINE_PATIENT_CENTRES_MAX;
  for (size_t i = 0; right && i < patient->centre_count; ++i) {
    supine_patient_centre *of = &patient->centre[i];
    right = take_numbers(json_array_get(centres, i), CENTRE, (double *)of) && of->size >= 0.0;
  }
  return right;
}

/* Read the regions, those of the left lung first. */
static bool take_stiffness(const json_t *object, supine_patient_stiffness *stiffness) {
  bool right = true;
  for (int side = 1; side >= -1; side -= 2) {
    const json_t *all = json_object_get(object, sides[1 + side]);
    for (size_t k = 0; k < json_array_size(all) && right; ++k) {
      const json_t *of = json_array_get(all, k);
      if (stiffness->count == SUPINE_PATIENT_MODES) {
        return false;
      }
      supine_patient_mode *mode = &stiffness->mode[stiffness->count++];
      mode->side = side;
      right = take_numbers(json_object_get(of, "expandability"), 1, &mode->value) &&
              take_numbers(json_object_get(of, "seen"), 1, &mode->seen) &&
              take_numbers(json_object_get(of, "radius_mm"), 1, &mode->radius) &&
              take_numbers(json_object_get(of, "centre_mm"), 3, mode->centre) &&
              mode->value > 0.0 && mode->radius > 0.0;
    }
  }
  return right;
}

/* Read a record; return the key of what is missing or wrong, or NULL. */
static const char *take(const json_t *root, supine_patient_record *record) {
  supine_patient *patient = &record->patient;
  for (size_t i = 0; i < sizeof table / sizeof *table; ++i) {
    const numbers *of = &table[i];
    const json_t *group = of->group != NULL ? json_object_get(root, of->group) : root;
    if (!take_numbers(json_object_get(group, of->key), of->count,
                      (double *)((char *)record + of->offset))) {
      return of->group != NULL ? of->group : of->key;
    }
  }
  patient->law = (supine_patient_law)find_word(text_of(root, NULL, "law"), supine_patient_law_names,
                                               SUPINE_PATIENT_LAW_COUNT);
  record->force.pair = true;
  (void)snprintf(record->name, sizeof record->name, "%s", text_of(root, NULL, "name"));
  return patient->law == SUPINE_PATIENT_LAW_COUNT                            ? "law"
         : !take_frame(root, record)                                         ? "frame"
         : !take_state(text_of(root, "fuller", "state"), &record->state[0])  ? "fuller"
         : !take_state(text_of(root, "emptier", "state"), &record->state[1]) ? "emptier"
         : !is_box(record->emptier[0], record->emptier[1])                   ? "emptier_frame"
         : !(record->reach >= 0.0)                                           ? "reach_mm"
         : !take_correction(json_object_get(json_object_get(root, "correction"), "centres"),
                            patient)
             ? "correction"
         : !take_stiffness(json_object_get(root, "expandability"), &record->stiffness)
             ? "expandability"
             : NULL;
}

supine_status supine_patient_read(const char *path, supine_patient_record *record,
                                  supine_error *error) {
  json_error_t where;
  double version = 0.0;
  FILE *file = fopen(path, "rb");
  if (file == NULL) {
    return supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot open: %s", path, strerror(errno));
  }
  json_t *root = json_loadf(file, 0, &where);
  (void)fclose(file);
  if (root == NULL) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s:%d: %s", path, where.line, where.text);
  }
  memset(record, 0, sizeof *record);
  const bool known = strcmp(text_of(root, NULL, "format"), format) == 0 &&
                     take_numbers(json_object_get(root, "version"), 1, &version) &&
                     version == VERSION;
  const char *wrong = known ? take(root, record) : NULL;
  json_decref(root);
  return !known ? supine_error_set(error, SUPINE_ERROR_FORMAT,
                                   "%s: not a patient file of version %d: make a new one with "
                                   "'supine fit'",
                                   path, VERSION)
         : wrong != NULL
             ? supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%s: \"%s\" is missing or invalid: make a new file with "
                                "'supine fit'",
                                path, wrong)
             : SUPINE_OK;
}
