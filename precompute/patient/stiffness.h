/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file A patient's expandability a = 1/E ([Santhanam2008] VI) as a weighted mean over a few
 * regions of each lung, independent of the mesh:
 *
 *     a(p) = sum over k of w(|p - centre_k| / radius_k) a_k
 *            / sum over k of w(|p - centre_k| / radius_k)
 *     w(t) = 1 for t <= 1/2, 0 for t >= 1, 3 q^2 - 2 q^3 between, q = 2 (1 - t) */
#ifndef SUPINE_PATIENT_STIFFNESS_H
#define SUPINE_PATIENT_STIFFNESS_H

#include "precompute/lungs/lungs.h"

/** Most regions of both lungs. */
enum { SUPINE_PATIENT_MODES = 256 };

typedef struct supine_patient_mode {
  int side;         /**< of its lung: 1 left, -1 right */
  double value;     /**< a_k > 0 */
  double centre[3]; /**< mm, in the reference surface */
  double radius;    /**< mm, > 0 */
  double seen;      /**< contribution of the surfaces, 0 to 1; the remainder comes from
                     * neighbouring regions */
} supine_patient_mode;

/** The regions, those of the left lung first; none: even tissue. */
typedef struct supine_patient_stiffness {
  size_t count;
  supine_patient_mode mode[SUPINE_PATIENT_MODES];
} supine_patient_stiffness;

/** Spread regions over the lungs' surface, some 45 mm apart, of a = 1. */
void supine_patient_stiffness_spread(const supine_lungs *lungs,
                                     supine_patient_stiffness *stiffness);

/** Find the weights [count] of the regions at a vertex; they sum to 1. */
void supine_patient_stiffness_shares(const supine_patient_stiffness *stiffness,
                                     const supine_lungs *lungs, size_t vertex, double *shares);

/** Find E [N] of every vertex, relative. */
void supine_patient_stiffness_of(const supine_patient_stiffness *stiffness,
                                 const supine_lungs *lungs, double *e);

#endif
