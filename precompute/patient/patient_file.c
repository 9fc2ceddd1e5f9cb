/* SPDX-License-Identifier: GPL-3.0-or-later */
/* patient.json, written and read. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "precompute/patient/patient_file.h"

#include "sh/base/output.h"

static const char format[] = "supine-patient";
enum { VERSION = 1, TERMS = SUPINE_PATIENT_TERMS };

static json_t *numbers(const double *values, size_t count) {
  json_t *array = json_array();
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(array, json_real(values[i]));
  }
  return array;
}

static json_t *scan(const supine_patient_scan *of) {
  return json_pack("{s:s, s:o, s:s}", "posture", of->posture, "gravity", numbers(of->gravity, 3),
                   "volume", of->volume);
}

static const char *side_name(int side) {
  return side > 0 ? "left" : side < 0 ? "right" : "both";
}

static json_t *scores(const supine_patient_scores *of) {
  return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f}", "none", of->none, "translation",
                   of->translation, "affine", of->affine, "affine_per_lung", of->affine_lungs,
                   "paper", of->law[SUPINE_PATIENT_PAPER], "quadratic",
                   of->law[SUPINE_PATIENT_QUADRATIC]);
}

static json_t *polynomial(const supine_patient *patient) {
  json_t *all = json_object();
  for (size_t a = 0; a < 3; ++a) {
    const double *shared = patient->polynomial + 2 * a * TERMS;
    const char axis[2] = {"xyz"[a], '\0'};
    (void)json_object_set_new(all, axis,
                              json_pack("{s:o, s:o}", "shared", numbers(shared, TERMS), "by_lung",
                                        numbers(shared + TERMS, TERMS)));
  }
  return all;
}

static void add_report(json_t *root, const supine_patient *patient,
                       const supine_patient_fit_report *report) {
  static const char *const names[SUPINE_PATIENT_CONSTANTS] = {"c1", "c2", "c3", "c4", "c5",
                                                              "c6", "c7", "c8", "c9"};
  double c[SUPINE_PATIENT_CONSTANTS];
  json_t *constants = json_object();
  supine_patient_constants(patient, c);
  for (size_t k = 0; k < SUPINE_PATIENT_CONSTANTS; ++k) {
    (void)json_object_set_new(constants, names[k],
                              json_pack("{s:f, s:f, s:f, s:f}", "value", c[k], "standard_error",
                                        report->error[k], "low", report->low[k], "high",
                                        report->high[k]));
  }
  (void)json_object_set_new(root, "paper_constants", constants);
  (void)json_object_set_new(root, "fitted", scores(&report->fitted));
  (void)json_object_set_new(root, "held_out", scores(&report->held_out));
  (void)json_object_set_new(
      root, "starts",
      json_pack("{s:o, s:i, s:f}", "rms_mm", numbers(report->starts, SUPINE_PATIENT_STARTS),
                "agreeing", (int)report->starts_agreeing, "apart_mm", report->start_apart));
  (void)json_object_set_new(
      root, "ridge",
      json_pack("{s:f, s:f}", "quadratic", report->ridge_quadratic, "lung", report->ridge_lung));
  (void)json_object_set_new(root, "blocks", json_integer((json_int_t)report->blocks));
  (void)json_object_set_new(root, "explained_fitted_percent",
                            json_real(100.0 * report->explained_fitted));
}

static const char *const sides[2] = {"left", "right"};

static json_t *modes(const supine_patient_stiffness *stiffness, size_t side) {
  json_t *all = json_array();
  for (size_t k = 0; k < stiffness->count[side]; ++k) {
    const supine_patient_mode *mode = &stiffness->mode[side][k];
    (void)json_array_append_new(
        all, json_pack("{s:f, s:f, s:o, s:f}", "expandability", mode->value, "seen", mode->seen,
                       "centre_mm", numbers(mode->centre, 3), "radius_mm", mode->radius));
  }
  return all;
}

static json_t *expandability(const supine_patient_record *record) {
  const supine_patient_expand_report *report = &record->expand;
  json_t *of = json_object();
  if (report->tried) {
    (void)json_object_update_new(
        of, json_pack("{s:b, s:o, s:o, s:f, s:f}", "kept", report->kept ? 1 : 0,
                      "fitted_without_and_with_mm", numbers(report->fitted, 2),
                      "held_out_without_and_with_mm", numbers(report->held_out, 2), "softest",
                      report->softest, "stiffest", report->stiffest));
  }
  for (size_t k = 0; k < 2; ++k) {
    if (record->stiffness.count[k] > 0) {
      (void)json_object_set_new(of, sides[k], modes(&record->stiffness, k));
    }
  }
  return of;
}

static json_t *applied(const supine_patient_applied *of) {
  return json_pack("{s:i, s:f, s:f, s:o, s:f, s:f}", "blocks", (int)of->blocks, "matched_percent",
                   100.0 * of->matched, "correlation_with_height", of->correlation, "c7_to_c9",
                   numbers(of->slopes, 3), "left_rms", of->left, "spread_rms", of->spread);
}

static json_t *further(const supine_patient_record *record) {
  json_t *all = json_array();
  for (size_t k = 0; k < record->told_count; ++k) {
    const supine_patient_told *told = &record->told[k];
    (void)json_array_append_new(all, json_pack("{s:s, s:f, s:f, s:f}", "posture", told->posture,
                                               "scale", told->scale, "left_rms_mm", told->left,
                                               "left_without_gain_mm", told->left_without));
  }
  return all;
}

bool supine_patient_is_uneven(const supine_patient_record *record) {
  return record->stiffness.count[0] > 0 || record->stiffness.count[1] > 0;
}

static json_t *encode(const supine_patient_record *record, const supine_patient_fit_report *report,
                      const char *made_by) {
  const supine_patient *patient = &record->patient;
  const supine_patient_frame *frame = &patient->frame;
  json_t *root = json_pack(
      "{s:s, s:i, s:s, s:s, s:i, s:f, s:f, s:f, s:f, s:{s:o, s:o, s:f, s:s, s:s}, s:o, s:o, s:f}",
      "format", format, "version", VERSION, "name", record->name, "law",
      supine_patient_law_names[patient->law], "points", (int)record->points, "held_out_rms_mm",
      record->held_out, "held_out_baseline_mm", record->held_out_baseline, "fitted_rms_mm",
      record->fitted, "explained_percent", 100.0 * record->explained, "frame", "minimum_mm",
      numbers(frame->minimum, 3), "maximum_mm", numbers(frame->maximum, 3), "midline_mm",
      frame->midline, "lungs", side_name(frame->only_side), "of",
      record->from_surface ? "surface" : "landmarks", "rest", scan(&record->rest), "state",
      scan(&record->state), "inflation", record->inflation);
  if (root == NULL) {
    return NULL;
  }
  (void)json_object_set_new(root, "force",
                            json_pack("{s:f, s:f, s:o}", "base", record->force.base, "gain",
                                      record->force.gain, "box", numbers(record->force.box, 3)));
  (void)json_object_set_new(root, "motion",
                            json_pack("{s:o, s:o}", "translation_mm", numbers(patient->motion, 3),
                                      "rotation_rad", numbers(patient->motion + 3, 3)));
  (void)json_object_set_new(root, "lengths_mm", numbers(patient->lengths, 3));
  (void)json_object_set_new(root, "powers", numbers(patient->powers, SUPINE_PATIENT_POWERS));
  (void)json_object_set_new(root, "polynomial_mm", polynomial(patient));
  if (record->told_count > 0) {
    (void)json_object_set_new(root, "further_states", further(record));
  }
  if (record->gain_told) {
    (void)json_object_set_new(root, "gain_standard_error", json_real(record->gain_error));
  }
  if (record->expand.tried || supine_patient_is_uneven(record)) {
    (void)json_object_set_new(root, "expandability", expandability(record));
  }
  if (record->applied.blocks > 0) {
    (void)json_object_set_new(root, "applied_force", applied(&record->applied));
  }
  if (report != NULL) {
    add_report(root, patient, report);
  }
  if (made_by != NULL) {
    (void)json_object_set_new(root, "made_by", json_string(made_by));
  }
  return root;
}

char *supine_patient_text(const supine_patient_record *record,
                          const supine_patient_fit_report *report, const char *made_by) {
  json_t *root = encode(record, report, made_by);
  char *text = root == NULL ? NULL : json_dumps(root, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
  json_decref(root);
  return text;
}

supine_status supine_patient_write(const char *path, const supine_patient_record *record,
                                   const supine_patient_fit_report *report, const char *made_by,
                                   supine_error *error) {
  supine_output output = {0};
  char *text = supine_patient_text(record, report, made_by);
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

/* Finite numbers of an array; false where they are not there. */
static bool take_numbers(const json_t *array, size_t count, double *values) {
  bool right = json_array_size(array) == count;
  for (size_t i = 0; right && i < count; ++i) {
    const json_t *value = json_array_get(array, i);
    values[i] = json_number_value(value);
    right = json_is_number(value) && isfinite(values[i]);
  }
  return right;
}

