/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The options that choose the lungs and the model: the same for every command that runs the
 * physics. */
#ifndef SUPINE_MODEL_OPTIONS_H
#define SUPINE_MODEL_OPTIONS_H

#include "precompute/lungs/disease.h"
#include "precompute/lungs/expandability.h"
#include "precompute/patient/patient_file.h"
#include "precompute/physics/solve.h"
#include "precompute/precompute.h"

#include "program/label_options.h"

/* A table of options that fills a supine_model_options: {.table = ..., SUPINE_FILLS(...)}. */
extern const supine_option supine_command_model_options[];

enum { MODEL_LESIONS_MAX = 64 };

typedef struct supine_model_options {
  supine_mesh_load_options load;
  supine_label_options maps;
  bool has_midline;
  double midline;
  int law_choice;     /* as supine_law, or SUPINE_LAW_COUNT: by the scan's state */
  supine_model model; /* until loading, NAN where no option of its own says what */
  supine_scan scan;
  bool has_scan;
  supine_resting resting;
  supine_reference reference; /* what loading found */
  char assumed[512];          /* likewise, in a sentence */
  supine_findings findings;   /* and what was found wrong with them */
  supine_scan_frame frame;
  const supine_patient_record *patient; /* a person's own law, the caller's; NULL: none */
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
 * them, sets the model's law, stiffness and diseases, and takes the lungs to full inflation; an
 * exit code. `keep`: the surface is the reference as it stands, whatever the options say. */
int supine_command_model_load(supine_model_options *options, const char *command, char **paths,
                              size_t count, bool keep, supine_lungs *lungs);

/* Releases what supine_command_model_load allocated. */
void supine_command_model_options_free(supine_model_options *options);

#endif
