/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Options that determine the direction of gravity, and lists of postures. */
#ifndef SUPINE_ORIENTATION_H
#define SUPINE_ORIENTATION_H

#include "program/options/command.h"

/* Table of options that fills a supine_orientation: {.table = ..., SUPINE_FILLS(...)}. */
extern const supine_option supine_options_orientation[];

typedef struct supine_orientation {
  bool given;        /* false: no direction yet, though perhaps a tilt */
  double gravity[3]; /* unit, body axes; not yet tilted */
  double tilt;       /* degrees */
} supine_orientation;

/* Parse a posture into a unit direction of gravity: "prone"; "supine+15", tilted by degrees towards
 * the head; "0.6:0:-0.8", gravity in body axes. Statuses as supine_state_parse_posture. */
supine_status supine_options_posture(const char *text, double gravity[3], supine_error *error);

/* Compute the unit direction of gravity, tilt included; supine where only a tilt was given.
 * @retval SUPINE_ERROR_ARGUMENT  nothing was given */
supine_status supine_options_gravity(const supine_orientation *orientation, double gravity[3],
                                     supine_error *error);

enum { SUPINE_POSTURE_NAME_MAX = 48, SUPINE_POSTURE_LIST_MAX = 32 };

/* A posture as the user wrote it, and its unit direction of gravity. */
typedef struct supine_posture_item {
  char name[SUPINE_POSTURE_NAME_MAX];
  double gravity[3];
} supine_posture_item;

typedef struct supine_posture_list {
  size_t count;
  supine_posture_item item[SUPINE_POSTURE_LIST_MAX];
} supine_posture_list;

/* The syntax of a list, for a command's help. */
#define SUPINE_POSTURE_LIST_HELP                                                                   \
  "A posture is a name (supine, prone, left, right, upright, inverted, or a DICOM patient "        \
  "position), a name with a tilt towards the head in degrees (supine+15: Trendelenburg), "         \
  "or a gravity in body axes, X:Y:Z (0.6:0:-0.8)."

/* Parse "supine,prone,supine+15,0.6:0:-0.8".
 * @retval SUPINE_ERROR_ARGUMENT */
supine_status supine_options_posture_list_parse(const char *text, supine_posture_list *list,
                                                supine_error *error);

/* Return a posture's name in words: "left side" for "left"; other names unchanged. */
const char *supine_options_posture_label(const char *name);

#endif
