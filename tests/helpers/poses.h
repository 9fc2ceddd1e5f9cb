/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make poses from weights of the modes and one gain for each lung, which is the factor of its
 * displacement. Compute volumes in such poses. */
#ifndef SUPINE_TESTS_POSES_H
#define SUPINE_TESTS_POSES_H

#include <string.h>

#include <supine/runtime.h>
#include <supine/volume.h>

/* Make a pose, valid within the caller's block, from `weights_` [modes] and gains `scales_`
 * [lungs]. */
#define POSED(basis_, weights_, scales_)                                                           \
  posed(basis_, weights_, scales_, &(supine_pose){.weights = {0}})

static inline supine_pose *posed(const supine_basis *basis, const double *weights,
                                 const double *scales, supine_pose *pose) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  memcpy(pose->weights, weights, info->mode_count * sizeof *weights);
  for (size_t i = 0; i < 3 * info->lung_count; ++i) {
    pose->gains[i / 3][i % 3] = scales[i / 3];
  }
  return pose;
}

/* Return `count` poses (at most 512) from `weights` [count, modes] and gains `scales` [count,
 * lungs]. The poses are valid until the next call by the same thread. */
static inline supine_pose *posed_batch(const supine_basis *basis, size_t count,
                                       const double *weights, const double *scales) {
  static _Thread_local supine_pose poses[512];
  const supine_basis_info *info = supine_basis_get_info(basis);
  for (size_t j = 0; j < count; ++j) {
    (void)posed(basis, weights + j * info->mode_count, scales + j * info->lung_count, &poses[j]);
  }
  return poses;
}

/* At gain s, which multiplies the displacements, the volume of a lung exceeds that of its reference
 * surface in the basis by c1 s + c2 s^2 + c3 s^3 mL. Add c1, c2 and c3 to cubic [3]. */
static inline void posed_cubic(const supine_basis *basis, size_t lung, const double *weights,
                               double cubic[3]) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t k = info->mode_count;
  supine_volume_form form = {{0.0}};
  double part[3];
  supine_volume_contract(k, info->volume_linear + lung * 3 * k,
                         info->volume_quadratic + lung * 3 * k * k,
                         info->volume_cubic + lung * k * k * k, weights, &form);
  supine_volume_form_along(&form, (const double[3]){1.0, 1.0, 1.0}, part);
  for (size_t i = 0; i < 3; ++i) {
    cubic[i] += part[i];
  }
}

static inline double posed_lung_volume(const supine_basis *basis, size_t lung,
                                       const double *weights, double scale) {
  double cubic[3] = {0.0, 0.0, 0.0};
  posed_cubic(basis, lung, weights, cubic);
  return scale * (cubic[0] + scale * (cubic[1] + scale * cubic[2]));
}

static inline supine_status posed_lung_scale(const supine_basis *basis, size_t lung,
                                             const double *weights, double volume, double *scale,
                                             supine_error *error) {
  double cubic[3] = {0.0, 0.0, 0.0};
  posed_cubic(basis, lung, weights, cubic);
  return supine_volume_scale(cubic, volume, scale, error);
}

/* Compute the gain `scale`, which multiplies the displacements, so that the total volume of all
 * lungs exceeds that of the reference surface by `volume` mL. */
static inline supine_status posed_scale(const supine_basis *basis, const double *weights,
                                        double volume, double *scale, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double cubic[3] = {0.0, 0.0, 0.0};
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    posed_cubic(basis, lung, weights, cubic);
  }
  return supine_volume_scale(cubic, volume, scale, error);
}

/* Set `beyond` to the total volume of all lungs in a state minus that of the reference surface, mL.
 * Return the status of supine_basis_pose. */
static inline supine_status posed_volume(const supine_basis *basis, const double gravity[3],
                                         supine_volume volume, double *beyond) {
  supine_pose pose;
  double held[SUPINE_LUNGS_MAX];
  const supine_state state = {.gravity = {gravity[0], gravity[1], gravity[2]}, .volume = volume};
  const supine_status status = supine_basis_pose(basis, &state, &pose, NULL);
  *beyond = 0.0;
  if (status == SUPINE_OK) {
    supine_basis_volumes(basis, &pose, held);
    for (size_t lung = 0; lung < supine_basis_get_info(basis)->lung_count; ++lung) {
      *beyond += held[lung] - supine_basis_get_info(basis)->reference_volume[lung];
    }
  }
  return status;
}

static inline supine_status posed_rest(const supine_basis *basis, const double gravity[3],
                                       double *beyond) {
  return posed_volume(basis, gravity, (supine_volume){SUPINE_VOLUME_REST, 0.0}, beyond);
}

#endif
