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

#include "precompute/patient/matching.h"
#include "precompute/patient/stiffness.h"

/** Called with the share of the work done; false asks to stop. */
typedef bool supine_patient_progress(void *context, double share);

/** Least diagonal of the resolution matrix at which a region counts as seen. */
#define SUPINE_PATIENT_SEEN 0.5

/** What is known before the fit. */
typedef struct supine_patient_expand_task {
  supine_patient_moved moved;
  const supine_model *model;         /**< its force is held fixed */
  const double *gravity;             /**< of the other state */
  supine_patient_progress *progress; /**< optional */
  void *context;
} supine_patient_expand_task;

/** Fit and held-out error, without and with expandability. */
typedef struct supine_patient_expand_report {
  bool tried, kept;
  double fitted[2];   /**< RMS distance between the surfaces along normals, mm, without and with */
  double held_out[2]; /**< the same on held-out blocks */
  double softest, stiffest; /**< range that holds nine tenths of the seen E, of mean 1 */
  size_t regions, unseen;
} supine_patient_expand_report;

/** Find the expandability, and keep it if held-out blocks improve. The matching ends at the rows
 * of the law that is kept.
 * @param patient    in: the law without; out: the law that is kept
 * @param stiffness  counts are 0 if it was not kept
 * @retval SUPINE_ERROR_INTERRUPTED, SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_expand_task *task, supine_patient *patient,
                                    supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error);

#endif
