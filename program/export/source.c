/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Open a basis to export, and compute poses during a breath. */
#include <math.h>
#include <stdlib.h>

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
  *source = made;
  return SUPINE_OK;
}

void supine_export_source_close(export_source *source) {
  supine_basis_close(source->basis);
  *source = (export_source){0};
}

void supine_export_box(const export_source *source, double low[3], double high[3]) {
  for (size_t i = 0; i < 3 * source->info->vertex_count; ++i) {
    low[i % 3] = fmin(low[i % 3], (double)source->vertices[i]);
    high[i % 3] = fmax(high[i % 3], (double)source->vertices[i]);
  }
}

void supine_export_field(const export_source *source, size_t vertex, size_t mode, double u[3]) {
  const size_t k = source->info->mode_count;
  for (size_t axis = 0; axis < 3; ++axis) {
    u[axis] = source->info->vector ? (double)source->coefficients[(3 * vertex + axis) * k + mode]
                                   : (double)source->coefficients[vertex * k + mode] *
                                         (double)source->direction[3 * vertex + axis];
  }
}

supine_status supine_export_breath_set(const export_source *source, double volume, double largest,
                                       export_breath *breath, supine_error *error) {
  static const double supine[3] = {0, 1, 0};
  *breath = (export_breath){.volume = volume, .largest = largest};
  if (source->info->has_volume) {
    return SUPINE_OK;
  }
  supine_pose pose;
  double farthest = 0;
  (void)supine_basis_weights(source->basis, supine, pose.weights); /* a valid direction */
  for (size_t i = 0; i < source->info->vertex_count; ++i) {
    double sum[3] = {0, 0, 0};
    for (size_t mode = 0; mode < source->info->mode_count; ++mode) {
      double u[3];
      supine_export_field(source, i, mode, u);
      for (size_t axis = 0; axis < 3; ++axis) {
        sum[axis] += pose.weights[mode] * u[axis];
      }
    }
    farthest = fmax(farthest, hypot(hypot(sum[0], sum[1]), sum[2]));
  }
  if (!(farthest > 0)) {
    return supine_error_set(
        error, SUPINE_ERROR_NUMERICAL,
        "the basis has no displacement when supine, so no breath can move it by %g "
        "mm: check its forces and precompute it again",
        largest);
  }
  breath->scale = largest / farthest;
  return SUPINE_OK;
}

supine_status supine_export_breath_pose(const export_source *source, const export_breath *breath,
                                        const double g[3], double fraction, supine_pose *pose,
                                        supine_error *error) {
  if (!source->info->has_volume) {
    supine_pose_fill(pose, fraction * breath->scale);
    return supine_basis_weights(source->basis, g, pose->weights);
  }
  const supine_volume_kind from = source->info->has_rest ? SUPINE_VOLUME_REST : SUPINE_VOLUME_SCAN;
  const supine_state state = {.gravity = {g[0], g[1], g[2]},
                              .volume = {from, fraction * breath->volume}};
  return supine_basis_pose(source->basis, &state, pose, error);
}
