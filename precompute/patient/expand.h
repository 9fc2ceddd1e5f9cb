/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Expandability from motion ([Santhanam2008] VI): a stiffness for each region of a lung,
 * such that a known force moves it to the other surface.
 *
 * The motion depends only on the product a f of expandability and force, so f is fixed to the
 * model's (18). The spread force F is then linear in the regions' values a_k (stiffness.h), F =
 * sum of a_k F_k, where F_k is the spread force of region k alone: one solve with a right-hand
 * side for each region. The fit alternates between
 *
 *     least over a of  sum of w (along_i sum of a_k F_ik - target_i)^2 + roughness + (a_k - 1)^2
 *
 * which is linear least squares, and the law's directions and the motion between the scans
 * (supine_patient_law_fit), until neither changes. Where the surfaces say little about a region,
 * its neighbours determine it; the diagonal of the resolution matrix says how much the surfaces
 * contribute.
 *
 * The result is kept only if it predicts held-out blocks of 40 mm better than uniform tissue
 * does under the same force. */
#ifndef SUPINE_PATIENT_EXPAND_H
#define SUPINE_PATIENT_EXPAND_H

#include "precompute/patient/krige.h"
#include "precompute/patient/matching.h"
#include "precompute/patient/stiffness.h"

/** Least diagonal of the resolution matrix at which a region counts as seen. */
#define SUPINE_PATIENT_SEEN 0.5

/** Fit and held-out error, without and with expandability. */
typedef struct supine_patient_expand_report {
  bool tried, kept;
  double fitted[2];   /**< RMS distance between the surfaces along normals, mm, without and with */
  double held_out[2]; /**< the same on held-out blocks */
  double softest, stiffest; /**< range of E that holds nine tenths of the seen regions; the
                             * geometric mean of all is 1 */
  size_t regions, unseen;
} supine_patient_expand_report;

/** Find the expandability, and keep it if held-out blocks improve. The matching, without
 * landmarks, ends at the rows of the law that is kept.
 * @param options    of the paper's law; the gravity of the other state
 * @param model      its force is held fixed
 * @param patient    in: the law without; out: the law that is kept
 * @param stiffness  no regions if it was not kept
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_fit_options *options,
                                    const supine_model *model, supine_patient *patient,
                                    supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error);

#endif
