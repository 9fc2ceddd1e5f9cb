/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the volume of a deformed lung from weights and gains alone, not from its vertices.
 *
 * Let vertex i move along axis j by
 *
 *     u_ij = A_j (sum over k of w_k c_ik) d_ij
 *
 *     A_j   gain along axis j: a factor on all displacements of the lung
 *     w_k   weight of mode k
 *     c_ik  displacement of vertex i by mode k, as a multiple of its direction d_i, mm
 *
 * Then the volume that a closed surface gains is a polynomial of A and w (supine/volume.h). Its
 * coefficients, called volume forms, are computed once for all gains and weights. */
#ifndef SUPINE_VOLUME_FORMS_H
#define SUPINE_VOLUME_FORMS_H

#include <supine/volume.h>

#include "precompute/lungs/lungs.h"

/** Largest number of modes that 'supine precompute' writes to a basis. */
enum { SUPINE_MODES_MADE_MAX = 64 };

/** Coefficients of each lung's change of volume, mL, in terms of mode weights and gains. */
typedef struct supine_volume_forms {
  size_t lung_count;
  size_t column_count; /**< number of modes */
  double *linear;      /**< [lungs, 3 axes, modes] coefficients for one weight */
  double *quadratic;   /**< [lungs, 3 axes, modes, modes] for two weights; symmetric in the modes */
  double *cubic; /**< [lungs, modes, modes, modes] for three weights; symmetric in the modes */
} supine_volume_forms;

void supine_physics_volume_forms_free(supine_volume_forms *forms);

/** Compute the coefficients of the volume of closed lungs for `count` modes. Release them with
 * supine_physics_volume_forms_free.
 * @param share       [lungs] volume divided by healthy volume (disease.h); NULL for healthy lungs
 * @param directions  [N, 3] directions of displacement in healthy lungs, mm, or NULL
 * @param columns     [N, count] displacements by the modes, as multiples of the directions; without
 *                    directions [N, 3, count] displacement vectors, mm
 * Uses all cores. Cost: count^3 / 2 multiplications per triangle, without directions 3 times that.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_volume_forms_create(const supine_lungs *lungs, const double *share,
                                                 const double *directions, const double *columns,
                                                 size_t count, supine_volume_forms *forms,
                                                 supine_error *error);

/** Largest number of fields in one call of supine_physics_volume_of_fields. */
enum { SUPINE_VOLUME_FIELDS = 16 };

/** Compute the volume that each of `count` displacement fields adds to each closed lung, as a
 * polynomial of the lung's gains.
 * @param share, directions  as in supine_physics_volume_forms_create; directions are not NULL
 * @param count   at most SUPINE_VOLUME_FIELDS
 * @param fields  [N, count] displacement of each vertex, as a multiple of its direction
 * @param forms   [lungs, count] output */
void supine_physics_volume_of_fields(const supine_lungs *lungs, const double *share,
                                     const double *directions, const double *fields, size_t count,
                                     supine_volume_form *forms);

/** Compute one lung's change of volume at given mode weights, as a polynomial of its gains. */
void supine_physics_volume_forms_contract_lung(const supine_volume_forms *forms, size_t lung,
                                               const double *weights, supine_volume_form *form);

/** Compute the change of volume of all lungs at given mode weights as a polynomial of one gain s of
 * all axes: the coefficients cubic [3] of s, s^2 and s^3, mL. */
void supine_physics_volume_forms_contract(const supine_volume_forms *forms, const double *weights,
                                          double cubic[3]);

/** Add a lung's volume at equal gains s to cubic [3]: coefficients of s, s^2 and s^3, mL. */
void supine_physics_volume_form_add(const supine_volume_form *form, double cubic[3]);

#endif
