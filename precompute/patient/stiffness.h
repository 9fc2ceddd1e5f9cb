/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * A patient's expandability ([Santhanam2008] VI) as a few smooth regions of each lung, of the shape
 * that lesions have (disease.h), which any meshing of it can be given:
 *
 *     log E(p) = sum over k of value_k w(|p - centre_k| / radius_k)      a = 1 / E
 *     w(t) = 1 for t <= 1/2, 0 for t >= 1, 3 q^2 - 2 q^3 between, q = 2 (1 - t) */
#ifndef SUPINE_PATIENT_STIFFNESS_H
#define SUPINE_PATIENT_STIFFNESS_H

#include "precompute/lungs/lungs.h"

/** Most regions of a lung. */
enum { SUPINE_PATIENT_MODES = 20 };

typedef struct supine_patient_mode {
  double value;     /**< of log E within half the radius */
  double centre[3]; /**< mm, where the surface is at rest */
  double radius;    /**< mm, > 0 */
} supine_patient_mode;

/** The regions of the left lung and of the right. Both counts 0: even stiffness. */
typedef struct supine_patient_stiffness {
  size_t count[2];
  supine_patient_mode mode[2][SUPINE_PATIENT_MODES];
} supine_patient_stiffness;

/** w at a point.
 * @param slope  optional: dw/dt there */
double supine_patient_mode_at(const supine_patient_mode *mode, const double point[3],
                              double *slope);

/** The side of a vertex as the regions count: 0 left, 1 right. */
size_t supine_patient_side_of(const supine_lungs *lungs, size_t vertex);

/** E [N] of every vertex, relative. */
void supine_patient_stiffness_of(const supine_patient_stiffness *stiffness,
                                 const supine_lungs *lungs, double *e);

#endif
