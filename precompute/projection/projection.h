/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Expand the field F_i(g), the force on vertex i in equilibrium with gravity along g, in spherical
 * harmonics Y_lm:
 *
 *     C_i,lm = integral of F_i(g) Y_lm(g) over the sphere
 *
 * The applied force for any direction is a weighted sum of the applied forces for a few directions
 * (span.h). F is linear in the applied force. It is therefore the sum, with the same weights, of
 * the solutions for these directions. The matrix C is stored as a product, C = columns x functions.
 * The columns are these solutions; the functions are the harmonic coefficients of the weights. */
#ifndef SUPINE_PROJECTION_H
#define SUPINE_PROJECTION_H

#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"
#include "precompute/projection/span.h"

typedef struct supine_projection {
  size_t vertex_count; /**< N, or 3 N if `columns` holds another simulator's displacements, mm */
  size_t band;
  supine_span *span; /**< directions of gravity; NULL for another simulator's fields */
  size_t rank;       /**< number of directions of gravity in `columns` */
  double *columns;   /**< [vertex_count, rank] force on each vertex for each direction of gravity */
  double *functions; /**< [rank, (band + 1)^2] row r: harmonic coefficients of the weight of column
                        r in the force, as a function of the direction of gravity */
} supine_projection;

void supine_projection_free(supine_projection *projection);

/** Expand the force on each vertex in equilibrium in spherical harmonics of the direction of
 * gravity. Release the projection with supine_projection_free.
 * @retval SUPINE_ERROR_ARGUMENT  a band above SUPINE_SH_BAND_MAX; invalid stiffness;
 *   model->force.soften too large, or above 0 while model->reach is 0
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_projection_create(const supine_lungs *lungs, const supine_model *model,
                                       size_t band, supine_projection *projection,
                                       supine_error *error);

/** A field compressed to K modes, functions of the direction of gravity g: F_i(g) at vertex i is
 * about sum over k of coefficients[i, k] sum over lm of modes[k, lm] Y_lm(g), with spherical
 * harmonics Y_lm. */
typedef struct supine_compression {
  size_t vertex_count;
  size_t band;
  size_t mode_count;
  float *coefficients; /**< [vertex_count, mode_count] coefficient of each mode at each vertex */
  double *modes;       /**< [mode_count, (band + 1)^2] harmonic coefficients of each mode */
  double *mix; /**< [rank, mode_count] matrix: coefficients = (supine_projection.columns) mix */
} supine_compression;

void supine_projection_compression_free(supine_compression *compression);

/** Use the (band + 1)^2 harmonics themselves as modes, as [Santhanam2008] does.
 * @retval SUPINE_ERROR_ARGUMENT  more than SUPINE_MODES_MADE_MAX harmonics
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_compress_harmonics(const supine_projection *projection,
                                                   supine_compression *compression,
                                                   supine_error *error);

/** Compress a projection to the modes that give the least squared error. They are the leading right
 * singular vectors of the product projection->columns x projection->functions.
 * @param weight     [N] weight of each vertex's squared error, such as the squared length of its
 *   displacement per unit force, or NULL for 1
 * @param mode_max   largest number of modes, 1 to SUPINE_MODES_MADE_MAX; there are fewer if the
 *   matrix has lower rank
 * @param singular   [mode_max] singular values of the modes in falling order, then zeros, or NULL
 * @param total      written: sum of the squares of all singular values; may be NULL
 * @retval SUPINE_ERROR_ARGUMENT   `mode_max` is out of range
 * @retval SUPINE_ERROR_NUMERICAL  all columns are zero, or an eigenvalue problem failed
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_compress_modes(const supine_projection *projection,
                                               const double *weight, size_t mode_max,
                                               supine_compression *compression, double *singular,
                                               double *total, supine_error *error);

/** Find the smallest number of modes with an error below 1.01 times that with `count` modes.
 * @param singular  [count] singular values of the modes
 * @param total     sum of the squares of all singular values
 * @param error     relative RMS error with `count` modes */
size_t supine_projection_modes_needed(size_t count, const double *singular, double total,
                                      double error);

/** Keep the first `count` modes of a compression, whose array `mix` has `rank` rows. */
void supine_projection_compression_truncate(supine_compression *compression, size_t rank,
                                            size_t count);

/** Allocate a compression with the numbers of vertices and of harmonics of `projection`. Its arrays
 * `modes` and `mix` are zero; its `coefficients` are not set.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_compression_create(const supine_projection *projection,
                                                   size_t mode_count, supine_compression *made);

/** Compute made->mix = projection->functions x made->modes^T, and
 * made->coefficients = projection->columns x made->mix. */
void supine_projection_compression_mix(const supine_projection *projection,
                                       supine_compression *made);

/** Find the `count` leading eigenpairs of a symmetric matrix [n, n], largest eigenvalue first, into
 * vectors [count, n] and the first `count` of values [n]; the other values are work space. The
 * matrix is overwritten; only its lower triangle in column-major order is read.
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_projection_leading_eigenpairs(size_t n, double *matrix, size_t count,
                                                   double *values, double *vectors);

/** Compute the weight of each mode with gravity along the unit vector g, weights [mode_count]. */
void supine_projection_compression_weights(const supine_compression *compression, const double g[3],
                                           double *weights);

/** Compute the force on each vertex: field[i] = sum over k of weights[k] coefficients[i, k]. */
void supine_projection_compression_field(const supine_compression *compression,
                                         const double *weights, double *field);

/** Compute the volume of each lung as a polynomial of the weights of the modes and the gains
 * (volume_forms.h), from the coefficients in single precision that a basis file stores.
 * @param share       [lungs] volume of each lung divided by its healthy volume, or NULL for 1
 * @param directions  [N, 3] displacement of each vertex per unit force, mm; NULL if the compression
 *   holds displacements, with 3 coordinates for each vertex, instead of forces */
supine_status supine_projection_compression_volume_forms(
    const supine_compression *compression, const supine_lungs *lungs, const double *share,
    const double *directions, supine_volume_forms *forms, supine_error *error);

#endif
