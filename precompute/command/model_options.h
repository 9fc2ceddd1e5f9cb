/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The options that choose the lungs and the model: the same for every command that runs the
 * physics. */
#ifndef SUPINE_MODEL_OPTIONS_H
#define SUPINE_MODEL_OPTIONS_H

#include "precompute/physics/solve.h"
#include "precompute/precompute.h"
#include "precompute/tissue/disease.h"
#include "precompute/tissue/expandability.h"

#include "runtime/options/command.h"

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
  OPTION_EXPANDABILITY,
  OPTION_LESION,
  OPTION_LUNG,
  OPTION_REACH,
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
      {"direction", required_argument, NULL, OPTION_DIRECTION},                                    \
      {"constants", required_argument, NULL, OPTION_CONSTANTS},                                    \
      {"expandability", required_argument, NULL, OPTION_EXPANDABILITY},                            \
      {"lesion", required_argument, NULL, OPTION_LESION},                                          \
      {"lung", required_argument, NULL, OPTION_LUNG}, {                                            \
    "reach", required_argument, NULL, OPTION_REACH                                                 \
  }

/* What they add to a command's help. */
extern const char supine_command_model_options_help[];

enum { MODEL_LESIONS_MAX = 64 };

typedef struct supine_model_options {
  supine_mesh_load_options load;
  bool has_midline;
  double midline;
  supine_model model;
  const char *expandability; /* a file, or NULL: the law */
  supine_expandability_law law;
  size_t lesion_count;
  supine_lesion lesions[MODEL_LESIONS_MAX];
  double left_share, right_share; /* 0: not given */
  double reach;                   /* mm; 0: the paper's */
  const char *direction;          /* a file of vectors, or NULL: the law */
  double *vectors;                /* what loading made of it; the model's */
  double *stiffness;              /* what loading made of the expandability; the model's */
} supine_model_options;

supine_model_options supine_command_model_options_default(void);

/* Takes one option; SUPINE_EXIT_OK, or an exit code after a message. */
int supine_command_model_options_take(supine_model_options *options, const char *command,
                                      int option, const char *value);

/* Loads the surfaces (all at once), says on stderr what was found that the user should know, joins
 * them, and sets the model's stiffness and the lungs' diseases; an exit code. */
int supine_command_model_load(supine_model_options *options, const char *command, char **paths,
                              size_t count, supine_lungs *lungs);

/* Releases what supine_command_model_load allocated. */
void supine_command_model_options_free(supine_model_options *options);

#endif
