/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Expandability from motion ([Santhanam2008] VI): the stiffness under which the paper's law comes
 * nearest to a surface in another state.
 *
 * With q the regions' values, centres and radii (stiffness.h), c what the law has beside them,
 * found anew for each q (variable projection), and r what rows are left of:
 *
 *     least over q of  J(q) = min over c of sum of w r^2  +  ridge (value^2 + ln(radius / 60)^2)
 *
 * by BFGS, the gradient by the adjoint of the equilibrium (inverse.h). Regions come one by one,
 * each where J falls most, until one more is worth next to nothing. All of it counts only where
 * blocks of 40 mm that it has not seen come nearer than without it. */
#ifndef SUPINE_PATIENT_EXPAND_H
#define SUPINE_PATIENT_EXPAND_H

#include "precompute/patient/matching.h"
#include "precompute/patient/stiffness.h"

/** Called with the share of the work done; false asks to stop. */
typedef bool supine_patient_progress(void *context, double share);

/** What expandability was worth. */
typedef struct supine_patient_expand_report {
  bool tried, kept;
  double fitted[2];   /**< without and with it: from surface to surface along normals, mm RMS */
  double held_out[2]; /**< the same on blocks that neither had seen */
  double softest, stiffest; /**< E over the surface, its geometric mean 1 */
} supine_patient_expand_report;

/** Finds the stiffness, and keeps it where held-out blocks improve: the matching then stands at
 * rows of the law with it, else at those without.
 * @param power      the law without; with, where it was kept
 * @param progress   optional
 * @param stiffness  counts 0 where it was not kept
 * @retval SUPINE_ERROR_INTERRUPTED, SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_expand(supine_patient_matching *matching, supine_patient_moved moved,
                                    supine_patient_progress *progress, void *context,
                                    supine_patient_power *power,
                                    supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error);

/** J at a stiffness for the matching's rows, and its slopes by the value, the centre and the radius
 * of every region, [5 regions], left lung first.
 * @param power  where to start c from, and where it ended
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_expand_cost(const supine_patient_matching *matching,
                                         supine_patient_moved moved,
                                         const supine_patient_stiffness *stiffness,
                                         supine_patient_power *power, double *cost, double *slopes,
                                         supine_error *error);

#endif
