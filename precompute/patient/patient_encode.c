/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write a patient's record as JSON. */
#include <math.h>
#include <stdlib.h>

#include <jansson.h>

#include "precompute/patient/patient_file.h"
#include "precompute/patient/patient_keys.h"

#include "base/arena.h"
#include "base/locale.h"
#include "base/output.h"

const char *const supine_patient_score_keys[SUPINE_PATIENT_SCORES] = {"none", "translation",
                                                                      "affine", "law", "corrected"};
const char *const supine_patient_lungs_words[3] = {"right", "both", "left"};
const char *const supine_patient_state_words[2] = {"fuller", "emptier"};
const char *const supine_patient_applied_words[2] = {"surfaces, unreliable in real people",
                                                     "landmarks"};

/* An object of the JSON text, and whether memory ran out in it or in an object that it contains. */
typedef struct object {
  json_t *json;
  bool failed;
} object;

/* Add a member. The object owns `value`, which is NULL if memory ran out. */
static void put(object *to, const char *key, json_t *value) {
  if (json_object_set_new(to->json, key, value) != 0) {
    to->failed = true;
  }
}

static void put_text(object *to, const char *key, const char *text) {
  put(to, key, json_string(text));
}

static void put_count(object *to, const char *key, size_t count) {
  put(to, key, json_integer((json_int_t)count));
}

/* Add a number. Leave it out if it is not finite, as JSON has no such numbers. */
static void put_real(object *to, const char *key, double value) {
  if (isfinite(value)) {
    put(to, key, json_real(value));
  }
}

/* Add an array of numbers. Leave it out if a number is not finite. */
static void put_reals(object *to, const char *key, size_t count, const double *values) {
  json_t *array = json_array();
  for (size_t i = 0; i < count; ++i) {
    if (!isfinite(values[i])) {
      json_decref(array);
      return;
    }
    if (json_array_append_new(array, json_real(values[i])) != 0) {
      to->failed = true;
    }
  }
  put(to, key, array);
}

static object begin(void) {
  json_t *json = json_object();
  return (object){.json = json, .failed = json == NULL};
}

static void put_object(object *to, const char *key, object member) {
  to->failed = to->failed || member.failed;
  put(to, key, member.json);
}

static void append_object(json_t *array, object member, object *owner) {
  if (json_array_append_new(array, member.json) != 0 || member.failed) {
    owner->failed = true;
  }
}

static const char *side_word(int side) {
  return supine_patient_lungs_words[1 + side];
}

static object frame_of(const supine_patient_record *record) {
  const supine_patient_frame *frame = &record->patient.frame;
  object to = begin();
  put_text(&to, "lungs", side_word(frame->only_side));
  put_text(&to, "of", record->from_surface ? "surface" : "landmarks");
  put_reals(&to, "minimum_mm", 3, frame->minimum);
  put_reals(&to, "maximum_mm", 3, frame->maximum);
  put_real(&to, "midline_mm", frame->midline);
  return to;
}

static void put_state(object *to, const supine_state *state) {
  char text[SUPINE_PATIENT_STATE_TEXT];
  (void)supine_state_print(state, text, sizeof text);
  put_text(to, "state", text);
}

static object scan_of(const supine_patient_record *record, size_t state) {
  object to = begin();
  put_state(&to, &record->state[state]);
  if (record->volume[state] > 0.0) {
    put_real(&to, "volume_ml", record->volume[state]);
  }
  if (record->measured_lung[state][0] > 0.0 || record->measured_lung[state][1] > 0.0) {
    put_reals(&to, "left_right_ml", 2, record->measured_lung[state]);
  }
  return to;
}

static object correction_of(const supine_patient *patient) {
  object to = begin();
  json_t *centres = json_array();
  for (size_t i = 0; i < patient->centre_count; ++i) {
    const supine_patient_centre *centre = &patient->centre[i];
    object one = begin();
    put_text(&one, "lung", side_word(centre->side));
    put_reals(&one, "offset_mm", 3, centre->offset);
    put_real(&one, "displacement_mm", centre->size);
    put_reals(&one, "weight_per_mm", 3, centre->weight);
    append_object(centres, one, &to);
  }
  put(&to, "centres", centres);
  return to;
}

static void put_further(object *to, const supine_patient_record *record) {
  json_t *states = json_array();
  for (size_t k = 0; k < record->further_count; ++k) {
    const supine_patient_further *further = &record->further[k];
    object one = begin();
    put_state(&one, &further->state);
    put_reals(&one, "scale", 2, further->scale);
    put_real(&one, "left_rms_mm", further->residual);
    put_real(&one, "left_without_gain_mm", further->residual_without_gain);
    append_object(states, one, to);
  }
  put(to, "further_states", states);
}

static object scores_of(const double scores[SUPINE_PATIENT_SCORES]) {
  object to = begin();
  for (size_t k = 0; k < SUPINE_PATIENT_SCORES; ++k) {
    put_real(&to, supine_patient_score_keys[k], scores[k]);
  }
  return to;
}

static void put_report(object *to, const supine_patient_fit_report *report) {
  put_count(to, "points", report->points);
  put_count(to, "blocks", report->blocks);
  put_object(to, "fitted_rms_mm", scores_of(report->fitted));
  object held_out = scores_of(report->held_out);
  put_real(&held_out, "baseline", report->baseline);
  put_object(to, "held_out_rms_mm", held_out);
  put_real(to, "explained_percent", report->explained);
  put_real(to, "error_in_fuller_scan", report->stretch);
  put_real(to, "expected_rms_mm", report->expected_point);
  put_real(to, "expected_constant_mm", report->expected_constant);
  put_real(to, "expected_from_mm", report->expected_from);
  if (report->has_band) {
    put_real(to, "band_95_percent_holds", report->band);
  }
}

