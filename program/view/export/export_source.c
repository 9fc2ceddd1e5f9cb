/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Open a basis file to export, and compute poses during a breath. */
#include <math.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "program/view/export/export.h"

supine_status supine_export_source_open(const char *path, export_source *source,
                                        supine_error *error) {
  export_source made = {0};
  static const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  SUPINE_TRY(supine_basis_open_with(path, &exact, &made.basis, error));
  made.info = supine_basis_get_info(made.basis);
  made.terms = supine_sh_count(made.info->band);
  const supine_tensor *resting = supine_basis_tensor(made.basis, "resting_volume");
  if (made.info->has_rest) {
    made.resting = resting->data;
    made.resting_rows = resting->rank == 2 ? resting->shape[0] : 1;
  }
  *source = made;
  return SUPINE_OK;
}

void supine_export_source_close(export_source *source) {
  supine_basis_close(source->basis);
  *source = (export_source){0};
}

void supine_export_box(const export_source *source, double low[3], double high[3]) {
  for (size_t i = 0; i < 3 * source->info->vertex_count; ++i) {
    low[i % 3] = fmin(low[i % 3], (double)source->info->vertices[i]);
    high[i % 3] = fmax(high[i % 3], (double)source->info->vertices[i]);
  }
}

void supine_export_field(const export_source *source, size_t vertex, size_t mode, double u[3]) {
  const size_t k = source->info->mode_count;
  for (size_t axis = 0; axis < 3; ++axis) {
    u[axis] = source->info->vector
                  ? (double)source->info->coefficients[(3 * vertex + axis) * k + mode]
                  : (double)source->info->coefficients[vertex * k + mode] *
                        (double)source->info->direction[3 * vertex + axis];
  }
}

supine_status supine_export_breath_pose(const export_source *source, double breath,
                                        const double g[3], double fraction, supine_pose *pose,
                                        supine_error *error) {
  const supine_volume_kind from = source->info->has_rest ? SUPINE_VOLUME_REST : SUPINE_VOLUME_SCAN;
  supine_state state = {.gravity = {g[0], g[1], g[2]}};
  if (!source->info->is_fields) {
    state.volume = (supine_volume){from, fraction * breath};
  }
  return supine_basis_pose(source->basis, &state, pose, error);
}

json_t *supine_export_metadata(const export_source *source) {
  size_t count = 0;
  const supine_metadata *all = supine_basis_all_metadata(source->basis, &count);
  json_t *metadata = json_object();
  for (size_t i = 0; i < count; ++i) {
    (void)json_object_set_new(metadata, all[i].key, json_string(all[i].value));
  }
  return metadata;
}