static bool take_scan(const json_t *object, supine_patient_scan *of) {
  const char *posture = json_string_value(json_object_get(object, "posture"));
  const char *volume = json_string_value(json_object_get(object, "volume"));
  if (posture == NULL || volume == NULL || strlen(posture) >= SUPINE_PATIENT_TEXT ||
      strlen(volume) >= SUPINE_PATIENT_TEXT) {
    return false;
  }
  memcpy(of->posture, posture, strlen(posture) + 1);
  memcpy(of->volume, volume, strlen(volume) + 1);
  return take_numbers(json_object_get(object, "gravity"), 3, of->gravity) &&
         fabs(sqrt(of->gravity[0] * of->gravity[0] + of->gravity[1] * of->gravity[1] +
                   of->gravity[2] * of->gravity[2]) -
              1.0) < 1e-6;
}

static bool take_frame(const json_t *object, supine_patient_record *record) {
  supine_patient_frame *frame = &record->patient.frame;
  const char *lungs = json_string_value(json_object_get(object, "lungs"));
  const char *of = json_string_value(json_object_get(object, "of"));
  if (lungs == NULL || of == NULL ||
      !take_numbers(json_object_get(object, "minimum_mm"), 3, frame->minimum) ||
      !take_numbers(json_object_get(object, "maximum_mm"), 3, frame->maximum)) {
    return false;
  }
  frame->midline = json_number_value(json_object_get(object, "midline_mm"));
  frame->only_side = strcmp(lungs, "left") == 0 ? 1 : strcmp(lungs, "right") == 0 ? -1 : 0;
  record->from_surface = strcmp(of, "surface") == 0;
  bool right = isfinite(frame->midline);
  for (int k = 0; k < 3; ++k) {
    right = right && frame->maximum[k] > frame->minimum[k];
  }
  return right && (frame->only_side != 0 ||
                   (frame->midline > frame->minimum[0] && frame->midline < frame->maximum[0]));
}