static const char *gain_source(const supine_patient_record *record) {
  if (record->gain_undetermined) {
    return "the deep law: the scans in other postures do not determine the gain";
  }
  if (record->gain_fitted) {
    return "the states in other postures";
  }
  return "the deep law: scans in one posture do not determine the gain; a state in another posture "
         "does";
}

static object force_of(const supine_patient_record *record) {
  object to = begin();
  put_real(&to, "base", record->force.base);
  put_real(&to, "gain", record->force.gain);
  if (record->gain_fitted) {
    put_real(&to, "gain_standard_error", record->gain_error);
  }
  put_reals(&to, "box", 3, record->force.box);
  put_text(&to, "gain_from", gain_source(record));
  return to;
}

static void put_law(object *to, const supine_patient_record *record) {
  const supine_patient_power *power = &record->patient.power;
  object box = begin();
  put_reals(&box, "minimum_mm", 3, record->emptier[0]);
  put_reals(&box, "maximum_mm", 3, record->emptier[1]);
  put_object(to, "emptier_frame", box);
  put_object(to, "force", force_of(record));
  object motion = begin();
  put_reals(&motion, "translation_mm", 3, power->motion);
  put_reals(&motion, "rotation_rad", 3, power->motion + 3);
  put_object(to, "motion", motion);
  put_reals(to, "c1_to_c9", SUPINE_PATIENT_CONSTANTS, power->c);
  if (record->report.has_errors) {
    put_reals(to, "standard_errors", SUPINE_PATIENT_CONSTANTS, record->report.error);
  }
}

static object basis_of(const supine_patient_record *record) {
  object to = begin();
  put_text(&to, "scan", supine_patient_state_words[record->shown]);
  put_reals(&to, "path_span", 3, record->path_span);
  return to;
}

static object surface_of(const supine_patient_surface_report *surface) {
  object to = begin();
  put_count(&to, "vertices", surface->vertices);
  put_real(&to, "matched_share", surface->matched);
  put_real(&to, "rms_before_mm", surface->before);
  put_real(&to, "rms_after_mm", surface->after);
  return to;
}

static object expandability_of(const supine_patient_record *record) {
  const supine_patient_expand_report *expand = &record->expand;
  object to = begin();
  put_count(&to, "unseen_regions", expand->undetermined);
  put_reals(&to, "fitted_without_and_with_mm", 2, expand->fitted);
  put_reals(&to, "held_out_without_and_with_mm", 2, expand->held_out);
  if (record->stiffness.count > 0) {
    json_t *regions = json_array();
    for (size_t k = 0; k < record->stiffness.count; ++k) {
      const supine_patient_region *region = &record->stiffness.region[k];
      object one = begin();
      put_text(&one, "lung", side_word(region->side));
      put_real(&one, "expandability", region->expandability);
      put_reals(&one, "centre_mm", 3, region->centre);
      put_real(&one, "radius_mm", region->radius);
      put_real(&one, "determined", region->determined);
      append_object(regions, one, &to);
    }
    put(&to, "regions", regions);
  }
  put(&to, "kept", json_boolean(expand->kept));
  return to;
}

static object applied_of(const supine_patient_applied *applied) {
  object to = begin();
  put_text(&to, "computed_from", supine_patient_applied_words[applied->from_landmarks]);
  put_count(&to, "blocks", applied->blocks);
  put_real(&to, "correlation_with_height", applied->correlation);
  put_reals(&to, "c7_to_c9", 3, applied->slopes);
  put_real(&to, "left_rms", applied->residual);
  put_real(&to, "spread_rms", applied->spread);
  return to;
}

json_t *supine_patient_encode(const supine_patient_record *record, const char *made_by) {
  object root = begin();
  put_text(&root, "format", SUPINE_PATIENT_FORMAT);
  put_count(&root, "version", SUPINE_PATIENT_VERSION);
  put_text(&root, "name", record->name);
  put_text(&root, "law", supine_patient_law_names[record->patient.law]);
  put_object(&root, "frame", frame_of(record));
  put_object(&root, "fuller", scan_of(record, 0));
  put_object(&root, "emptier", scan_of(record, 1));
  put_object(&root, "correction", correction_of(&record->patient));
  put_further(&root, record);
  if (made_by != NULL) {
    put_text(&root, "made_by", made_by);
  }
  put_report(&root, &record->report);
  put_law(&root, record);
  if (record->in_basis) {
    put_object(&root, "basis", basis_of(record));
  }
  if (record->surface.vertices > 0) {
    put_object(&root, "surface", surface_of(&record->surface));
  }
  if (record->expand.tried) {
    put_object(&root, "expandability", expandability_of(record));
  }
  if (record->applied.blocks > 0) {
    put_object(&root, "applied_force", applied_of(&record->applied));
  }
  if (root.failed) {
    json_decref(root.json);
    return NULL;
  }
  return root.json;
}

char *supine_patient_text(const supine_patient_record *record, const char *made_by) {
  SUPINE_C_LOCALE;
  json_t *root = supine_patient_encode(record, made_by);
  if (root == NULL) {
    return NULL;
  }
  char *text = json_dumps(root, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
  json_decref(root);
  return text;
}

supine_status supine_patient_write(const char *path, const supine_patient_record *record,
                                   const char *made_by, supine_error *error) {
  supine_output output = {0};
  char *text = supine_patient_text(record, made_by);
  if (text == NULL) {
    return supine_error_memory(error, "%s", path);
  }
  supine_status status = supine_output_open(path, &output, error);
  if (status == SUPINE_OK) {
    (void)fprintf(output.file, "%s\n", text);
    status = supine_output_commit(&output, error);
  }
  free(text);
  return status;
}
