/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the volume of a deformed lung from mode weights and gains, without its vertices.
 *
 * Let vertex i move along axis j by
 *
 *     u_ij = A_j (sum over k of w_k c_ik) d_ij
 *
 *     A_j   gain along axis j: a factor on all displacements of the lung
 *     w_k   weight of mode k
 *     c_ik  displacement of vertex i by mode k, as a multiple of d_i
 *     d_i   vector along which vertex i moves, mm
 *
 * Then the change of volume of a closed surface is a polynomial of A and w (supine/volume.h). Its
 * coefficients, called volume forms, are computed once for all gains and weights. */
#ifndef SUPINE_VOLUME_FORMS_H
#define SUPINE_VOLUME_FORMS_H

#include <supine/volume.h>

#include "precompute/lungs/lungs.h"
#include "precompute/physics/rows.h"

/** Coefficients of each lung's change of volume, a polynomial of the weights of modes and of the
 * lung's gains (factors of its displacement along x, y and z). They are symmetric in the modes. */
typedef struct supine_volume_forms {
  size_t lung_count;
  size_t column_count; /**< number of modes */
  double *linear;      /**< [lungs, 3 axes, modes] coefficients of the mode weights, mL */
  double *quadratic; /**< [lungs, 3 axes, modes, modes] coefficients of two weights' product, mL */
  double *cubic;     /**< [lungs, modes, modes, modes] coefficients of three weights' product, mL */
} supine_volume_forms;

void supine_physics_volume_forms_free(supine_volume_forms *forms);

/** Compute the coefficients of the volume of closed lungs for `count` modes. Release them with
 * supine_physics_volume_forms_free.
 * @param share       [lungs] volume divided by healthy volume (disease.h); NULL for healthy lungs
 * @param rows        kind of the rows of `columns`; directions are those of healthy lungs
 * @param columns     [rows, count] displacements by the modes
 * Uses all cores. Cost: count^3 / 2 multiplications per triangle, 3 times that for VECTOR rows.
 */
supine_status supine_physics_volume_forms_create(const supine_lungs *lungs, const double *share,
                                                 const supine_rows *rows, const double *columns,
                                                 size_t count, supine_volume_forms *forms,
                                                 supine_error *error);

/** Compute the volume that a displacement adds to each closed lung, as a polynomial of the lung's
 * gains (factors of its displacement along x, y and z).
 * @param directions  [N, 3] vector along which each vertex moves, mm
 * @param amounts  [N] displacement of each vertex, as a multiple of `directions`
 * @param form     [lungs] output */
supine_status supine_physics_volume_of_field(const supine_lungs *lungs, const double *share,
                                             const double *directions, const double *amounts,
                                             supine_volume_form *form, supine_error *error);

/** Compute one lung's change of volume at given mode weights, as a polynomial of its gains
 * (factors of its displacement along x, y and z). */
void supine_physics_volume_forms_contract_lung(const supine_volume_forms *forms, size_t lung,
                                               const double *weights, supine_volume_form *form);

/** Compute the change of volume of all lungs together at given mode weights, if all displacements
 * are scaled by s: cubic[0] s + cubic[1] s^2 + cubic[2] s^3, mL. */
void supine_physics_volume_forms_contract(const supine_volume_forms *forms, const double *weights,
                                          double cubic[3]);

/** Add to cubic[0], cubic[1], cubic[2] the coefficients, mL, of s, s^2 and s^3 in a lung's change
 * of volume if its displacements are scaled by s on all axes. */
void supine_physics_volume_form_add(const supine_volume_form *form, double cubic[3]);

#endif
