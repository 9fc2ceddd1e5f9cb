/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Create and evaluate a compression, within precompute. */
#ifndef SUPINE_COMPRESSION_H
#define SUPINE_COMPRESSION_H

#include "precompute/physics/volume_forms.h"
#include "precompute/projection/projection.h"

/* Allocate a compression of a projection to `mode_count` modes. Modes and mix are zero; the
 * coefficients are not set.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_compression_create(const supine_projection *projection,
                                                   size_t mode_count, supine_compression *made);

/* Compute mix = functions x modes^T and coefficients = columns x mix. */
void supine_projection_compression_mix(const supine_projection *projection,
                                       supine_compression *made);

/* Find the `count` leading eigenpairs of a symmetric matrix [n, n]: values [n], of which the first
 * `count` are written, falling, and vectors [count, n]. The matrix is overwritten; only its lower
 * triangle in column-major order is read.
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_projection_leading_eigenpairs(size_t n, double *matrix, size_t count,
                                                   double *values, double *vectors);

/* Compute the weights [K] of the modes with gravity along the unit vector g. */
void supine_projection_compression_weights(const supine_compression *compression, const double g[3],
                                           double *weights);

/* Compute the field F [N] from the weights [K]. */
void supine_projection_compression_field(const supine_compression *compression,
                                         const double *weights, double *field);

/* Find the volume forms of the coefficients as they are stored, in single precision.
 * @param share       [G] each lung's share of its healthy volume; NULL: 1
 * @param directions  [N, 3] d, mm; NULL: a vector field */
supine_status supine_projection_compression_volume_forms(
    const supine_compression *compression, const supine_lungs *lungs, const double *share,
    const double *directions, supine_volume_forms *forms, supine_error *error);

#endif
