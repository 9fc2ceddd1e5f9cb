/* SPDX-License-Identifier: MIT */
/** @file
 * An open basis, for the files of this folder. */
#ifndef SUPINE_RUNTIME_INTERNAL_H
#define SUPINE_RUNTIME_INTERNAL_H

#include <supine/runtime.h>

#include "runtime/kernels/tiles.h"

/** Number of harmonics of the volume at rest, bands 0 to 2. */
enum { RESTING_TERMS = 9 };

/** Sizes above which positions are written with stores that bypass the caches: bytes of the tiles
 * and positions of one frame, and bytes of the positions of a batch. A range of at most
 * STREAM_RANGE vertices is always stored in the caches, as its caller is likely to read it next. */
enum { STREAM_BYTES = 1 << 22, STREAM_BATCH_BYTES = 1 << 24, STREAM_RANGE = 1 << 13 };

/** Bytes of a lung's name, with its NUL. */
enum { LUNG_NAME_SIZE = 32 };

struct supine_basis {
  supine_basis_info info;
  size_t lung_begin[SUPINE_LUNGS_MAX + 1];
  supine_safetensors *file;
  char names[SUPINE_LUNGS_MAX][LUNG_NAME_SIZE]; /**< info.lung_names points here */
  const char *name_of[SUPINE_LUNGS_MAX];
  float bounds[SUPINE_LUNGS_MAX][2][3];

  supine_tiles lit;   /**< modes of the normals; lit.bytes is NULL if there are none */
  supine_tiles tiles; /**< coefficients, directions and reference positions, see tiles.h */
  const supine_kernels *kernels;
  bool stream; /**< write positions with stores that bypass the caches, see STREAM_BYTES */
  supine_prefetch prefetch;
  /** Value of one unit of mode k's packed coefficients times one unit of the packed directions. */
  double mode_scale[SUPINE_MODES_MAX];
  /** Bounds on the packing error and on the displacement of mode k, mm, at weight 1 and gain 1. */
  double mode_error[SUPINE_MODES_MAX], mode_size[SUPINE_MODES_MAX];
  double reference_volume[SUPINE_LUNGS_MAX]; /**< mL; info.reference_volume points here */
  const double *resting; /**< harmonics of the volume at rest, mL beyond the reference: [G, 9], or
                            [9] for all lungs together; or NULL */
  bool rest_by_lung;     /**< `resting` is [G, 9] and each lung has gains of its own; else one gain
                            is common to all lungs */
  double upright_gain;   /**< increase of the volume at full inflation from supine to upright, as a
                            fraction of the reference volume */
  double scan_volume;    /**< volume of all lungs in the scan less the reference volume, mL */
  double scan_gravity[3];
  const uint32_t *rigid; /**< [rigid_count, 2], see rigid.h */
  size_t rigid_count;
  double reference_error; /**< largest packing error of a reference position, mm */
  double reference_size;  /**< bound on the distance of a reference position from the origin, mm */
};

/** Pack the tensors into tiles of a storage, not AUTO; free tiles packed before.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_basis_pack(supine_basis *basis, supine_storage storage);

/** Pack the modes of the normals into tiles.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_basis_pack_normals(supine_basis *basis);

/** Count the monomials of the K weights and the gains in one coordinate of a normal,
 *
 *     1,  a w_k,  b w_k,  a b w_k w_l (k <= l)
 *
 * where a and b are the gains of the next two axes, cyclically. With one gain for all axes (files
 * of versions 1 and 2) a w_k and b w_k are the same. */
static inline size_t supine_basis_normal_terms(const supine_basis *basis) {
  const size_t k = basis->info.mode_count;
  return 1 + (basis->info.volume_axes == 3 ? 2 : 1) * k + k * (k + 1) / 2;
}

/** Evaluate vertices begin <= i < end, all of one lung, into a target for vertex `begin` on. */
void supine_deform_lung(supine_deform_tiles *kernel, const supine_tiles *tiles, const float *folded,
                        size_t begin, size_t end, const supine_target *target);

/** Return the target that begins `count` vertices after this one. */
supine_target supine_target_after(const supine_target *target, size_t count);

/** Compute supine_basis_info.storage_error of the present tiles. */
double supine_basis_storage_error(const supine_basis *basis);

/** Set the gains of a pose to the one gain for all lungs and axes at which the lungs hold `volume`
 * mL more than the reference surface.
 * @param pose  its weights are read, its gains written
 * @retval SUPINE_ERROR_NUMERICAL  there is none */
supine_status supine_basis_add_volume(const supine_basis *basis, double volume, supine_pose *pose);

#endif
