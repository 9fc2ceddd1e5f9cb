/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Expand the force F_i(g) on each vertex i in equilibrium, with gravity along g, in spherical
 * harmonics of g (sh/expansion.h).
 *
 * The applied force for any direction is a weighted sum of the applied forces for a few directions
 * (a span). F is linear in the applied force. It is therefore the sum, with the same weights, of
 * the solutions for these directions: the columns are these solutions, and the functions are the
 * harmonic coefficients of the weights. */
#ifndef SUPINE_PROJECTION_H
#define SUPINE_PROJECTION_H

#include "base/arena.h"
#include "precompute/physics/force.h"
#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"
#include "sh/expansion.h"

/** Largest number of directions of gravity in a span. Softening of the tissue
 * (supine_force_law.soften) up to about 12 needs no more. */
enum { SUPINE_SPAN_MAX = 128 };

/** A span expresses the force f_i on any vertex i for any direction of gravity g as a weighted sum
 * of the forces for R fixed directions g_r:
 *
 *     f_i(g) = sum over r of f_i(g_r) w_r(g)
 *
 * The weights w satisfy this equation exactly at R chosen vertices (cross approximation: Goreinov,
 * Tyrtyshnikov and Zamarashkin 1997). If supine_force_law.soften is 0, R is 4 or 5 and the equation
 * is exact for all vertices. Otherwise, R depends on the tolerance of span.c. */
typedef struct supine_span {
  size_t rank;                            /* number of directions of gravity in `directions` */
  double directions[3 * SUPINE_SPAN_MAX]; /* [rank, 3] directions whose forces are summed */
  size_t vertices[SUPINE_SPAN_MAX];       /* [rank] vertices on which the summed force is exact */
  /* [rank, rank] inverse of A, where A[i, j] is the force on vertices[i] for directions[j] */
  double inverse[SUPINE_SPAN_MAX * SUPINE_SPAN_MAX];
} supine_span;

/** Choose the R directions g_r of gravity whose forces are summed, and the R vertices. */
supine_status supine_projection_span_create(const supine_lungs *lungs, const supine_force_law *law,
                                            supine_span *span, supine_error *error);

/** Express the force for each direction of `gravities` as a weighted sum of the forces for
 * span->directions. Write the weights to weights [gravities->count, rank]. */
supine_status supine_projection_span_weights(const supine_lungs *lungs, const supine_force_law *law,
                                             const supine_span *span,
                                             const supine_gravities *gravities, double *weights);

/** The force on each vertex in equilibrium, as a function of the direction of gravity. */
typedef struct supine_projection {
  supine_span *span;          /**< directions of gravity of the columns */
  supine_expansion expansion; /**< a row is a vertex */
} supine_projection;

void supine_projection_free(supine_projection *projection);

/** The displacement of all vertices, as a function of the direction of gravity. */
typedef struct supine_gravity_field {
  supine_rows rows; /**< kind of the rows of `expansion` */
  supine_expansion expansion;
  double *weight;      /**< [rows] weight of each row's squared error, or NULL for 1 */
  supine_arena memory; /**< of the directions and weights */
} supine_gravity_field;

void supine_projection_field_free(supine_gravity_field *field);

/** Expand the force on each vertex in equilibrium in spherical harmonics of the direction of
 * gravity. Release the projection with supine_projection_free, also after an error. */
supine_status supine_projection_create(const supine_lungs *lungs, const supine_model *model,
                                       size_t band, supine_projection *projection,
                                       supine_error *error);

/** Make the field of displacements from the forces. Its rows are SCALAR, or VECTOR if the
 * expandability of the tissue varies (strain.h).
 * @param projection  keeps its span; its expansion moves to the field
 * @param field       zeroed; release with supine_projection_field_free, also after an error */
supine_status supine_projection_field(const supine_lungs *lungs, const supine_model *model,
                                      supine_projection *projection, supine_gravity_field *field,
                                      supine_error *error);

/** Compute the displacement of each vertex, mm, at mode weights: u [N, 3]. */
void supine_projection_displacement(const supine_compression *compression, const supine_rows *rows,
                                    const double *weights, double *u);

/** Compute the volume of each lung as a polynomial of the weights of the modes and the gains
 * (volume_forms.h), from the coefficients in single precision that a basis file stores.
 * @param share  [lungs] volume of each lung divided by its healthy volume
 * @param rows   kind of the rows of the compression */
supine_status supine_projection_volume_forms(const supine_compression *compression,
                                             const supine_lungs *lungs, const double *share,
                                             const supine_rows *rows, supine_volume_forms *forms,
                                             supine_error *error);

#endif
