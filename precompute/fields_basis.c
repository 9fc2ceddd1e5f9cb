/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A basis of another simulator's fields: fit, volumes, file. */
#include <stdlib.h>

#include "precompute/precompute.h"

#include "precompute/basis_file.h"
#include "precompute/projection/compression.h"

/* Eight parameters: those of supine_precompute, the fields and how they are fitted. */
supine_status supine_precompute_fields(const supine_lungs *lungs, const supine_fields *fields,
                                       const supine_fit_options *options, const char *made_by,
                                       const char *path, supine_fit_report *report,
                                       size_t *mode_count, supine_error *error) {
  supine_compression field = {0};
  supine_volume_forms forms = {0};
  supine_status status = SUPINE_OK;
  double *directions = NULL;
  if (options->scalar) {
    directions = malloc(3 * lungs->mesh.vertex_count * sizeof *directions);
    if (directions == NULL) {
      return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices",
                              lungs->mesh.vertex_count);
    }
  }
  status = supine_fields_fit(fields, options, directions, &field, report, error);
  if (status == SUPINE_OK && lungs->topology.closed) {
    status =
        supine_projection_compression_volume_forms(&field, lungs, NULL, directions, &forms, error);
  }
  if (status == SUPINE_OK) {
    const supine_basis_content content = {.lungs = lungs,
                                          .fit = report,
                                          .directions = directions,
                                          .compression = &field,
                                          .forms = forms.linear != NULL ? &forms : NULL,
                                          .accuracy = &report->accuracy,
                                          .harmonics = options->modes == 0,
                                          .findings = options->findings,
                                          .made_by = made_by};
    status = supine_writer_basis_write(path, &content, error);
  }
  if (mode_count != NULL) {
    *mode_count = field.mode_count;
  }
  supine_projection_compression_free(&field);
  supine_physics_volume_forms_free(&forms);
  free(directions);
  return status;
}
