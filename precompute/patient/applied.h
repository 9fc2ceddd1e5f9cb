/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The force that a measured displacement shows ([Santhanam2008] IV-B.3), without a word of what it
 * should look like:
 *
 *     F_i = u_i . d_i / |d_i|^2      u: where the other surface lies; d: (15)-(17) as fitted
 *     f = A F                        back through the operator (inverse.h)
 *
 * Roughness of u grows on that way by the square of spreading length over link, so f is looked at
 * in means over the surface in blocks of 40 mm: sums are what the operator passes on unchanged. */
#ifndef SUPINE_PATIENT_APPLIED_H
#define SUPINE_PATIENT_APPLIED_H

#include "precompute/patient/matching.h"

typedef struct supine_patient_applied {
  size_t blocks;
  double matched;     /**< share of the vertices that the other surface was seen from */
  double correlation; /**< of the force with the height along gravity, over the blocks */
  double slopes[3];   /**< c7 to c9 of (18) fitted to the force, 1 at the box's centre */
  double left;        /**< RMS that (18) leaves of it, of the force at the centre */
  double spread;      /**< RMS of the force about its mean, the same */
} supine_patient_applied;

/** Finds the force at every vertex of the surface at rest.
 * @param matching   with the catch under the stiffness
 * @param patient    the law as it was fitted to the matching
 * @param stiffness  [N] or NULL: 1
 * @param gravity    of the other state
 * @retval SUPINE_ERROR_NUMERICAL  the blocks determine no (18)
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_applied_find(const supine_patient_matching *matching,
                                          const supine_patient *patient, const double *stiffness,
                                          const double gravity[3], supine_patient_applied *applied,
                                          supine_error *error);

#endif
