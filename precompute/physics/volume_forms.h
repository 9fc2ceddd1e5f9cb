/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the volume of a deformed lung without a pass over its vertices.
 *
 * With u_ij = A_j (sum over k of w_k c_ik) d_ij, the volume that a closed surface gains is a
 * polynomial of the gains A and the weights w (supine/volume.h). Its forms are computed
 * once for a set of K columns c and hold for all weights. */
#ifndef SUPINE_VOLUME_FORMS_H
#define SUPINE_VOLUME_FORMS_H

#include <supine/volume.h>

#include "precompute/lungs/lungs.h"

/** Largest number of modes of a basis that 'supine precompute' makes. */
enum { SUPINE_MODES_MADE_MAX = 64 };

/** Coefficients of the volumes of G lungs, mL, as cubic polynomials of the weights of K columns. */
typedef struct supine_volume_forms {
  size_t lung_count;
  size_t column_count;
  double *linear;    /**< [G, 3, K] */
  double *quadratic; /**< [G, 3, K, K] symmetric in K, K */
  double *cubic;     /**< [G, K, K, K] symmetric */
} supine_volume_forms;

void supine_physics_volume_forms_free(supine_volume_forms *forms);

/** Compute the forms of closed lungs; free them with supine_physics_volume_forms_free.
 * @param share       [G] volume of each lung relative to healthy (disease.h); NULL: 1
 * @param directions  [N, 3] d of the healthy shape, mm; NULL: the columns are vectors,
 *                    u_ij = A_j sum over k of w_k c_ijk
 * @param columns     [N, count] c; without directions [N, 3, count]
 * Cost: count^3 / 2 multiplications per triangle, three times as many without directions. Uses all
 * cores.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_volume_forms_create(const supine_lungs *lungs, const double *share,
                                                 const double *directions, const double *columns,
                                                 size_t count, supine_volume_forms *forms,
                                                 supine_error *error);

/** Largest count of supine_physics_volume_of_fields. */
enum { SUPINE_VOLUME_FIELDS = 16 };

/** Compute the forms of closed lungs for each of `count` fields u_ij = A_j f_i d_ij, at most
 * SUPINE_VOLUME_FIELDS.
 * @param share, directions  as above; directions are not NULL
 * @param fields  [N, count] f
 * @param forms   [G, count] */
void supine_physics_volume_of_fields(const supine_lungs *lungs, const double *share,
                                     const double *directions, const double *fields, size_t count,
                                     supine_volume_form *forms);

/** Compute the form of one lung for weights [K], mL. */
void supine_physics_volume_forms_contract_lung(const supine_volume_forms *forms, size_t lung,
                                               const double *weights, supine_volume_form *form);

/** Compute the volume that all lungs gain as a polynomial of one gain s for all axes: cubic [3]
 * receives the coefficients of s, s^2 and s^3, mL. */
void supine_physics_volume_forms_contract(const supine_volume_forms *forms, const double *weights,
                                          double cubic[3]);

/** Add the coefficients of the same polynomial for one lung to `cubic`. */
void supine_physics_volume_form_add(const supine_volume_form *form, double cubic[3]);

#endif
