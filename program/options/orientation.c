/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Options that determine the direction of gravity, and lists of postures. */
#include <math.h>
#include <string.h>

#include <supine/state.h>

#include "program/options/orientation.h"

/* Normalise a vector and return its length; leave the null vector unchanged and return 0. */
static double make_unit(double g[3]) {
  const double largest = fmax(fabs(g[0]), fmax(fabs(g[1]), fabs(g[2])));
  double square = 0.0;
  for (int i = 0; i < 3 && largest > 0.0; ++i) {
    g[i] /= largest; /* so that no square overflows or vanishes */
    square += g[i] * g[i];
  }
  for (int i = 0; i < 3 && largest > 0.0; ++i) {
    g[i] /= sqrt(square);
  }
  return largest * sqrt(square);
}

supine_status supine_options_posture(const char *text, double gravity[3], supine_error *error) {
  supine_state state;
  const supine_status status = supine_state_parse_posture(text, &state, error);
  if (status == SUPINE_OK) {
    memcpy(gravity, state.gravity, sizeof state.gravity);
  }
  return status;
}

static supine_status read_posture(const char *text, void *field, supine_error *error) {
  return supine_options_posture(text, field, error);
}

static supine_status read_gravity(const char *text, void *field, supine_error *error) {
  if (!supine_options_parse_numbers(text, 3, field)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  return make_unit(field) > 0.0 ? SUPINE_OK
                                : supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                                   "0,0,0 has no direction: give one, as 0,1,0 "
                                                   "for supine");
}

static supine_status read_quaternion(const char *text, void *field, supine_error *error) {
  double q[4];
  (void)error;
  return supine_options_fits(supine_options_parse_numbers(text, 4, q) &&
                             supine_posture_quaternion(q, field) == SUPINE_OK);
}

#define GRAVITY                                                                                    \
  SUPINE_FILLS(supine_orientation, gravity), SUPINE_SAYS_GIVEN(supine_orientation, given),         \
      .rivals = "gravity"

static const char *const postures[] = {"supine",  "prone",    "left", "right",
                                       "upright", "inverted", NULL};

const supine_option supine_options_orientation[] = {
    {.help = "Direction of gravity (one of the first three):"},
    {"posture", 0, "NAME",
     "supine, prone, left or right (left or right lateral decubitus), upright, inverted (head "
     "down), or a DICOM patient position: HFS, FFS, HFP, FFP, HFDL, FFDL, HFDR, FFDR; "
     "supine+15 is supine with --tilt 15",
     GRAVITY, .read = read_posture, .choices = postures},
    {"gravity", 0, "X,Y,Z",
     "a direction in body axes: x to the left, y to the back, z to the head; supine is 0,1,0",
     GRAVITY, .read = read_gravity, .wants = "three finite numbers, X,Y,Z"},
    {"quaternion", 0, "W,X,Y,Z",
     "rotation from body axes to a world whose z points up; 1,0,0,0 is upright", GRAVITY,
     .read = read_quaternion, .wants = "four finite numbers, W,X,Y,Z, not all 0"},
    {"tilt", 0, "DEGREES",
     "angle by which gravity is turned in the sagittal plane from the back towards the head; "
     "supine with 15 is Trendelenburg (head down)",
     SUPINE_FILLS(supine_orientation, tilt), .wants = "degrees"},
    {.name = NULL}};

supine_status supine_options_gravity(const supine_orientation *orientation, double gravity[3],
                                     supine_error *error) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  if (!orientation->given && orientation->tilt == 0.0) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the direction of gravity is missing: give --posture, --gravity or "
                            "--quaternion");
  }
  return supine_posture_tilt(orientation->given ? orientation->gravity : supine, orientation->tilt,
                             gravity);
}

supine_status supine_options_posture_list_parse(const char *text, supine_posture_list *list,
                                                supine_error *error) {
  supine_status status = SUPINE_OK;
  list->count = 0;
  for (const char *at = text; status == SUPINE_OK;) {
    const size_t length = strcspn(at, ",");
    if (list->count == SUPINE_POSTURE_LIST_MAX) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "more than %d postures: name fewer",
                              SUPINE_POSTURE_LIST_MAX);
    }
    supine_posture_item *item = &list->item[list->count++];
    if (length == 0 || length >= sizeof item->name) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "no posture '%.*s': give supine, prone, left, right, upright or "
                              "inverted, or a gravity X:Y:Z",
                              (int)length, at);
    }
    memcpy(item->name, at, length);
    item->name[length] = '\0';
    status = supine_options_posture(item->name, item->gravity, error);
    if (at[length] == '\0') {
      break;
    }
    at += length + 1;
  }
  return status;
}

const char *supine_options_posture_label(const char *name) {
  return strcmp(name, "left") == 0 ? "left side" : strcmp(name, "right") == 0 ? "right side" : name;
}
