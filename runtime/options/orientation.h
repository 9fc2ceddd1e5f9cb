/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The options that say where gravity points: the same for every command that needs one direction.
 */
#ifndef SUPINE_ORIENTATION_H
#define SUPINE_ORIENTATION_H

#include "runtime/options/command.h"

/* Values of struct option beyond the short options'. */
enum {
  OPTION_POSTURE = 900,
  OPTION_GRAVITY,
  OPTION_QUATERNION,
  OPTION_TILT,
  OPTION_ORIENTATION_END
};

#define SUPINE_ORIENTATION_OPTIONS                                                                 \
  {"posture", required_argument, NULL, OPTION_POSTURE},                                            \
      {"gravity", required_argument, NULL, OPTION_GRAVITY},                                        \
      {"quaternion", required_argument, NULL, OPTION_QUATERNION}, {                                \
    "tilt", required_argument, NULL, OPTION_TILT                                                   \
  }

/* What they add to a command's help. */
extern const char supine_options_orientation_help[];

/* Starts as {0}: not given. */
typedef struct supine_orientation {
  bool given;
  double gravity[3]; /* unit, body axes; not yet tilted */
  double tilt;       /* degrees */
} supine_orientation;

/* Takes one option; SUPINE_EXIT_OK, or an exit code after a message. */
int supine_options_orientation_take(supine_orientation *orientation, const char *command,
                                    int option, const char *value);

/* Reads a posture's name; unknown ones are answered with the nearest. */
int supine_options_orientation_posture(const char *command, const char *name, double gravity[3]);

/* The unit direction of gravity, tilt included; supine where only a tilt was given. Where nothing
 * was given at all: a usage error. */
int supine_options_orientation_finish(const supine_orientation *orientation, const char *command,
                                      double gravity[3]);

#endif
