/* SPDX-License-Identifier: MIT */
/** @file
 * The struct of an open basis, and functions that only the source files of this folder call. */
#ifndef SUPINE_RUNTIME_INTERNAL_H
#define SUPINE_RUNTIME_INTERNAL_H

#include <math.h>

#include <supine/runtime.h>
#include <supine/volume.h>

#include "runtime/kernels/tiles.h"

/** Number of harmonics that describe the volume at rest: bands 0 to 2. */
enum { RESTING_TERMS = 9 };

/* Highest degree of the harmonics of simulated limits. */
enum { LIMIT_BAND_MAX = 11, FIT_BAND_MAX = 11 };

/** Sizes above which positions are written with stores that bypass the caches. One pose must exceed
 * both STREAM_BYTES and STREAM_RANGE. */
enum {
  STREAM_BYTES = 1 << 22,       /**< limit for the basis and the positions of one pose, bytes */
  STREAM_RANGE = 1 << 13,       /**< limit for the vertices evaluated for one pose */
  STREAM_BATCH_BYTES = 1 << 24, /**< limit for all positions of supine_deform_batch, bytes */
};

enum { LUNG_NAME_SIZE = 32 }; /**< largest size of a lung's name in bytes, with its NUL */

/** What a basis of another simulator's fields knows of the simulated volumes, mL above the
 * reference surface (runtime/simulated.h). All pointers are NULL if the fields do not depend on
 * volume. */
typedef struct supine_simulated {
  const double *range; /**< [lungs, 2] volumes at t = -1 and t = 1 */
  /** [lungs, 2, limit_terms] lowest and highest volume for a direction of gravity, as harmonics. */
  const double *limits;
  size_t limit_terms;
  /** [lungs, RESTING_TERMS, share_count] volume of each lung, as products of harmonics and
   * Chebyshev polynomials of the total volume, mapped to -1 to 1. */
  const double *shares;
  size_t share_count;
  /** [lungs, RESTING_TERMS] volume at full inflation as harmonics, or NULL. */
  const double *full;
  double total[2]; /**< volumes of all lungs, mL above the surface, where the fit of `shares` has
                    * the parameter -1 and 1 */
  /** [lungs] mL added to the volumes that `shares` give; 0 if the posture in the scan is unknown */
  double offset[SUPINE_LUNGS_MAX];
  supine_volume usual; /**< of states without a volume */
} supine_simulated;

struct supine_basis {
  supine_basis_info info;
  size_t lung_begin[SUPINE_LUNGS_MAX + 1];
  supine_safetensors *file;
  char names[SUPINE_LUNGS_MAX][LUNG_NAME_SIZE];
  const char *name_of[SUPINE_LUNGS_MAX]; /**< pointers to `names`, for info.lung_names */
  float bounds[SUPINE_LUNGS_MAX][2][3];
  double box[2][3]; /**< lowest and highest corner of the box around all lungs, mm */
  double midline;   /**< x of the plane between the lungs, mm */
  /** [lung_count, 3, mode_count, mode_count] mean over the vertices of the lungs of the products of
   * two coefficients, mm^2, in a file made by 'supine embed'; otherwise NULL */
  const double *squares;