static bool take_law(const json_t *root, supine_patient *patient) {
  const char *law = json_string_value(json_object_get(root, "law"));
  const json_t *polynomial_mm = json_object_get(root, "polynomial_mm");
  const json_t *motion = json_object_get(root, "motion");
  int k = 0;
  while (law != NULL && k < SUPINE_PATIENT_LAW_COUNT &&
         strcmp(law, supine_patient_law_names[k]) != 0) {
    ++k;
  }
  bool right =
      law != NULL && k < SUPINE_PATIENT_LAW_COUNT &&
      take_numbers(json_object_get(root, "lengths_mm"), 3, patient->lengths) &&
      take_numbers(json_object_get(root, "powers"), SUPINE_PATIENT_POWERS, patient->powers) &&
      take_numbers(json_object_get(motion, "translation_mm"), 3, patient->motion) &&
      take_numbers(json_object_get(motion, "rotation_rad"), 3, patient->motion + 3);
  for (size_t a = 0; a < 3 && right; ++a) {
    const char axis[2] = {"xyz"[a], '\0'};
    const json_t *of = json_object_get(polynomial_mm, axis);
    double *shared = patient->polynomial + 2 * a * TERMS;
    right = take_numbers(json_object_get(of, "shared"), TERMS, shared) &&
            take_numbers(json_object_get(of, "by_lung"), TERMS, shared + TERMS);
  }
  patient->law = (supine_patient_law)k;
  return right;
}

