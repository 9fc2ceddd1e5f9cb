/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute and print the expected errors of the vertices in a state. */
#ifndef SUPINE_OPTIONS_EXPECTED_H
#define SUPINE_OPTIONS_EXPECTED_H

#include <stdbool.h>
#include <stdio.h>

#include <supine/locate.h>

#define SUPINE_EXPECTED_MEANING                                                                    \
  "3-D RMS; half of all points lie within 0.9 times this distance, 95 % within 1.8 times"
#define SUPINE_EXPECTED_SUPPORT                                                                    \
  "It was measured on full breaths in one posture; for a change of posture it is an "              \
  "extrapolation."

/* Expected errors. Zero-initialise, and release with supine_options_expected_free. */
typedef struct supine_expected {
  float *sigma;        /* [N] mm; NULL: unknown */
  double rms, largest; /* RMS and maximum over the vertices, mm */
  bool turned;         /* the two states differ in posture */
} supine_expected;

/* Compute the expected errors of a displacement from one state to another. They are unknown for
 * fields of another simulator and for open surfaces: `expected` is unchanged.
 * @retval those of supine_basis_pose, SUPINE_ERROR_MEMORY */
supine_status supine_options_expected_find(const supine_basis *basis, const supine_state *state,
                                           const supine_state *from, supine_expected *expected,
                                           supine_error *error);
void supine_options_expected_free(supine_expected *expected);

/* Print their RMS and maximum in one line; nothing where they are unknown. */
void supine_options_expected_print(const supine_expected *expected, FILE *file);

#endif
