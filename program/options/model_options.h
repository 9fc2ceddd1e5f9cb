/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Options that choose the lungs and the model of their mechanics, for commands that solve it. */
#ifndef SUPINE_MODEL_OPTIONS_H
#define SUPINE_MODEL_OPTIONS_H

#include <supine/precompute.h>

#include "precompute/prepare.h"

#include "program/options/command.h"

/* Options of lungs and their model. supine_options_prepare completes `precompute` from the
 * others. */
typedef struct supine_model_options {
  supine_precompute_options precompute;
  supine_mesh_load_options frame; /* axes and unit */
  char axes[4];                   /* the letters of frame.axes */
  bool has_law;
  int law;           /* a supine_law */
  supine_state full; /* the kind of its volume is SUPINE_VOLUME_DEFAULT if it is not given */
} supine_model_options;

/* Option table that fills a supine_model_options. */
extern const supine_option supine_options_model[];

/* Load the lungs from the given files and make their model. Print what the checks found. */
supine_status supine_options_prepare(const char *command, supine_model_options *model,
                                     const supine_arguments *given, supine_prepared *prepared,
                                     supine_error *error);

/* Drop pairs of landmarks that were mismatched, and warn of them
 * (supine_patient_drop_mismatched). */
supine_status supine_options_drop_mismatched(const char *command, const char *path,
                                             supine_patient_pairs *pairs, supine_error *error);

/* Load lungs from one or two surfaces, such as "left.ply,right.ply", or from a label map, and print
 * what the checks of the files found.
 * @param lungs  must be initialised to zero */
supine_status supine_options_load_lungs(const char *command, const char *operand,
                                        const supine_source_options *options, supine_lungs *lungs,
                                        supine_error *error);

#endif
