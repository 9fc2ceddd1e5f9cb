/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Expand the field F_i(g) of each vertex i, a function of the direction of gravity g, in spherical
 * harmonics Y_lm:
 *
 *     C_i,lm = integral of F_i(g) Y_lm(g) over the sphere
 *
 * C is stored as a product, C = columns x functions. The force for any direction is a weighted sum
 * of the forces for a few directions (span.h). The transfer from force to field is linear and does
 * not depend on gravity. It is therefore applied to these few forces alone, and only their weights
 * are expanded. */
#ifndef SUPINE_PROJECTION_H
#define SUPINE_PROJECTION_H

#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"
#include "precompute/projection/span.h"

typedef struct supine_projection {
  size_t vertex_count;
  size_t band;
  supine_span *span; /**< NULL for the fields of another simulator */
  size_t rank;       /**< number R of columns */
  double *columns;   /**< [N, R] fields for R directions of gravity */
  double *functions; /**< [R, (band + 1)^2] row r: harmonics of column r's weight */
} supine_projection;

void supine_projection_free(supine_projection *projection);

/** Expand the field of a physical model. Release the projection with supine_projection_free. The
 * weights of the span (span.h) have kinks where another vertex becomes the lowest or the highest.
 * The grid has eight latitudes for each degree of the harmonics, so that these kinks hardly alias.
 * @retval SUPINE_ERROR_ARGUMENT     softening that is too large or without a reach (model.h), a
 *   band above SUPINE_SH_BAND_MAX, invalid stiffness
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_projection_create(const supine_lungs *lungs, const supine_model *model,
                                       size_t band, supine_projection *projection,
                                       supine_error *error);

/** A field compressed to K functions of orientation: F_i(g) ~ sum over k of coefficients[i, k] sum
 * over lm of modes[k, lm] Y_lm(g). */
typedef struct supine_compression {
  size_t vertex_count;
  size_t band;
  size_t mode_count;   /**< number K of modes */
  float *coefficients; /**< [N, K] coefficients of the modes at each vertex */
  double *modes;       /**< [K, (band + 1)^2] expansion of each mode in harmonics */
  double *mix;         /**< [R, K] matrix; coefficients = columns x mix */
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

/** Find the volume forms of the coefficients in single precision, as they are stored.
 * @param share       [G] volume of each lung divided by its healthy volume, or NULL for 1
 * @param directions  [N, 3] directions of displacement, mm, or NULL if coefficients are vectors */
supine_status supine_projection_compression_volume_forms(
    const supine_compression *compression, const supine_lungs *lungs, const double *share,
    const double *directions, supine_volume_forms *forms, supine_error *error);

#endif
