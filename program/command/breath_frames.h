/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute a breath frame by frame, and write the frames. */
#ifndef SUPINE_BREATH_FRAMES_H
#define SUPINE_BREATH_FRAMES_H

#include "program/options/breath_turn.h"
#include "program/options/pv.h"
#include "program/options/state_options.h"

typedef struct supine_command_breath_frames {
  const char *path; /* file to write, .vtp or .safetensors */
  breath_turn turn; /* both directions are equal if the body does not turn */
  supine_pv_breath breath;
  const char *pv; /* file of the pressure-volume relation; NULL for a normal adult's */
  bool allow_folds, as_scanned;
  supine_from from;
  double fps;
  size_t count;        /* number of frames */
  const char *made_by; /* the command line */
} supine_command_breath_frames;

/* Compute and write the frames, and print their volumes and compute times. */
supine_status supine_command_breath_write(const supine_command_breath_frames *wanted,
                                          const supine_basis *basis, supine_error *error);

#endif