static bool take_force(const json_t *object, supine_force_law *force) {
  *force = (supine_force_law){.base = json_number_value(json_object_get(object, "base")),
                              .gain = json_number_value(json_object_get(object, "gain"))};
  return json_is_number(json_object_get(object, "base")) &&
         json_is_number(json_object_get(object, "gain")) && isfinite(force->base) &&
         isfinite(force->gain) && take_numbers(json_object_get(object, "box"), 3, force->box);
}

/* The modes of each side that the file has. */
static bool take_stiffness(const json_t *object, supine_patient_stiffness *stiffness) {
  bool right = true;
  for (size_t side = 0; side < 2; ++side) {
    const json_t *all = json_object_get(object, sides[side]);
    stiffness->count[side] = json_array_size(all);
    right = right && stiffness->count[side] <= SUPINE_PATIENT_MODES;
    for (size_t k = 0; k < stiffness->count[side] && right; ++k) {
      const json_t *of = json_array_get(all, k);
      supine_patient_mode *mode = &stiffness->mode[side][k];
      mode->value = json_number_value(json_object_get(of, "expandability"));
      mode->seen = json_number_value(json_object_get(of, "seen"));
      mode->radius = json_number_value(json_object_get(of, "radius_mm"));
      right = mode->value > 0.0 && isfinite(mode->value) && isfinite(mode->radius) &&
              mode->radius > 0.0 && take_numbers(json_object_get(of, "centre_mm"), 3, mode->centre);
    }
  }
  return right;
}

static double number(const json_t *root, const char *key) {
  return json_number_value(json_object_get(root, key));
}

static supine_status decode(const char *name, const json_t *root, supine_patient_record *record,
                            supine_error *error) {
  const char *found = json_string_value(json_object_get(root, "format"));
  const char *wrong = NULL;
  if (found == NULL || strcmp(found, format) != 0 || number(root, "version") != VERSION) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: not a patient's file of version %d, as 'supine fit' writes it",
                            name, VERSION);
  }
  memset(record, 0, sizeof *record);
  if (!take_frame(json_object_get(root, "frame"), record)) {
    wrong = "frame";
  } else if (!take_law(root, &record->patient)) {
    wrong = "law";
  } else if (!take_force(json_object_get(root, "force"), &record->force)) {
    wrong = "force";
  } else if (!take_scan(json_object_get(root, "rest"), &record->rest) ||
             !take_scan(json_object_get(root, "state"), &record->state)) {
    wrong = "rest or state";
  } else if (!take_stiffness(json_object_get(root, "expandability"), &record->stiffness)) {
    wrong = "expandability";
  }
  if (wrong != NULL) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: \"%s\" is missing or not as 'supine fit' writes it", name, wrong);
  }
  const char *whose = json_string_value(json_object_get(root, "name"));
  (void)snprintf(record->name, sizeof record->name, "%s", whose != NULL ? whose : "unnamed");
  record->inflation = number(root, "inflation") < 0.0 ? -1.0 : 1.0;
  record->points = (size_t)fmax(0.0, number(root, "points"));
  record->held_out = number(root, "held_out_rms_mm");
  record->held_out_baseline = number(root, "held_out_baseline_mm");
  record->fitted = number(root, "fitted_rms_mm");
  record->explained = number(root, "explained_percent") / 100.0;
  return SUPINE_OK;
}

supine_status supine_patient_parse(const char *name, const char *text,
                                   supine_patient_record *record, supine_error *error) {
  json_error_t where;
  json_t *root = json_loads(text, 0, &where);
  if (root == NULL) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s:%d: %s", name, where.line, where.text);
  }
  const supine_status status = decode(name, root, record, error);
  json_decref(root);
  return status;
}

supine_status supine_patient_read(const char *path, supine_patient_record *record,
                                  supine_error *error) {
  json_error_t where;
  FILE *file = fopen(path, "rb");
  if (file == NULL) {
    return supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot open: %s", path, strerror(errno));
  }
  json_t *root = json_loadf(file, 0, &where);
  (void)fclose(file);
  if (root == NULL) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s:%d: %s", path, where.line, where.text);
  }
  const supine_status status = decode(path, root, record, error);
  json_decref(root);
  return status;
}
