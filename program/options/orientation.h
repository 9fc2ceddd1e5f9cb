/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The options that say where gravity points: the same for every command that needs one direction.
 */
#ifndef SUPINE_ORIENTATION_H
#define SUPINE_ORIENTATION_H

#include "program/options/command.h"

/* A table of options that fills a supine_orientation: {.table = ..., SUPINE_FILLS(...)}. */
extern const supine_option supine_options_orientation[];

/* Starts as {0}: not given. */
typedef struct supine_orientation {
  bool given;
  double gravity[3]; /* unit, body axes; not yet tilted */
  double tilt;       /* degrees */
} supine_orientation;

enum { SUPINE_POSTURE_NAME_MAX = 48 };

/* Parse a posture into a unit direction of gravity: "prone"; "supine+15", tilted by degrees towards
 * the head; "0.6:0:-0.8", gravity in body axes. Statuses as supine_state_parse_posture. */
supine_status supine_options_posture(const char *text, double gravity[3], supine_error *error);

/* Compute the unit direction of gravity, tilt included; supine where only a tilt was given.
 * @retval SUPINE_ERROR_ARGUMENT  nothing was given */
supine_status supine_options_gravity(const supine_orientation *orientation, double gravity[3],
                                     supine_error *error);

#endif
