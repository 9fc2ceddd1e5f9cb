/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write a patient's record as JSON, key by key (patient_keys.h). */
#include <math.h>
#include <stdlib.h>

#include <jansson.h>

#include "precompute/patient/patient_keys.h"

#include "base/arena.h"
#include "base/locale.h"
#include "base/output.h"

/* Return whether a value is to be written. */
static bool is_written(const supine_patient_key *key, const char *from) {
  bool positive = false;
  if (key->kind == SUPINE_PATIENT_NUMBERS) {
    const double *numbers = (const double *)(const void *)(from + key->offset);
    for (size_t i = 0; i < key->count; ++i) {
      if (!isfinite(numbers[i])) { /* JSON has no such numbers */
        return false;
      }
      positive = positive || numbers[i] > 0.0;
    }
  }
  switch (key->presence) {
  case SUPINE_PATIENT_IF_POSITIVE:
    return positive;
  case SUPINE_PATIENT_IF_FLAG:
    return *(const bool *)(from + key->flag);
  case SUPINE_PATIENT_IF_COUNTED:
    return *(const size_t *)(const void *)(from + key->length) > 0;
  default:
    return true;
  }
}

static json_t *encode_numbers(size_t count, const double *values) {
  if (count == 1) {
    return json_real(*values);
  }
  json_t *array = json_array();
  for (size_t i = 0; i < count; ++i) {
    if (json_array_append_new(array, json_real(values[i])) != 0) {
      json_decref(array);
      return NULL;
    }
  }
  return array;
}

static json_t *encode_state(const supine_state *state) {
  char text[SUPINE_PATIENT_STATE_TEXT];
  (void)supine_state_print(state, text, sizeof text);
  return json_string(text);
}

static json_t *encode_list(const supine_patient_key *key, const char *from);

/* Return the value of a key, or NULL if out of memory. */
static json_t *encode_value(const supine_patient_key *key, const char *from) {
  const void *member = from + key->offset;
  switch (key->kind) {
  case SUPINE_PATIENT_OBJECT:
    return json_object();
  case SUPINE_PATIENT_LIST:
    return encode_list(key, from);
  case SUPINE_PATIENT_STRING:
    return json_string(member);
  case SUPINE_PATIENT_STATE:
    return encode_state(member);
  case SUPINE_PATIENT_NUMBERS:
    return encode_numbers(key->count, member);
  case SUPINE_PATIENT_SIZE:
    return json_integer((json_int_t) * (const size_t *)member);
  case SUPINE_PATIENT_BOOL:
    return json_boolean(*(const bool *)member);
  case SUPINE_PATIENT_LAW_WORD:
    return json_string(key->words[*(const supine_patient_law *)member]);
  case SUPINE_PATIENT_BOOL_WORD:
    return json_string(key->words[*(const bool *)member ? 1 : 0]);
  case SUPINE_PATIENT_SIZE_WORD:
    return json_string(key->words[*(const size_t *)member]);
  case SUPINE_PATIENT_LUNGS_WORD:
    return json_string(key->words[1 + *(const int *)member]);
  }
  return NULL;
}

/* Add the members of the struct `from` to an object. Return whether there was memory. */
static bool add_members(const supine_patient_keys *keys, const char *from, json_t *to) {
  bool whole = true;
  for (size_t i = 0; i < keys->count; ++i) {
    const supine_patient_key *key = &keys->key[i];
    json_t *object = key->object[0] != '\0' ? json_object_get(to, key->object) : to;
    if (object != NULL && is_written(key, from)) {
      whole = json_object_set_new(object, key->key, encode_value(key, from)) == 0 && whole;
    }
  }
  return whole;
}

static json_t *encode_list(const supine_patient_key *key, const char *from) {
  const size_t length = *(const size_t *)(const void *)(from + key->length);
  json_t *array = json_array();
  bool whole = true;
  for (size_t i = 0; i < length; ++i) {
    json_t *one = json_object();
    whole = add_members(key->members, from + key->offset + i * key->size, one) && whole;
    whole = json_array_append_new(array, one) == 0 && whole;
  }
  if (!whole) {
    json_decref(array);
    return NULL;
  }
  return array;
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

json_t *supine_patient_encode(const supine_patient_record *record, const char *made_by) {
  const char *from = (const char *)record;
  json_t *root = json_object();
  bool whole = json_object_set_new(root, "format", json_string(SUPINE_PATIENT_FORMAT)) == 0;
  whole = json_object_set_new(root, "version", json_integer(SUPINE_PATIENT_VERSION)) == 0 && whole;
  whole = add_members(&supine_patient_law_keys, from, root) && whole;
  if (made_by != NULL) {
    whole = json_object_set_new(root, "made_by", json_string(made_by)) == 0 && whole;
  }
  whole = add_members(&supine_patient_fit_keys, from, root) && whole;
  json_t *source = json_string(gain_source(record));
  whole = json_object_set_new(json_object_get(root, "force"), "gain_from", source) == 0 && whole;
  if (!whole) {
    json_decref(root);
    return NULL;
  }
  return root;
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
