/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A basis with all of its tensors. */
#include <supine/sh.h>

#include "program/export/export.h"

supine_status supine_export_source_open(const char *path, export_source *source,
                                        supine_error *error) {
  export_source made = {0};
  static const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  const supine_status status = supine_basis_open_with(path, &exact, &made.basis, error);
  if (status != SUPINE_OK) {
    return status;
  }
  made.info = supine_basis_get_info(made.basis);
  made.terms = supine_sh_count(made.info->band);
  made.vertices = made.info->vertices;
  made.triangles = made.info->triangles;
  made.direction = made.info->direction;
  made.coefficients = made.info->coefficients;
  made.modes = made.info->modes;
  const supine_tensor *resting = supine_basis_tensor(made.basis, "resting_volume");
  if (made.info->has_rest) {
    made.resting = resting->data;
    made.resting_rows = resting->rank == 2 ? resting->shape[0] : 1;
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    made.bent = made.bent || made.info->bend[axis] != 0;
  }
  *source = made;
  return SUPINE_OK;
}

void supine_export_source_close(export_source *source) {
  supine_basis_close(source->basis);
  *source = (export_source){0};
}

void supine_export_field(const export_source *source, size_t vertex, size_t field, double u[3]) {
  const size_t k = source->info->mode_count;
  const size_t mode = field % k;
  for (size_t axis = 0; axis < 3; ++axis) {
    u[axis] = source->info->vector ? (double)source->coefficients[(3 * vertex + axis) * k + mode]
                                   : (double)source->coefficients[vertex * k + mode] *
                                         (double)source->direction[3 * vertex + axis];
    u[axis] *= field < k ? 1 : source->info->bend[axis];
  }
}
