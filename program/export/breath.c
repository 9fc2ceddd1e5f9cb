/* SPDX-License-Identifier: GPL-3.0-or-later */
/* How deep a breath is: by volume where the surface is closed, by displacement where it is open. */
#include <math.h>
#include <stdlib.h>

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
  (void)supine_basis_weights(source->basis, supine, pose.weights); /* a direction that is legal */
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

/* One gain for all lungs, at which they hold together what they hold in the pose. */
static supine_status share_one_gain(const export_source *source, supine_pose *pose,
                                    supine_error *error) {
  const size_t k = source->info->mode_count;
  double held[SUPINE_LUNGS_MAX];
  double cubic[3] = {0};
  double beyond = 0;
  double gain = 0;
  supine_basis_volumes(source->basis, pose, held);
  for (size_t lung = 0; lung < source->info->lung_count; ++lung) {
    beyond += held[lung] - source->info->reference_volume[lung];
    supine_volume_add(k, source->linear + lung * k, source->quadratic + lung * k * k,
                      source->cubic + lung * k * k * k, pose->weights, cubic);
  }
  const supine_status status = supine_volume_scale(cubic, beyond, &gain, error);
  supine_pose_fill(pose, gain);
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
  const supine_status status = supine_basis_pose(source->basis, &state, pose, error);
  if (status != SUPINE_OK || source->resting_rows < 2) {
    return status;
  }
  return share_one_gain(source, pose, error);
}
