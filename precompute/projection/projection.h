/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Project the field F_i of each vertex i over orientation on spherical harmonics:
 *
 *     C_i,lm = integral of F_i(g) Y_lm(g) over the sphere
 *
 * stored as C = columns x functions. The force for any direction is a weighted sum of the forces
 * for a few directions (span.h). As the transfer from force to field is linear and does not depend
 * on gravity, it is applied to these few forces alone, and only the weights are projected. */
#ifndef SUPINE_PROJECTION_H
#define SUPINE_PROJECTION_H

#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"
#include "precompute/projection/span.h"

typedef struct supine_projection {
  size_t vertex_count;
  size_t band;
  supine_span *span; /**< directions of the columns, or NULL for another simulator's field */
  size_t rank;       /**< R */
  double *columns;   /**< [N, R] fields for R directions of gravity */
  double *functions; /**< [R, (band + 1)^2] harmonics of the weights of the columns */
} supine_projection;

void supine_projection_free(supine_projection *projection);

/** Project the field. Release the projection with supine_projection_free. The weights of the span
 * have kinks where another vertex becomes the lowest or the highest. The grid has eight latitudes
 * for each degree of the harmonics, so that these kinks hardly alias.
 * @retval SUPINE_ERROR_ARGUMENT     softening that is too large or without a reach (model.h), a
 *             band above SUPINE_SH_BAND_MAX, invalid stiffness
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_projection_create(const supine_lungs *lungs, const supine_model *model,
                                       size_t band, supine_projection *projection,
                                       supine_error *error);

/** A field compressed to K functions of orientation: F_i(g) ~ sum over k of coefficients[i, k] sum
 * over lm of modes[k, lm] Y_lm(g). */
typedef struct supine_compression {
  size_t vertex_count;
  size_t band;
  size_t mode_count;   /**< K */
  float *coefficients; /**< [N, K] */
  double *modes;       /**< [K, (band + 1)^2] harmonics of each mode */
  double *mix;         /**< [R, K], with coefficients = columns x mix */
} supine_compression;

void supine_projection_compression_free(supine_compression *compression);

/** Use the harmonics themselves as modes, as the paper does: K = (band + 1)^2.
 * @retval SUPINE_ERROR_ARGUMENT  more than SUPINE_MODES_MADE_MAX harmonics
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_compress_harmonics(const supine_projection *projection,
                                                   supine_compression *compression,
                                                   supine_error *error);

/** Find the best functions of orientation: the leading right singular vectors of the weighted
 * coefficient matrix, from the Gram matrix of the columns.
 *
 * @param weight     [N] weight of each vertex's squared error, such as |d_i|^2, or NULL for 1
 * @param mode_max   largest number of modes, 1 to SUPINE_MODES_MADE_MAX; there are fewer if the
 *             matrix has lower rank
 * @param singular   [mode_max] singular values of the modes in falling order, then zeros, or NULL
 * @param total      written: sum of the squares of all singular values; may be NULL
 * @retval SUPINE_ERROR_ARGUMENT   `mode_max` is out of range
 * @retval SUPINE_ERROR_NUMERICAL  the field is zero, or an eigenvalue problem failed
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_compress_modes(const supine_projection *projection,
                                               const double *weight, size_t mode_max,
                                               supine_compression *compression, double *singular,
                                               double *total, supine_error *error);

/** Keep the first `count` modes of a compression whose projection had `rank` columns. */
void supine_projection_compression_truncate(supine_compression *compression, size_t rank,
                                            size_t count);

/** Allocate a compression of a projection to `mode_count` modes. Modes and mix are zero; the
 * coefficients are not set.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_compression_create(const supine_projection *projection,
                                                   size_t mode_count, supine_compression *made);

/** Compute mix = functions x modes^T and coefficients = columns x mix. */
void supine_projection_compression_mix(const supine_projection *projection,
                                       supine_compression *made);

/** Find the `count` leading eigenpairs of a symmetric matrix [n, n], largest eigenvalue first, into
 * vectors [count, n] and the first `count` of values [n]; the other values are work space. The
 * matrix is overwritten; only its lower triangle in column-major order is read.
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_projection_leading_eigenpairs(size_t n, double *matrix, size_t count,
                                                   double *values, double *vectors);

/** Compute the weights [K] of the modes with gravity along the unit vector g. */
void supine_projection_compression_weights(const supine_compression *compression, const double g[3],
                                           double *weights);

/** Compute the field F [N] from the weights [K]. */
void supine_projection_compression_field(const supine_compression *compression,
                                         const double *weights, double *field);

/** Find the volume forms of the coefficients as they are stored, in single precision.
 * @param share       [G] volume of each lung relative to healthy, or NULL for 1
 * @param directions  [N, 3] directions of displacement, mm, or NULL for a vector field */
supine_status supine_projection_compression_volume_forms(
    const supine_compression *compression, const supine_lungs *lungs, const double *share,
    const double *directions, supine_volume_forms *forms, supine_error *error);

#endif
