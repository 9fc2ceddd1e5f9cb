/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute and print the expected errors of the vertices in a state. */
#include <math.h>
#include <stdlib.h>

#include "program/options/expected_output.h"

supine_status supine_options_expected_find(const supine_basis *basis, const supine_state *state,
                                           const supine_state *from, supine_expected *expected,
                                           supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  float *sigma = malloc(n * sizeof *sigma);
  double square = 0.0;
  double along = 0.0;
  if (sigma == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  const supine_status status = supine_expected_error(basis, state, from, sigma, error);
  if (status != SUPINE_OK) {
    free(sigma);
    return status == SUPINE_ERROR_UNSUPPORTED || status == SUPINE_ERROR_OPEN_SURFACE ? SUPINE_OK
                                                                                     : status;
  }
  for (size_t i = 0; i < n; ++i) {
    square += (double)sigma[i] * (double)sigma[i];
    expected->largest = fmax(expected->largest, (double)sigma[i]);
  }
  for (size_t i = 0; i < 3; ++i) {
    along += state->gravity[i] * from->gravity[i];
  }
  expected->sigma = sigma;
  expected->rms = sqrt(square / (double)n);
  expected->turned = along < 1.0 - 1e-9;
  return SUPINE_OK;
}

void supine_options_expected_free(supine_expected *expected) {
  free(expected->sigma);
  *expected = (supine_expected){0};
}

void supine_options_expected_print(const supine_expected *expected, FILE *file) {
  if (expected->sigma != NULL) {
    (void)fprintf(file, "expected error %.1f mm (RMS over the points), %.1f mm at most%s\n",
                  expected->rms, expected->largest,
                  expected->turned ? "; an extrapolation, as the posture changes" : "");
  }
}
