/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Volume of a deformed lung without a pass over its vertices.
 *
 * With u_ij = A_j (sum over k of w_k c_ik) d_ij, the volume that a closed surface gains is a
 * polynomial of the gains A and the weights w (supine/volume.h). Its forms are computed for any set
 * of columns c, once, and follow them through any linear mix. */
#ifndef SUPINE_VOLUME_FORMS_H
#define SUPINE_VOLUME_FORMS_H

#include <supine/volume.h>

#include "precompute/lungs/lungs.h"

/** Most functions of orientation that a basis is made with. */
enum { SUPINE_MODES_MADE_MAX = 64 };

/** Forms of each lung for K columns, mL. */
typedef struct supine_volume_forms {
  size_t lung_count;
  size_t column_count;
  double *linear;    /**< [G, 3, K] */
  double *quadratic; /**< [G, 3, K, K] symmetric in K, K */
  double *cubic;     /**< [G, K, K, K] symmetric */
} supine_volume_forms;

void supine_physics_volume_forms_free(supine_volume_forms *forms);

/** Forms of closed lungs; a collapsed lung's are its share of its healthy ones (disease.h).
 * @param directions  [N, 3] d of the healthy shape, mm
 * @param columns     [N, count] c, at most SUPINE_MODES_MADE_MAX
 * Cost: count^3 multiplications a triangle. Uses all cores.
 * @retval SUPINE_ERROR_ARGUMENT      more columns
 * @retval SUPINE_ERROR_OPEN_SURFACE  an edge is not shared by exactly two triangles
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_volume_forms_create(const supine_lungs *lungs, const double *share,
                                                 const double *directions, const double *columns,
                                                 size_t count, supine_volume_forms *forms,
                                                 supine_error *error);

/** The same for vector fields, u_ij = A_j sum over k of w_k c_ikj.
 * @param columns  [N, 3, count] */
supine_status supine_physics_volume_forms_create_vector(const supine_lungs *lungs,
                                                        const double *columns, size_t count,
                                                        supine_volume_forms *forms,
                                                        supine_error *error);

/** Forms for the columns c' = c x mix, mix [K, count].
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_volume_forms_mix(const supine_volume_forms *forms, const double *mix,
                                              size_t count, supine_volume_forms *mixed);

/** The form of one lung for weights [K], mL. */
void supine_physics_volume_forms_contract_lung(const supine_volume_forms *forms, size_t lung,
                                               const double *weights, supine_volume_form *form);

/** Coefficients of s, s^2 and s^3 where all gains are s, summed over the lungs: into cubic [3], mL.
 */
void supine_physics_volume_forms_contract(const supine_volume_forms *forms, const double *weights,
                                          double cubic[3]);

#endif
