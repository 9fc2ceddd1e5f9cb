/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The options that choose the lungs and the model: the same for every command that runs the
 * physics. */
#ifndef SUPINE_MODEL_OPTIONS_H
#define SUPINE_MODEL_OPTIONS_H

#include <supine/precompute.h>

#include "../../runtime/command/command.h"

/* Values of struct option beyond the short options'. */
enum {
  OPTION_AXES = 1000,
  OPTION_UNITS,
  OPTION_MIDLINE,
  OPTION_BASE,
  OPTION_GAIN,
  OPTION_BOX_FORCE,
  OPTION_SOFTEN,
  OPTION_DIRECTION,
  OPTION_CONSTANTS,
  OPTION_MODEL_END
};

#define SUPINE_MODEL_OPTIONS                                                                       \
  {"axes", required_argument, NULL, OPTION_AXES},                                                  \
      {"units", required_argument, NULL, OPTION_UNITS},                                            \
      {"midline", required_argument, NULL, OPTION_MIDLINE},                                        \
      {"base", required_argument, NULL, OPTION_BASE},                                              \
      {"gain", required_argument, NULL, OPTION_GAIN},                                              \
      {"box-force", required_argument, NULL, OPTION_BOX_FORCE},                                    \
      {"soften", required_argument, NULL, OPTION_SOFTEN},                                          \
      {"direction", required_argument, NULL, OPTION_DIRECTION}, {                                  \
    "constants", required_argument, NULL, OPTION_CONSTANTS                                         \
  }

/* What they add to a command's help. */
extern const char supine_model_options_help[];

typedef struct supine_model_options {
  supine_mesh_load_options load;
  bool has_midline;
  double midline;
  supine_model model;
} supine_model_options;

supine_model_options supine_model_options_default(void);

/* Takes one option; SUPINE_EXIT_OK, or an exit code after a message. */
int supine_model_options_take(supine_model_options *options, const char *command, int option,
                              const char *value);

/* Loads the surfaces (all at once), says on stderr what was found that the user should know, and
 * joins them; an exit code. */
int supine_model_load(const supine_model_options *options, const char *command, char **paths,
                      size_t count, supine_lungs *lungs);

#endif
