/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Making a compression, for the files that choose its modes. */
#ifndef SUPINE_COMPRESSION_H
#define SUPINE_COMPRESSION_H

#include "precompute/physics/volume_forms.h"
#include "precompute/projection/projection.h"

/* Space for `mode_count` modes of a projection; modes and mix are zero. */
supine_status supine_projection_compression_create(const supine_projection *projection,
                                                   size_t mode_count, supine_compression *made);

/* coefficients = columns x mix. */
void supine_projection_compression_mix(const supine_projection *projection,
                                       supine_compression *made);

/* The `count` leading eigenpairs of a symmetric matrix [n, n], of which one triangle is read and
 * which is destroyed: values [n] falling, vectors [count, n]. */
supine_status supine_projection_leading_eigenpairs(size_t n, double *matrix, size_t count,
                                                   double *values, double *vectors);

/* weights [K] of the modes where the harmonics are `y` [(band + 1)^2]. */
void supine_projection_compression_weights(const supine_compression *compression, const double *y,
                                           double *weights);

/* Volume forms of the coefficients as they are stored. directions [N, 3]; NULL: a vector field. */
supine_status supine_projection_compression_volume_forms(
    const supine_compression *compression, const supine_lungs *lungs, const double *share,
    const double *directions, supine_volume_forms *forms, supine_error *error);

#endif
