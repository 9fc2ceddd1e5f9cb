/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute a breath frame by frame, and write the frames. */
#ifndef SUPINE_BREATH_FRAMES_H
#define SUPINE_BREATH_FRAMES_H

#include "program/options/breath_turn.h"
#include "program/options/state_options.h"

typedef struct supine_command_breath_frames {
  const char *path; /* file to write, .vtp or .safetensors */
  supine_options_breath breath;
  bool allow_folds, as_scanned;
  supine_from from;
  const char *made_by; /* the command line */
} supine_command_breath_frames;

/* Compute and write the frames, and print their volumes and compute times. */
supine_status supine_command_breath_write(const supine_command_breath_frames *wanted,
                                          const supine_basis *basis, supine_error *error);

#endif
