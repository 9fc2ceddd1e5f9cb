/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A basis with all of its tensors; the run-time library has checked them. */
#include <supine/sh.h>

#include "runtime/export/export.h"

static const void *tensor(const supine_safetensors *file, const char *name) {
  const supine_tensor *found = supine_safetensors_find(file, name);
  return found == NULL ? NULL : found->data;
}

supine_status supine_export_source_open(const char *path, export_source *source,
                                        supine_error *error) {
  export_source made = {0};
  static const supine_basis_options exact = {.storage = SUPINE_STORAGE_EXACT};
  supine_status status = supine_basis_open_with(path, &exact, &made.basis, error);
  if (status == SUPINE_OK) {
    status = supine_safetensors_open(path, &made.file, error);
  }
  if (status != SUPINE_OK) {
    supine_export_source_close(&made);
    return status;
  }
  made.info = supine_basis_get_info(made.basis);
  made.terms = supine_sh_count(made.info->band);
  made.vertices = supine_basis_vertices(made.basis);
  made.triangles = supine_basis_triangles(made.basis);
  made.direction = made.info->vector ? NULL : tensor(made.file, "direction");
  made.coefficients = tensor(made.file, "coefficients");
  made.modes = tensor(made.file, "modes");
  if (made.info->has_volume) {
    made.linear = tensor(made.file, "volume_linear");
    made.quadratic = tensor(made.file, "volume_quadratic");
    made.cubic = tensor(made.file, "volume_cubic");
  }
  *source = made;
  return SUPINE_OK;
}

void supine_export_source_close(export_source *source) {
  supine_safetensors_close(source->file);
  supine_basis_close(source->basis);
  *source = (export_source){0};
}

void supine_export_field(const export_source *source, size_t vertex, size_t mode, double u[3]) {
  const size_t k = source->info->mode_count;
  for (size_t axis = 0; axis < 3; ++axis) {
    u[axis] = source->info->vector ? (double)source->coefficients[(3 * vertex + axis) * k + mode]
                                   : (double)source->coefficients[vertex * k + mode] *
                                         (double)source->direction[3 * vertex + axis];
  }
}
