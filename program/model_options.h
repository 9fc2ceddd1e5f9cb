/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Options that choose the lungs and the model, shared by commands that run the physics. */
#ifndef SUPINE_MODEL_OPTIONS_H
#define SUPINE_MODEL_OPTIONS_H

#include "precompute/patient/patient_file.h"
#include "precompute/physics/solve.h"
#include "precompute/precompute.h"
#include "precompute/prepare.h"
#include "precompute/source.h"

#include "program/options/command.h"

/* Table of the options that fill a supine_model_options. */
extern const supine_option supine_command_model_options[];

typedef struct supine_model_options {
  supine_source_options source;
  supine_model_choice choice;
  const supine_patient_record *patient; /* owned by the caller; NULL if there is no patient model */
  double *patient_arrays;               /* [4, N] memory that supine_patient_model fills */
  supine_source made_from; /* the loaded lungs, with the axes and units of their files */
  supine_prepared prepared;
  char assumed[800]; /* assumptions about the scan and the model, in words */
  supine_findings findings;
} supine_model_options;

/* Set the defaults. `options` must be initialised to zero. */
void supine_command_model_options_begin(supine_model_options *options);

/* Load the files, print the findings and prepare the model.
 * @param keep  whether to ignore --scanned and use the loaded surface as the reference surface */
supine_status supine_command_model_load(supine_model_options *options, const char *command,
                                        char **paths, size_t count, bool keep, supine_error *error);

/* Load one or two surfaces, such as "left.ply,right.ply", or a label map; print the findings.
 * @param lungs  must be initialised to zero */
supine_status supine_command_load_lungs(const char *command, const char *operand,
                                        const supine_source_options *options, supine_lungs *lungs,
                                        supine_error *error);

void supine_command_model_options_free(supine_model_options *options);

#endif
