/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make a basis: compute what it stores, from the model or from another simulator's fields, and
 * print it. */
#include <stdlib.h>

#include "base/output.h"
#include "precompute/precompute.h"
#include <supine/inputs.h>

/* Refuse a basis that misses more than half of the displacement. */
static supine_status check_error(const supine_computed *made, supine_error *error) {
  const double part = made->accuracy.relative_rms;
  const supine_input_verdict verdict = supine_input_judge(SUPINE_INPUT_BASIS_ERROR, part);
  SUPINE_REFUSE_IF(
      verdict == SUPINE_INPUT_REFUSED, error, SUPINE_ERROR_NUMERICAL,
      "the basis, of band %zu with %zu mode%s, would have an error of %.0f %% of the displacement: "
      "choose a higher band and more modes, or simulate more directions; if these are high, check "
      "the numerical libraries (FFTW, GSL, OpenBLAS)",
      made->compression.band, made->compression.mode_count,
      made->compression.mode_count == 1 ? "" : "s", 100.0 * part);
  return SUPINE_OK;
}

supine_status supine_precompute(const supine_prepared *prepared, const supine_basis_choice *choice,
                                supine_bytes *bytes, supine_basis_report *report,
                                supine_error *error) {
  SUPINE_FREED_BY(supine_precompute_computed_free) supine_computed made = {.turned_over = 0.0};
  SUPINE_TRY(supine_precompute_tell_progress(choice, 0, error));
  if (choice->fields != NULL) {
    SUPINE_TRY(supine_precompute_from_fields(prepared, choice, &made, error));
  } else {
    SUPINE_TRY(supine_precompute_from_model(prepared, choice, &made, error));
  }
  SUPINE_TRY(supine_precompute_tell_progress(choice, 5, error));
  SUPINE_TRY(supine_precompute_print(prepared, choice, &made, bytes, error));
  const supine_status status = check_error(&made, error);
  if (status != SUPINE_OK) {
    free(bytes->data);
    *bytes = (supine_bytes){0};
    return status;
  }
  if (report != NULL) {
    *report = (supine_basis_report){.band = made.compression.band,
                                    .mode_count = made.compression.mode_count,
                                    .cluster_count = made.clusters.count,
                                    .accuracy = made.accuracy,
                                    .turned_over = made.turned_over,
                                    .fit = made.fit.report};
  }
  return supine_precompute_tell_progress(choice, 7, error);
}

supine_status supine_precompute_save(const char *path, const supine_bytes *bytes,
                                     supine_error *error) {
  supine_output output;
  SUPINE_TRY(supine_output_open(path, &output, error));
  (void)fwrite(bytes->data, 1, bytes->size, output.file); /* the commit reports errors */
  return supine_output_commit(&output, error);
}
