/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Depth of a breath: by volume on closed surfaces, by displacement on open ones. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/volume.h>

#include "program/export/export.h"

supine_status supine_export_breath_set(const export_source *source, double volume, double largest,
                                       export_breath *breath, supine_error *error) {
  static const double supine[3] = {0, 1, 0};
  *breath = (export_breath){.volume = volume, .largest = largest};
  if (source->info->has_volume) {
    return SUPINE_OK;
  }
  const size_t n = source->info->vertex_count;
  supine_pose pose;
  supine_pose_fill(&pose, 1);
  float *xyz = malloc(3 * n * sizeof *xyz);
  if (xyz == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  (void)supine_basis_weights(source->basis, supine,
                             pose.weights); /* cannot fail: a valid direction */
  supine_deform(source->basis, &pose, xyz);
  double farthest = 0;
  for (size_t i = 0; i < n; ++i) {
    double square = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double d = (double)xyz[3 * i + axis] - (double)source->vertices[3 * i + axis];
      square += d * d;
    }
    farthest = fmax(farthest, sqrt(square));
  }
  free(xyz);
  if (!(farthest > 0)) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "nothing moves when supine: no breath scale gives %g mm", largest);
  }
  breath->scale = largest / farthest;
  return SUPINE_OK;
}

/* Compute the volume of all lungs in a state, mL beyond the reference; the pose has its weights. */
static supine_status held_in(const export_source *source, const supine_state *state,
                             supine_pose *pose, double *beyond, supine_error *error) {
  double held[SUPINE_LUNGS_MAX];
  const supine_status status = supine_basis_pose(source->basis, state, pose, error);
  *beyond = 0;
  for (size_t lung = 0; status == SUPINE_OK && lung < source->info->lung_count; ++lung) {
    supine_basis_volumes(source->basis, pose, held);
    *beyond += held[lung] - source->info->reference_volume[lung];
  }
  return status;
}

/* Find the common gain at which all lungs together hold the volume of the state. */
static supine_status find_common_gains(const export_source *source, const supine_state *state,
                                       supine_pose *pose, supine_error *error) {
  const supine_basis_info *info = source->info;
  const size_t k = info->mode_count;
  const size_t axes = info->volume_axes;
  supine_state resting = *state;
  supine_volume_form form = {{0}};
  double rest = 0;
  double beyond = 0;
  resting.volume.ml = 0;
  supine_status status = held_in(source, &resting, pose, &rest, error);
  if (status == SUPINE_OK) {
    status = held_in(source, state, pose, &beyond, error);
  }
  if (status != SUPINE_OK) {
    return status;
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    supine_volume_contract(k, axes, info->volume_linear + lung * axes * k,
                           info->volume_quadratic + lung * axes * k * k,
                           info->volume_cubic + lung * k * k * k, pose->weights, &form);
  }
  status = supine_volume_form_gains(&form, info->bend, rest, beyond, pose->gains[0], error);
  for (size_t lung = 1; lung < info->lung_count; ++lung) {
    memcpy(pose->gains[lung], pose->gains[0], sizeof pose->gains[0]);
  }
  return status;
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
  return source->resting_rows < 2 ? supine_basis_pose(source->basis, &state, pose, error)
                                  : find_common_gains(source, &state, pose, error);
}
