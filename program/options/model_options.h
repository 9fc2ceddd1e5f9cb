/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Options that choose the lungs and the model of their mechanics, for commands that solve it. */
#ifndef SUPINE_MODEL_OPTIONS_H
#define SUPINE_MODEL_OPTIONS_H

#include "precompute/patient/patient_file.h"
#include "precompute/physics/solve.h"
#include "precompute/precompute.h"
#include "precompute/prepare.h"
#include "precompute/source.h"

#include "program/options/command.h"

/* Option table that fills a supine_model_options. */
extern const supine_option supine_command_model_options[];

typedef struct supine_model_options {
  supine_source_options source;
  supine_model_choice choice;
  supine_patient_record *patient; /* owned by the caller; NULL if there is no patient model */
  double *patient_arrays; /* [4 N] displacement per unit force [N, 3], mm; relative stiffness [N] */
  supine_source made_from; /* the loaded lungs, with the axes and units of their files */
  supine_prepared prepared;
  char assumed[800]; /* assumptions about the scan and the model, in words */
  supine_findings findings;
} supine_model_options;

/* Load the lungs from the files `paths`, print what the checks of the files found, and prepare the
 * model.
 * @param keep  whether to use the loaded surface as the reference surface, and ignore --scanned */
supine_status supine_command_model_load(supine_model_options *options, const char *command,
                                        char **paths, size_t count, bool keep, supine_error *error);

/* Load lungs from one or two surfaces, such as "left.ply,right.ply", or from a label map, and print
 * what the checks of the files found.
 * @param lungs  must be initialised to zero */
supine_status supine_command_load_lungs(const char *command, const char *operand,
                                        const supine_source_options *options, supine_lungs *lungs,
                                        supine_error *error);

void supine_command_model_options_free(supine_model_options *options);

#endif
