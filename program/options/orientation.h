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

/* The unit direction of gravity of a posture as people write it: "prone"; "supine+15", tilted by
 * degrees towards the head; "0.6:0:-0.8", gravity in body axes. An exit code; an unknown name is
 * answered with the nearest. */
int supine_options_posture(const char *command, const char *text, double gravity[3]);

/* The unit direction of gravity, tilt included; supine where only a tilt was given. Where nothing
 * was given at all: a usage error. */
int supine_options_orientation_finish(const supine_orientation *orientation, const char *command,
                                      double gravity[3]);

#endif
