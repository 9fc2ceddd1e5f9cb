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

/* A table of options that fills a supine_model_options: {.table = ..., SUPINE_FILLS(...)}. */
extern const supine_option supine_command_model_options[];

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
  const char *direction;          /* a file of vectors, or NULL: the law */
  double *vectors;                /* what loading made of it; the model's */
  double *factors;                /* of the lesions; the model's */
  double *stiffness;              /* what loading made of the expandability; the model's */
} supine_model_options;

/* The defaults, of a zeroed struct. */
void supine_command_model_options_begin(supine_model_options *options);

/* Loads the surfaces (all at once), says on stderr what was found that the user should know, joins
 * them, and sets the model's stiffness and the lungs' diseases; an exit code. */
int supine_command_model_load(supine_model_options *options, const char *command, char **paths,
                              size_t count, supine_lungs *lungs);

/* Releases what supine_command_model_load allocated. */
void supine_command_model_options_free(supine_model_options *options);

#endif
