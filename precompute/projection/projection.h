/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Expand the force F_i(g) on each vertex i in equilibrium, with gravity along g, in spherical
 * harmonics of g (sh/expansion.h).
 *
 * The applied force for any direction is a weighted sum of the applied forces for a few directions
 * (span.h). F is linear in the applied force. It is therefore the sum, with the same weights, of
 * the solutions for these directions: the columns are these solutions, and the functions are the
 * harmonic coefficients of the weights. */
#ifndef SUPINE_PROJECTION_H
#define SUPINE_PROJECTION_H

#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"
#include "precompute/projection/span.h"
#include "sh/compression.h"

typedef struct supine_projection {
  supine_span
      *span; /**< directions of gravity of the columns; NULL for another simulator's fields */
  supine_expansion
      expansion; /**< a row is a vertex; for another simulator's fields, a coordinate */
} supine_projection;

void supine_projection_free(supine_projection *projection);

/** Expand the force on each vertex in equilibrium in spherical harmonics of the direction of
 * gravity. Release the projection with supine_projection_free, also after an error. */
supine_status supine_projection_create(const supine_lungs *lungs, const supine_model *model,
                                       size_t band, supine_projection *projection,
                                       supine_error *error);

/** Compute the displacement of each vertex, mm, at mode weights: u [N, 3].
 * @param directions  as for supine_projection_volume_forms */
void supine_projection_displacement(const supine_compression *compression, const double *directions,
                                    const double *weights, double *u);

/** Compute the volume of each lung as a polynomial of the weights of the modes and the gains
 * (volume_forms.h), from the coefficients in single precision that a basis file stores.
 * @param share       [lungs] volume of each lung divided by its healthy volume, or NULL for 1
 * @param directions  [N, 3] displacement of each vertex per unit force, mm; NULL if the compression
 *   holds displacements, with 3 coordinates for each vertex, instead of forces */
supine_status supine_projection_volume_forms(const supine_compression *compression,
                                             const supine_lungs *lungs, const double *share,
                                             const double *directions, supine_volume_forms *forms,
                                             supine_error *error);

#endif
