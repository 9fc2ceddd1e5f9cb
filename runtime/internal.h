/* SPDX-License-Identifier: MIT */
/** @file
 * An open basis, for the files of this folder. */
#ifndef SUPINE_RUNTIME_INTERNAL_H
#define SUPINE_RUNTIME_INTERNAL_H

#include <supine/runtime.h>

#include "runtime/kernels/tiles.h"

/** Number of harmonics that describe the volume at rest: bands 0 to 2. */
enum { RESTING_TERMS = 9 };

/** Positions are written with stores that bypass the caches if the tiles and positions of a frame
 * exceed STREAM_BYTES bytes, or if the positions of a batch exceed STREAM_BATCH_BYTES bytes. A
 * range of at most STREAM_RANGE vertices of a frame is always stored in the caches, because its
 * caller is likely to read it. */
enum { STREAM_BYTES = 1 << 22, STREAM_BATCH_BYTES = 1 << 24, STREAM_RANGE = 1 << 13 };

enum { LUNG_NAME_SIZE = 32 }; /**< largest size of a lung's name in bytes, with its NUL */

struct supine_basis {
  supine_basis_info info;
  size_t lung_begin[SUPINE_LUNGS_MAX + 1];
  supine_safetensors *file;
  char names[SUPINE_LUNGS_MAX][LUNG_NAME_SIZE];
  const char *name_of[SUPINE_LUNGS_MAX]; /**< pointers to `names`, for info.lung_names */
  float bounds[SUPINE_LUNGS_MAX][2][3];

  supine_tiles lit;   /**< modes of the normals; lit.bytes is NULL without normals */
  supine_tiles tiles; /**< coefficients, directions and reference positions (tiles.h) */
  const supine_kernels *kernels;
  bool stream; /**< write positions with stores that bypass the caches (STREAM_BYTES) */
  supine_prefetch prefetch;
  /** For each mode, the unit of the packed coefficients times the unit of packed directions, mm. */
  double mode_scale[SUPINE_MODES_MAX];
  /** For each mode at weight 1 and gain 1, bounds on the packing error and on the displacement,
   * mm. */
  double mode_error[SUPINE_MODES_MAX], mode_size[SUPINE_MODES_MAX];
  double reference_volume[SUPINE_LUNGS_MAX]; /**< array that info.reference_volume points to, mL */
  /** (Volume at rest - reference volume), mL, as spherical-harmonic coefficients over directions of
   * gravity. A row for each lung, or one row for all lungs; NULL if the file has no volume at
   * rest. */
  const double *resting;
  bool rest_by_lung;   /**< `resting` has a row for each lung */
  double upright_gain; /**< (full volume upright - full volume supine) / reference volume */
  double scan_volume;  /**< volume of all lungs in the scan minus the reference volume, mL */
  double scan_gravity[3];
  const uint32_t *rigid; /**< [rigid_count, 2] range of vertices of each rigid part (rigid.h) */
  size_t rigid_count;
  double reference_error; /**< largest packing error of a reference position, mm */
  double reference_size;  /**< bound on the distance of a reference position from the origin, mm */
};

/** Pack the tensors into tiles of a storage other than AUTO; free the previous tiles.
 * @retval SUPINE_ERROR_MEMORY  an allocation failed */
supine_status supine_basis_pack(supine_basis *basis, supine_storage storage);

/** Pack the modes of the normals into tiles.
 * @retval SUPINE_ERROR_MEMORY  an allocation failed */
supine_status supine_basis_pack_normals(supine_basis *basis);

/** Return the number of elements of the vector by which supine_basis_normal_weights multiplies V on
 * one axis. For K modes, the elements are
 *
 *     1,  a w_k,  b w_k,  a b w_k w_l    for all k and all l >= k
 *
 * In files of versions 1 and 2, which have one gain, a w_k and b w_k are a single element. */
static inline size_t supine_basis_normal_terms(const supine_basis *basis) {
  const size_t k = basis->info.mode_count;
  return 1 + (basis->info.volume_axes == 3 ? 2 : 1) * k + k * (k + 1) / 2;
}

/** Evaluate vertices begin <= i < end of one lung. The target begins at vertex `begin`.
 * @param folded  weights and gains of the lung for `kernel` (supine_deform_tiles) */
void supine_deform_lung(supine_deform_tiles *kernel, const supine_tiles *tiles, const float *folded,
                        size_t begin, size_t end, const supine_target *target);

/** Return a target that begins `count` vertices after `target`. */
supine_target supine_target_after(const supine_target *target, size_t count);

/** Compute supine_basis_info.storage_error, mm, for the current tiles. */
double supine_basis_storage_error(const supine_basis *basis);

/** Set all gains of a pose to the one number that adds `volume` mL to the reference surface.
 * @param pose  its weights are read, its gains written
 * @retval SUPINE_ERROR_NUMERICAL  the lungs cannot hold this volume */
supine_status supine_basis_add_volume(const supine_basis *basis, double volume, supine_pose *pose);

#endif
