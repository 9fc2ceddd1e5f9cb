/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Volume of a deformed lung without a pass over its vertices.
 *
 * With u_i = s (sum over k of w_k c_ik) d_i, the volume that a closed surface gains is
 *
 *     V(s) - V(0) = s sum_k L_k w_k + s^2 sum_kl Q_kl w_k w_l + s^3 sum_klm T_klm w_k w_l w_m
 *
 * The forms are computed for any set of columns c, once, and follow them through any linear mix. */
#ifndef SUPINE_VOLUME_FORMS_H
#define SUPINE_VOLUME_FORMS_H

#include "precompute/lungs/lungs.h"

/** Most functions of orientation that a basis is made with. */
enum { SUPINE_MODES_MADE_MAX = 64 };

/** Forms of each lung for K columns, mL. */
typedef struct supine_volume_forms {
  size_t lung_count;
  size_t column_count;
  double *linear;    /**< [G, K] */
  double *quadratic; /**< [G, K, K] symmetric */
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

/** The same for vector fields, u_i = s sum over k of w_k c_ik with c_ik of three components.
 * @param columns  [N, 3, count] */
supine_status supine_physics_volume_forms_create_vector(const supine_lungs *lungs,
                                                        const double *columns, size_t count,
                                                        supine_volume_forms *forms,
                                                        supine_error *error);

/** Forms for the columns c' = c x mix, mix [K, count].
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_volume_forms_mix(const supine_volume_forms *forms, const double *mix,
                                              size_t count, supine_volume_forms *mixed);

/** Coefficients of s, s^2 and s^3 for weights [K], summed over the lungs: into cubic [3], mL. */
void supine_physics_volume_forms_contract(const supine_volume_forms *forms, const double *weights,
                                          double cubic[3]);

/** The same of one lung. */
void supine_physics_volume_forms_contract_lung(const supine_volume_forms *forms, size_t lung,
                                               const double *weights, double cubic[3]);

#endif
