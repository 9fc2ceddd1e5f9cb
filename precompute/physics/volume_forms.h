/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the volume of a deformed lung without a pass over its vertices.
 *
 * If vertex i moves by u_ij = A_j (sum over k of w_k c_ik) d_ij along axis j, with gains A, weights
 * w of K columns c, and directions d, the volume that a closed surface gains is a polynomial of A
 * and w (supine/volume.h). Its coefficients, the forms, are computed once for all gains and
 * weights. */
#ifndef SUPINE_VOLUME_FORMS_H
#define SUPINE_VOLUME_FORMS_H

#include <supine/volume.h>

#include "precompute/lungs/lungs.h"

/** Largest number of modes that 'supine precompute' writes to a basis. */
enum { SUPINE_MODES_MADE_MAX = 64 };

/** Coefficients of the volumes that G lungs gain, mL, as polynomials of K weights and the gains. */
typedef struct supine_volume_forms {
  size_t lung_count;
  size_t column_count;
  double *linear;    /**< [G, 3, K] by lung, axis and weight */
  double *quadratic; /**< [G, 3, K, K] symmetric in the last two indices */
  double *cubic;     /**< [G, K, K, K] symmetric in the last three indices */
} supine_volume_forms;

void supine_physics_volume_forms_free(supine_volume_forms *forms);

/** Compute the forms of closed lungs. Free them with supine_physics_volume_forms_free.
 * @param share       [G] volume of each lung divided by its healthy volume (disease.h); NULL for 1
 * @param directions  [N, 3] directions d for healthy lungs, mm; if NULL, each column holds vectors,
 *   and u_ij = A_j sum over k of w_k c_ijk
 * @param columns     [N, count] c; without directions [N, 3, count]
 * Cost: count^3 / 2 multiplications per triangle, three times that without directions. Uses all
 * cores.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_volume_forms_create(const supine_lungs *lungs, const double *share,
                                                 const double *directions, const double *columns,
                                                 size_t count, supine_volume_forms *forms,
                                                 supine_error *error);

/** Largest number of fields in one call of supine_physics_volume_of_fields. */
enum { SUPINE_VOLUME_FIELDS = 16 };

/** Compute the volume form of each closed lung for each of `count` fields f, which move vertex i by
 * u_ij = A_j f_i d_ij.
 * @param share, directions  as in supine_physics_volume_forms_create; directions are not NULL
 * @param count   at most SUPINE_VOLUME_FIELDS
 * @param fields  [N, count] f
 * @param forms   [G, count] */
void supine_physics_volume_of_fields(const supine_lungs *lungs, const double *share,
                                     const double *directions, const double *fields, size_t count,
                                     supine_volume_form *forms);

/** Compute the change of one lung's volume, mL, as a polynomial of the gains, at weights [K]. */
void supine_physics_volume_forms_contract_lung(const supine_volume_forms *forms, size_t lung,
                                               const double *weights, supine_volume_form *form);

/** Compute the volume that all lungs gain at weights [K] with one gain s on all axes, as
 * coefficients cubic [3] of s, s^2 and s^3, mL. */
void supine_physics_volume_forms_contract(const supine_volume_forms *forms, const double *weights,
                                          double cubic[3]);

/** Set all gains of a form to s. Add its coefficients of s, s^2 and s^3, mL, to cubic [3]. */
void supine_physics_volume_form_add(const supine_volume_form *form, double cubic[3]);

#endif
