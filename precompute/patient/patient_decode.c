/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read a patient's record from JSON, key by key (patient_keys.h). */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <jansson.h>

#include "precompute/patient/patient_keys.h"

#include "base/arena.h"
#include "base/locale.h"

/* The first key that is missing or has an invalid value, with the key of the object or list that
 * contains it, such as "frame.lungs"; empty as long as all is valid. */
typedef struct invalid {
  char key[64];
} invalid;

static void fail(invalid *found, const char *object, const char *key) {
  if (found->key[0] == '\0') {
    const char *dot = object[0] != '\0' ? "." : "";
    (void)snprintf(found->key, sizeof found->key, "%s%s%s", object, dot, key);
  }
}

static bool decode_number(const json_t *value, double *number) {
  *number = json_number_value(value);
  return json_is_number(value) && isfinite(*number);
}

static bool decode_numbers(const json_t *value, size_t count, double *numbers) {
  if (count == 1) {
    return decode_number(value, numbers);
  }
  bool valid = json_is_array(value) && json_array_size(value) == count;
  for (size_t i = 0; i < count && valid; ++i) {
    valid = decode_number(json_array_get(value, i), &numbers[i]);
  }
  return valid;
}

static bool decode_count(const json_t *value, size_t *count) {
  if (!json_is_integer(value) || json_integer_value(value) < 0) {
    return false;
  }
  *count = (size_t)json_integer_value(value);
  return true;
}

static bool decode_state(const json_t *value, supine_state *state) {
  const char *text = json_string_value(value);
  const double *g = state->gravity;
  return text != NULL && supine_state_parse(text, state, NULL) == SUPINE_OK &&
         (g[0] != 0.0 || g[1] != 0.0 || g[2] != 0.0);
}

static bool decode_text(const json_t *value, char text[SUPINE_PATIENT_TEXT]) {
  if (!json_is_string(value)) {
    return false;
  }
  (void)snprintf(text, SUPINE_PATIENT_TEXT, "%s", json_string_value(value));
  return true;
}

/* Write the index of a word among those of a key into the member. */
static bool decode_word(const supine_patient_key *key, const json_t *value, void *member) {
  const char *text = json_string_value(value);
  size_t index = 0;
  while (index < key->count && (text == NULL || strcmp(text, key->words[index]) != 0)) {
    ++index;
  }
  if (index == key->count) {
    return false;
  }
  switch (key->kind) {
  case SUPINE_PATIENT_LAW_WORD:
    *(supine_patient_law *)member = (supine_patient_law)index;
    break;
  case SUPINE_PATIENT_BOOL_WORD:
    *(bool *)member = index == 1;
    break;
  case SUPINE_PATIENT_SIZE_WORD:
    *(size_t *)member = index;
    break;
  default:
    *(int *)member = (int)index - 1;
  }
  return true;
}

static void decode_members(const char *name, const json_t *from, const supine_patient_keys *keys,
                           char *to, invalid *found);

static bool decode_list(const supine_patient_key *key, const json_t *value, char *to,
                        invalid *found) {
  const size_t length = json_array_size(value);
  if (!json_is_array(value) || length > key->count) {
    return false;
  }
  *(size_t *)(void *)(to + key->length) = length;
  for (size_t i = 0; i < length; ++i) {
    decode_members(key->key, json_array_get(value, i), key->members,
                   to + key->offset + i * key->size, found);
  }
  return true;
}

/* Write the value of a key into the struct `to`. Return whether it is valid. */
static bool decode_value(const supine_patient_key *key, const json_t *value, char *to,
                         invalid *found) {
  void *member = to + key->offset;
  switch (key->kind) {
  case SUPINE_PATIENT_OBJECT:
    return json_is_object(value);
  case SUPINE_PATIENT_LIST:
    return decode_list(key, value, to, found);
  case SUPINE_PATIENT_STRING:
    return decode_text(value, member);
  case SUPINE_PATIENT_STATE:
    return decode_state(value, member);
  case SUPINE_PATIENT_NUMBERS:
    return decode_numbers(value, key->count, member);
  case SUPINE_PATIENT_SIZE:
    return decode_count(value, member);
  case SUPINE_PATIENT_BOOL:
    *(bool *)member = json_is_true(value);
    return json_is_boolean(value);
  default:
    return decode_word(key, value, member);
  }
}

/* Read the members of a struct.
 * @param name  key of the list that contains it, or "" for the file itself */
