/* SPDX-License-Identifier: MIT */
/** @file
 * What an open basis holds, for the files of this folder. */
#ifndef SUPINE_RUNTIME_INTERNAL_H
#define SUPINE_RUNTIME_INTERNAL_H

#include <supine/runtime.h>

#include "runtime/kernels/tiles.h"

/** Harmonics of bands 0 to 2. */
enum { RESTING_TERMS = 9 };

/** Tiles and positions of one orientation, or positions of a batch, that are larger than these pass
 * through the caches rather than stay there; but not a range of so few vertices, which its caller
 * reads at once. */
enum { STREAM_BYTES = 1 << 22, STREAM_BATCH_BYTES = 1 << 24, STREAM_RANGE = 1 << 13 };

/** Room for a lung's name. */
enum { LUNG_NAME_SIZE = 32 };

struct supine_basis {
  supine_basis_info info;
  size_t lung_begin[SUPINE_LUNGS_MAX + 1];
  supine_safetensors *file;
  char names[SUPINE_LUNGS_MAX][LUNG_NAME_SIZE]; /**< what info.lung_names points to */
  const char *name_of[SUPINE_LUNGS_MAX];
  float bounds[SUPINE_LUNGS_MAX][2][3];

  supine_tiles lit;   /**< the normals' modes; bytes NULL where there are none */
  supine_tiles tiles; /**< the same for the evaluator, see tiles.h */
  const supine_kernels *kernels;
  bool stream; /**< positions outgrow the cache: store past it */
  supine_prefetch prefetch;
  /** Of mode k: what one unit of its packed coefficients stands for. */
  double mode_scale[SUPINE_MODES_MAX];
  /** Bounds of mode k on the error of packing and on the displacement, mm at weight and gain 1. */
  double mode_error[SUPINE_MODES_MAX], mode_size[SUPINE_MODES_MAX];
  double reference_volume[SUPINE_LUNGS_MAX]; /**< what info.reference_volume points to */
  const double *resting; /**< [G, 9] mL beyond the reference, or [9] for all lungs; or NULL */
  bool rest_by_lung;     /**< which of both; all lungs share one scale where it is [9] */
  double upright_gain;   /**< of the reference volume that full inflation holds more upright */
  double scan_volume;    /**< mL of the scan beyond the reference */
  double scan_gravity[3];
  const uint32_t *rigid; /**< [rigid_count, 2], see rigid.h */
  size_t rigid_count;
  double rest_error; /**< largest error of a rest position, mm */
  double rest_size;  /**< bound on the distance of a rest position from 0, mm */
};

/** Packs the tensors into tiles of that storage (not AUTO), in place of those before.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_basis_pack(supine_basis *basis, supine_storage storage);

/** Packs the normals' modes into tiles.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_basis_pack_normals(supine_basis *basis);

/** Three modes of a vertex's normal along one axis: compact.h, word of supine_tiles_normal_words.
 */
uint32_t supine_basis_normal_word(const supine_basis *basis, size_t vertex, size_t axis,
                                  size_t word);

/** Monomials of the gains and K weights in one component of a normal, along axis c:
 *
 *     1,  a w_k,  b w_k,  a b w_k w_l (k <= l)      a, b: the gains of the next two axes,
 * cyclically
 *
 * Where all gains are equal (files of versions 1 and 2), b w_k is a w_k and one component serves
 * all. */
static inline size_t supine_basis_normal_terms(const supine_basis *basis) {
  const size_t k = basis->info.mode_count;
  return 1 + (basis->info.volume_axes == 3 ? 2 : 1) * k + k * (k + 1) / 2;
}

/** Evaluates vertices begin <= i < end, all of one lung, into a target for them. */
void supine_deform_lung(supine_deform_tiles *kernel, const supine_tiles *tiles, const float *folded,
                        size_t begin, size_t end, const supine_target *target);

/** Make the rigid parts among vertices begin <= i < end of a target rigid, see rigid.h. */
void supine_deform_rigid(const supine_basis *basis, const supine_pose *pose, size_t begin,
                         size_t end, const supine_target *target);

/** A target `count` vertices further on. */
supine_target supine_target_after(const supine_target *target, size_t count);

/** supine_basis_info.storage_error of the tiles as they are. */
double supine_basis_storage_error(const supine_basis *basis);

/** Fill in what the kernels multiply by: weights times the units of the packed coefficients, then
 * the three gains of a lung.
 * @param folded  [K + 3] */
void supine_fold(const supine_basis *basis, const supine_pose *pose, size_t lung, float *folded);

/** Fill in the one gain at which the lungs together hold `volume` mL beyond the reference.
 * @param pose  has its weights
 * @retval SUPINE_ERROR_NUMERICAL */
supine_status supine_basis_add_volume(const supine_basis *basis, double volume, supine_pose *pose);

#endif
