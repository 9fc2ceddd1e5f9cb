/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw plausible lungs around a deformed basis for 'supine deform', and write many to a file. */
#ifndef SUPINE_DEFORM_SAMPLES_H
#define SUPINE_DEFORM_SAMPLES_H

#include <supine/runtime.h>

/* The samples to write. */
typedef struct supine_deform_samples {
  const char *path;
  size_t count, seed;
} supine_deform_samples;

/* Draw sample `index` of a state: its vertices minus the predicted ones.
 * @param deviation  [N, 3] mm, written */
supine_status supine_command_deform_sample(const supine_basis *basis, const supine_state *state,
                                           size_t seed, size_t index, float *deviation,
                                           supine_error *error);

/* Write samples 0 to count - 1 of a state to a safetensors file, with progress. */
supine_status supine_command_deform_samples(const supine_deform_samples *wanted,
                                            const supine_basis *basis, const supine_state *state,
                                            supine_error *error);

#endif
