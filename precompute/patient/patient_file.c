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
enum { VERSION = 2, CENTRE = 8 };

static json_t *numbers(const double *values, size_t count) {
  json_t *array = json_array();
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(array, json_real(values[i]));
  }
  return array;
}

static json_t *state(const supine_patient_record *record, size_t k) {
  char text[SUPINE_PATIENT_STATE_TEXT];
  (void)supine_state_print(&record->state[k], text, sizeof text);
  return json_pack("{s:s, s:f}", "state", text, "volume_ml", record->volume[k]);
}

static const char *side_name(int side) {
  return side > 0 ? "left" : side < 0 ? "right" : "both";
}

static json_t *scores(const supine_patient_scores *of) {
  return json_pack("{s:f, s:f, s:f, s:f, s:f}", "none", of->none, "translation", of->translation,
                   "affine", of->affine, "law", of->law, "corrected", of->corrected);
}

/* Encode the centres, seven numbers each: place, side, size and weights. */
static json_t *correction(const supine_patient_correction *of) {
  json_t *all = json_array();
  for (size_t i = 0; i < of->count; ++i) {
    const supine_patient_centre *c = &of->centre[i];
    const double values[CENTRE] = {c->at[0], c->at[1],     c->at[2],     c->side,
                                   c->size,  c->weight[0], c->weight[1], c->weight[2]};
    (void)json_array_append_new(all, numbers(values, CENTRE));
  }
  return json_pack("{s:o}", "centres", all);
}

