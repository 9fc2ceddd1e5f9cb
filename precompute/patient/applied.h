/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file The force that a measured displacement shows ([Santhanam2008] IV-B.3), with no
 * assumption about its form:
 *
 *     F_i = u_i . d_i / |d_i|^2  u: displacement to the other surface; d: fitted directions
 * (15)-(17) f = A F                    inverts the spreading operator (equilibrium.h)
 *
 * The inversion amplifies the roughness of u by (spreading length / edge length)^2, so f is
 * averaged over blocks of 40 mm of surface: the operator conserves sums. */
#ifndef SUPINE_PATIENT_APPLIED_H
#define SUPINE_PATIENT_APPLIED_H

#include "precompute/patient/matching.h"

typedef struct supine_patient_applied {
  size_t blocks;
  double matched;     /**< share of the vertices with a compatible point on the other surface */
  double correlation; /**< between force and height along gravity, over the blocks */
  double slopes[3];   /**< c7 to c9 of (18) fitted to the force, 1 at the box's centre */
  double left;        /**< RMS residual of (18), in units of the force at the box's centre */
  double spread;      /**< RMS of the force about its mean, in the same unit */
} supine_patient_applied;

/** Find the force at every vertex of the reference surface.
 * @param matching  solved with the stiffness; afterwards it holds every vertex
 * @param patient   the law fitted to the matching; its correction is not used
 * @param gravity   of the other state
 * @retval SUPINE_ERROR_NUMERICAL  the blocks do not determine (18)
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_applied_find(supine_patient_matching *matching,
                                          const supine_patient *patient, const double gravity[3],
                                          supine_patient_applied *applied, supine_error *error);

#endif