  supine_tiles lit;   /**< info.normals, packed; lit.bytes is NULL if the basis has none */
  supine_tiles tiles; /**< packed coefficients, directions and reference positions */
  const supine_kernels *kernels;
  bool stream; /**< whether to write positions with stores that bypass the caches */
  supine_prefetch prefetch;
  /** Quantisation step of the coefficients of each mode, times that of the directions, mm. */
  double mode_scale[SUPINE_MODES_MAX];
  /** For each mode, upper bounds on the quantisation error (mode_error) and on the displacement
   * (mode_size) of any vertex if the weight and the displacement factors are 1, mm. */
  double mode_error[SUPINE_MODES_MAX], mode_size[SUPINE_MODES_MAX];
  double reference_volume[SUPINE_LUNGS_MAX]; /**< array that info.reference_volume points to, mL */
  /** Volume at rest minus the volume of the reference surface, mL, as spherical-harmonic
   * coefficients over directions of gravity, [lung_count, RESTING_TERMS]. NULL if the file has no
   * volume at rest. */
  const double *resting;
  supine_simulated simulated;
  unsigned char cluster_lung[SUPINE_CLUSTERS_MAX]; /**< lung of the vertices of each cluster */
  double upright_gain; /**< (full volume upright - full volume supine) / reference volume */
  double scan_volume;  /**< volume in the scan minus that of the reference surface, mL */
  double scan_gravity[3];
  double hilum[SUPINE_LUNGS_MAX][3]; /**< hilum of each lung in the scan, mm, about which a
                                        collapsed lung has shrunk there */
  /** [lung_count, 3, mode_count] displacement of each hilum by each mode, mm, in a file of
   * collapsed lungs; NULL if they do not move */
  const double *hilum_modes;
  /** [lung_count] supine_pose.expansion in the scan; 0 for a lung that is not collapsed */
  double scan_expansion[SUPINE_LUNGS_MAX];
  /** [SUPINE_RANGE_NODES, lung_count, 2] least and largest volume of each lung, mL (checks.h); NULL
   * if the file has none */
  const double *volume_range;
  /** [vertices] RMS error of the fit to another simulator's fields over all directions of gravity,
   * mm; NULL if the file has none */
  const float *vertex_error;
  /** [2 L + 4, (L + 2)^2] harmonics E of the direction of gravity: there, the error is |E y| times
   * that; NULL if the file has none */
  const double *error_gravity;
  /** [error_volume_count] factors of the part of its square that depends on the direction of
   * gravity, at evenly spaced total volumes from the smallest to the largest simulated; the number
   * is 0 if the file has none */
  const double *error_volume;
  size_t error_volume_count;
  /** [vertices] variance that a fit's landmarks leave, divided by its mean at points that were held
   * out; NULL if the file has none */
  const float *error_share;
  /** [landmark_count, 4] places of a fit's landmarks in the reference surface, mm, and the lung of
   * each; NULL if the file has none */
  const float *landmarks;
  size_t landmark_count;
  double held_out;       /**< mean variance that landmarks leave at points that were held out */
  bool allow_folds;      /**< poses are not checked by `volume_range` */
  const uint32_t *rigid; /**< [rigid_count, 2] begin and end of the vertices of each rigid part */
  size_t rigid_count;
  double reference_error; /**< largest quantisation error of a reference position, mm */
  double reference_size;  /**< bound on the distance of a reference position from the origin, mm */
};

/** Limit for the weights and gains of a pose. Larger ones have no meaning, and could overflow. */
#define SUPINE_POSE_LIMIT 0x1p20

/** Return whether `count` numbers of a pose are finite and below SUPINE_POSE_LIMIT. */
static inline bool supine_pose_is_finite(const double *numbers, size_t count) {
  size_t bad = 0;
  for (size_t i = 0; i < count; ++i) {
    bad += fabs(numbers[i]) < SUPINE_POSE_LIMIT ? 0 : 1; /* the comparison is false for NaN */
  }
  return bad == 0;
}

/** Return the sum of spherical harmonics y of bands 0 to 2 with the coefficients of a row; both
 * have RESTING_TERMS elements. */
static inline double supine_basis_sum_harmonics(const double *row, const double *y) {
  double sum = 0;
  for (size_t t = 0; t < RESTING_TERMS; ++t) {
    sum += row[t] * y[t];
  }
  return sum;
}

/** Return the number of doubles that `bytes` take, in the work space of callers. */
static inline size_t supine_space_doubles(size_t bytes) {
  return (bytes + sizeof(double) - 1) / sizeof(double);
}

/** Refuse gravity without a direction, and a volume of an unknown kind. */
supine_status supine_basis_refuse_gravity(supine_error *error);
supine_status supine_basis_refuse_kind(supine_volume_kind kind, supine_error *error);

/** Find the lungs that a state names.
 * @param lungs  written: lungs[i] is the index of the lung that state->lungs[i] names
 * @retval SUPINE_ERROR_ARGUMENT  not all lungs are named, or a name is unknown or given twice */
supine_status supine_basis_find_lungs(const supine_basis *basis, const supine_state *state,
                                      size_t lungs[SUPINE_LUNGS_MAX], supine_error *error);

/** Return how many weights a pose has: one for each mode or, if the weights depend on the volume of
 * a lung, for each lung and mode. */
static inline size_t supine_basis_weight_count(const supine_basis *basis) {
  return basis->info.mode_count * (basis->info.order > 0 ? basis->info.lung_count : 1);
}