static void add_report(json_t *root, const supine_patient *patient,
                       const supine_patient_fit_report *report) {
  static const char *const names[SUPINE_PATIENT_CONSTANTS] = {"c1", "c2", "c3", "c4", "c5",
                                                              "c6", "c7", "c8", "c9"};
  double c[SUPINE_PATIENT_CONSTANTS];
  json_t *constants = json_object();
  supine_patient_constants(patient, c);
  for (size_t k = 0; k < SUPINE_PATIENT_CONSTANTS && patient->law == SUPINE_PATIENT_PAPER; ++k) {
    (void)json_object_set_new(
        constants, names[k],
        json_pack("{s:f, s:f}", "value", c[k], "standard_error", report->error[k]));
  }
  (void)json_object_set_new(root, "paper_constants", constants);
  (void)json_object_set_new(root, "fitted", scores(&report->fitted));
  (void)json_object_set_new(root, "held_out", scores(&report->held_out));
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
    char text[SUPINE_PATIENT_STATE_TEXT];
    (void)supine_state_print(&told->state, text, sizeof text);
    (void)json_array_append_new(all, json_pack("{s:s, s:f, s:f, s:f}", "state", text, "scale",
                                               told->scale, "left_rms_mm", told->left,
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
      "{s:s, s:i, s:s, s:s, s:i, s:f, s:f, s:f, s:f, s:f, s:f, s:{s:o, s:o, s:f, s:s, s:s}, "
      "s:{s:o, s:o}, s:o, s:o, s:f}",
      "format", format, "version", VERSION, "name", record->name, "law",
      supine_patient_law_names[patient->law], "points", (int)record->points, "held_out_rms_mm",
      record->held_out, "held_out_baseline_mm", record->held_out_baseline, "expected_rms_mm",
      record->expected, "band_95_percent_holds", 100.0 * record->band, "fitted_rms_mm",
      record->fitted, "explained_percent", 100.0 * record->explained, "frame", "minimum_mm",
      numbers(frame->minimum, 3), "maximum_mm", numbers(frame->maximum, 3), "midline_mm",
      frame->midline, "lungs", side_name(frame->only_side), "of",
      record->from_surface ? "surface" : "landmarks", "emptier_frame", "minimum_mm",
      numbers(record->emptier[0], 3), "maximum_mm", numbers(record->emptier[1], 3), "fuller",
      state(record, 0), "emptier", state(record, 1), "reach_mm", record->reach);
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
  (void)json_object_set_new(root, "correction", correction(&patient->correction));
  (void)json_object_set_new(root, "expected_constant_mm", json_real(record->expected_constant));
  if (record->told_count > 0) {
    (void)json_object_set_new(root, "further_states", further(record));
  }
  if (record->gain_told) {
    (void)json_object_set_new(root, "gain_determined", json_boolean(!record->gain_open));
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

/* Read the finite numbers of an array; false if any is missing. */
static bool take_numbers(const json_t *array, size_t count, double *values) {
  bool right = json_array_size(array) == count;
  for (size_t i = 0; right && i < count; ++i) {
    const json_t *value = json_array_get(array, i);
    values[i] = json_number_value(value);
    right = json_is_number(value) && isfinite(values[i]);
  }
  return right;
}

static bool take_state(const json_t *object, supine_state *of, double *volume) {
  const char *text = json_string_value(json_object_get(object, "state"));
  *of = (supine_state){0};
  *volume = json_number_value(json_object_get(object, "volume_ml"));
  return text != NULL && isfinite(*volume) && supine_state_parse(text, of, NULL) == SUPINE_OK &&
         (of->gravity[0] != 0.0 || of->gravity[1] != 0.0 || of->gravity[2] != 0.0);
}

static bool take_box(const json_t *object, double low[3], double high[3]) {
  bool right = take_numbers(json_object_get(object, "minimum_mm"), 3, low) &&
               take_numbers(json_object_get(object, "maximum_mm"), 3, high);
  for (int k = 0; k < 3; ++k) {
    right = right && high[k] > low[k];
  }
  return right;
}

static bool take_frame(const json_t *object, supine_patient_record *record) {
  supine_patient_frame *frame = &record->patient.frame;
  const char *lungs = json_string_value(json_object_get(object, "lungs"));
  const char *of = json_string_value(json_object_get(object, "of"));
  if (lungs == NULL || of == NULL || !take_box(object, frame->minimum, frame->maximum)) {
    return false;
  }
  frame->midline = json_number_value(json_object_get(object, "midline_mm"));
  frame->only_side = strcmp(lungs, "left") == 0 ? 1 : strcmp(lungs, "right") == 0 ? -1 : 0;
  record->from_surface = strcmp(of, "surface") == 0;
  return isfinite(frame->midline) &&
         (frame->only_side != 0 ||
          (frame->midline > frame->minimum[0] && frame->midline < frame->maximum[0]));
}

static bool take_law(const json_t *root, supine_patient *patient) {
  const char *law = json_string_value(json_object_get(root, "law"));
  const json_t *motion = json_object_get(root, "motion");
  int k = 0;
  while (law != NULL && k < SUPINE_PATIENT_LAW_COUNT &&
         strcmp(law, supine_patient_law_names[k]) != 0) {
    ++k;
  }
  const bool right =
      law != NULL && k < SUPINE_PATIENT_LAW_COUNT &&
      take_numbers(json_object_get(root, "lengths_mm"), 3, patient->lengths) &&
      take_numbers(json_object_get(root, "powers"), SUPINE_PATIENT_POWERS, patient->powers) &&
      take_numbers(json_object_get(motion, "translation_mm"), 3, patient->motion) &&
      take_numbers(json_object_get(motion, "rotation_rad"), 3, patient->motion + 3);
  patient->law = (supine_patient_law)k;
  return right;
}

static bool take_correction(const json_t *object, supine_patient_correction *of) {
  const json_t *all = json_object_get(object, "centres");
  of->count = json_array_size(all);
  bool right = json_is_array(all) && of->count <= SUPINE_PATIENT_CENTRES_MAX;
  for (size_t i = 0; right && i < of->count; ++i) {
    double v[CENTRE];
    right = take_numbers(json_array_get(all, i), CENTRE, v);
    of->centre[i] = (supine_patient_centre){
        {v[0], v[1], v[2]}, v[3] < 0.0 ? -1.0 : 1.0, v[4], {v[5], v[6], v[7]}};
    right = right && v[4] >= 0.0;
  }
  return right;
}

static bool take_force(const json_t *object, supine_force_law *force) {
  *force = (supine_force_law){.base = json_number_value(json_object_get(object, "base")),
                              .gain = json_number_value(json_object_get(object, "gain")),
                              .pair = true};
  return json_is_number(json_object_get(object, "base")) &&
         json_is_number(json_object_get(object, "gain")) && isfinite(force->base) &&
         isfinite(force->gain) && take_numbers(json_object_get(object, "box"), 3, force->box);
}

/* Read the regions of each side. */
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
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: not a patient file of version %d: make a new one with 'supine fit'", name, VERSION);
  }
  memset(record, 0, sizeof *record);
  if (!take_frame(json_object_get(root, "frame"), record)) {
    wrong = "frame";
  } else if (!take_law(root, &record->patient)) {
    wrong = "law";
  } else if (!take_force(json_object_get(root, "force"), &record->force)) {
    wrong = "force";
  } else if (!take_correction(json_object_get(root, "correction"), &record->patient.correction)) {
    wrong = "correction";
  } else if (!take_state(json_object_get(root, "fuller"), &record->state[0], &record->volume[0]) ||
             !take_state(json_object_get(root, "emptier"), &record->state[1], &record->volume[1])) {
    wrong = "fuller or emptier";
  } else if (!take_box(json_object_get(root, "emptier_frame"), record->emptier[0],
                       record->emptier[1])) {
    wrong = "emptier_frame";
  } else if (!json_is_number(json_object_get(root, "reach_mm")) ||
             !(number(root, "reach_mm") >= 0.0)) {
    wrong = "reach_mm";
  } else if (!take_stiffness(json_object_get(root, "expandability"), &record->stiffness)) {
    wrong = "expandability";
  }
  if (wrong != NULL) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: \"%s\" is missing or invalid: make a new file with 'supine fit'",
                            name, wrong);
  }
  const char *whose = json_string_value(json_object_get(root, "name"));
  (void)snprintf(record->name, sizeof record->name, "%s", whose != NULL ? whose : "unnamed");
  record->reach = number(root, "reach_mm");
  record->points = (size_t)fmax(0.0, number(root, "points"));
  record->held_out = number(root, "held_out_rms_mm");
  record->held_out_baseline = number(root, "held_out_baseline_mm");
  record->expected = number(root, "expected_rms_mm");
  record->band = number(root, "band_95_percent_holds") / 100.0;
  record->expected_constant = number(root, "expected_constant_mm");
  record->fitted = number(root, "fitted_rms_mm");
  record->explained = number(root, "explained_percent") / 100.0;
  return SUPINE_OK;
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
