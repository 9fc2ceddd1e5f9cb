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

/* Table of options that fills a supine_model_options. */
extern const supine_option supine_command_model_options[];

typedef struct supine_model_options {
  supine_source_options source;
  supine_model_choice choice;
  const supine_patient_record *patient; /* patient model, owned by the caller; NULL: none */
  double *patient_arrays;               /* used by the patient model: see supine_patient_model */
  supine_source made_from;  /* the lungs as loaded, with the axes and units of their files */
  supine_prepared prepared; /* the model of the lungs */
  char assumed[800];        /* sentence about the assumptions */
  supine_findings findings; /* findings about the files and the model */
} supine_model_options;

/* Set the defaults of a zeroed struct. */
void supine_command_model_options_begin(supine_model_options *options);

/* Load the files, print the findings and prepare the model.
 * @param keep  true: ignore --scanned and take the surface as the reference */
supine_status supine_command_model_load(supine_model_options *options, const char *command,
                                        char **paths, size_t count, bool keep, supine_error *error);

/* Load surfaces, "left.ply,right.ply", or a label map as one pair of lungs; print the findings.
 * @param lungs  zeroed */
supine_status supine_command_load_lungs(const char *command, const char *operand,
                                        const supine_source_options *options, supine_lungs *lungs,
                                        supine_error *error);

/* Release what supine_command_model_load allocated. */
void supine_command_model_options_free(supine_model_options *options);

#endif