/** Return whether a pose was made for this basis, or by hand for any basis. */
static inline bool supine_basis_made_pose(const supine_basis *basis, const supine_pose *pose) {
  return pose->basis == 0 || pose->basis == basis->info.identity;
}

/** Return whether a pose was made for this basis or by hand, and its numbers are finite. */
static inline bool supine_basis_has_pose(const supine_basis *basis, const supine_pose *pose) {
  return supine_basis_made_pose(basis, pose) &&
         supine_pose_is_finite(pose->weights, supine_basis_weight_count(basis)) &&
         supine_pose_is_finite(pose->gains[0], 3 * basis->info.lung_count) &&
         supine_pose_is_finite(pose->expansion, basis->info.lung_count);
}

/** Return the largest expansion of a lung in a pose; 0 if all lungs are as the modes move them. */
double supine_basis_expansion(const supine_basis *basis, const supine_pose *pose);

/** Return whether a pose can be evaluated at vertices begin <= i < end of a basis. */
static inline bool supine_basis_has_range(const supine_basis *basis, const supine_pose *pose,
                                          size_t begin, size_t end) {
  return supine_basis_has_pose(basis, pose) && begin <= end && end <= basis->info.vertex_count;
}

/** Pack the coefficients, directions and reference positions of the vertices into tiles of 16
 * vertices, in the number format `storage`, which is not AUTO. Free the previous tiles. */
supine_status supine_basis_pack(supine_basis *basis, supine_storage storage);

/** Pack the vectors supine_basis_info.normals into tiles of 16 vertices. */
supine_status supine_basis_pack_normals(supine_basis *basis);

/** Return the number of terms that supine_basis_normal_weights adds for each vector and axis: 1
 * constant, 2 K products of a gain and a weight, and K (K + 1) / 2 products with two weights, for K
 * modes. */
static inline size_t supine_basis_normal_terms(const supine_basis *basis) {
  const size_t k = basis->info.mode_count;
  return 1 + 2 * k + k * (k + 1) / 2;
}

/** Evaluate vertices begin <= i < end of one lung. Write the first of them to target->xyz.
 * @param scales  numbers by which `kernel` multiplies packed numbers (supine_deform_tiles) */
void supine_deform_lung(supine_deform_tiles *kernel, const supine_tiles *tiles, const float *scales,
                        size_t begin, size_t end, const supine_target *target);

/** Return a copy of an output target, with its array advanced by `count` vertices. */
supine_target supine_target_after(const supine_target *target, size_t count);

/** Compute supine_basis_info.storage_error, the bound on position errors from storage and rounding,
 * for the packed numbers of the basis, mm. */
double supine_basis_storage_error(const supine_basis *basis);

/** Return whether the numbers of a packed basis can be those of lungs. If not, write to `detail`
 * which number is too large or too small. */
bool supine_basis_is_plausible(const supine_basis *basis, char *detail, size_t size);

/** Return the coefficients of the modes at vertex i: one row for each axis, or one row along its
 * direction if supine_basis_info.vector is false.
 * @param computed  [3 mode_count] work space, for a basis of clusters */
const float *supine_basis_rows(const supine_basis *basis, size_t i, float *computed);

/** Compute the volume of a lung, at given weights, as a polynomial of its gains. */
void supine_basis_contract(const supine_basis *basis, size_t lung, const double *weights,
                           supine_volume_form *form);

/** Return whether a state is that of the scan. */
bool supine_basis_is_scan(const supine_basis *basis, const supine_state *state);

/** Compute a pose as supine_basis_pose does, but also for volumes that lungs cannot hold. */
supine_status supine_basis_pose_any(const supine_basis *basis, const supine_state *state,
                                    supine_pose *pose, supine_error *error);

/** Return w^T F w for the matrix F = `form` [count, count]. */
double supine_volume_square(size_t count, const double *form, const double *w);

/** Set all gains of a pose (factors of the displacement) to the same number, so that all lungs
 * together hold `volume` mL more than the reference surface.
 * @param pose  its weights are read, its gains written */
supine_status supine_basis_add_volume(const supine_basis *basis, double volume, supine_pose *pose);

/* Compute the normal of a triangle; its length is twice the area of the triangle. */
void supine_triangle_normal(const float a[3], const float b[3], const float c[3], float n[3]);

/* Give normals [count, 3] the length 1, or 0 to those without a direction. */
void supine_normals_normalise(size_t count, float *normals);

#endif
