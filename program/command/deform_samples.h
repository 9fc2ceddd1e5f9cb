/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw plausible lungs around deformed or located ones, and write many to a file. */
#ifndef SUPINE_DEFORM_SAMPLES_H
#define SUPINE_DEFORM_SAMPLES_H

#include <supine/locate.h>

/* The samples to write: of a state, or of located lungs. */
typedef struct supine_deform_samples {
  const char *path;
  size_t count, seed;
  const supine_basis *basis;
  const supine_state *state;       /* that of `location`, if it is given */
  const supine_location *location; /* NULL for a state */
} supine_deform_samples;

/* Draw sample `index` of a state: its vertices minus the predicted ones.
 * @param deviation  [N, 3] mm, written */
supine_status supine_command_deform_sample(const supine_basis *basis, const supine_state *state,
                                           size_t seed, size_t index, float *deviation,
                                           supine_error *error);

/* Refuse an output that does not hold samples, and samples without one that does.
 * @param path   NULL if none was given
 * @param given  whether samples were asked for */
supine_status supine_command_deform_samples_check(const char *path, bool given,
                                                  supine_error *error);

/* Write samples 0 to count - 1 to a safetensors file, with progress.
 * @param distance  RMS distance of the samples from the prediction, mm, written
 * @param held      whether each has the volumes of the state, written */
supine_status supine_command_deform_samples(const supine_deform_samples *wanted, double *distance,
                                            bool *held, supine_error *error);

#endif