static void decode_members(const char *name, const json_t *from, const supine_patient_keys *keys,
                           char *to, invalid *found) {
  for (size_t i = 0; i < keys->count; ++i) {
    const supine_patient_key *key = &keys->key[i];
    const bool nested = key->object[0] != '\0';
    const json_t *object = nested ? json_object_get(from, key->object) : from;
    const json_t *value = json_object_get(object, key->key);
    const bool optional = key->presence != SUPINE_PATIENT_REQUIRED || (nested && object == NULL);
    if (key->presence == SUPINE_PATIENT_IF_FLAG) {
      *(bool *)(to + key->flag) = value != NULL;
    }
    if (key->presence != SUPINE_PATIENT_WRITTEN && !(optional && value == NULL) &&
        !decode_value(key, value, to, found)) {
      fail(found, nested ? key->object : name, key->key);
    }
  }
}

static void check_box(const char *name, const double low[3], const double high[3], invalid *found) {
  for (size_t k = 0; k < 3; ++k) {
    if (!(low[k] < high[k])) {
      fail(found, name, "maximum_mm");
    }
  }
}

/* Check what the values of a record have to do with each other and with zero. */
static void check_record(const supine_patient_record *record, invalid *found) {
  const supine_patient_frame *frame = &record->patient.frame;
  const bool between = frame->midline > frame->minimum[0] && frame->midline < frame->maximum[0];
  check_box("frame", frame->minimum, frame->maximum, found);
  if (frame->only_side == 0 && !between) {
    fail(found, "frame", "midline_mm");
  }
  for (size_t i = 0; i < record->patient.centre_count; ++i) {
    const supine_patient_centre *centre = &record->patient.centre[i];
    if (centre->side == 0) { /* "both" */
      fail(found, "centres", "lung");
    }
    if (centre->size < 0.0) {
      fail(found, "centres", "displacement_mm");
    }
  }
  for (size_t i = 0; i < record->patient.landmark_count; ++i) {
    if (record->patient.landmark[i].side == 0) {
      fail(found, "landmarks", "lung");
    }
  }
  check_box("emptier_frame", record->emptier[0], record->emptier[1], found);
  for (size_t k = 0; k < record->stiffness.count; ++k) {
    const supine_patient_region *region = &record->stiffness.region[k];
    if (region->side == 0) {
      fail(found, "regions", "lung");
    }
    if (!(region->expandability > 0.0)) {
      fail(found, "regions", "expandability");
    }
    if (!(region->radius > 0.0)) {
      fail(found, "regions", "radius_mm");
    }
  }
}

static supine_status check_version(const char *name, const json_t *root, supine_error *error) {
  const char *format = json_string_value(json_object_get(root, "format"));
  const json_t *version = json_object_get(root, "version");
  const bool known = format != NULL && strcmp(format, SUPINE_PATIENT_FORMAT) == 0;
  SUPINE_REFUSE_IF(!known || !json_is_integer(version), error, SUPINE_ERROR_FORMAT,
                   "%s: not a patient file: give one made from scans of the patient", name);
  SUPINE_REFUSE_IF(json_integer_value(version) != SUPINE_PATIENT_VERSION, error,
                   SUPINE_ERROR_FORMAT,
                   "%s: a patient file of version %" JSON_INTEGER_FORMAT
                   ", but only version %d can be read: make it again from the scans",
                   name, json_integer_value(version), SUPINE_PATIENT_VERSION);
  return SUPINE_OK;
}

/* Decode the record in `json`, which is NULL if the text is no JSON. */
static supine_status decode(const char *name, const json_t *json, const json_error_t *where,
                            supine_patient_record *record, supine_error *error) {
  invalid found = {.key = ""};
  SUPINE_REFUSE_IF(json == NULL, error, SUPINE_ERROR_FORMAT, "%s:%d: %s", name, where->line,
                   where->text);
  SUPINE_TRY(check_version(name, json, error));
  memset(record, 0, sizeof *record);
  decode_members("", json, &supine_patient_law_keys, (char *)record, &found);
  decode_members("", json, &supine_patient_fit_keys, (char *)record, &found);
  check_record(record, &found);
  record->force.pair = true;
  SUPINE_REFUSE_IF(found.key[0] != '\0', error, SUPINE_ERROR_FORMAT,
                   "%s: \"%s\" is missing or invalid: make the file again from the scans", name,
                   found.key);
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
