/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Expandability from motion ([Santhanam2008] VI): how readily each region of a lung gives way, so
 * that a known force moves it as the other surface shows.
 *
 * Only the product a f of expandability and force moves anything, so that f is held at the model's
 * (18). The catch is then linear in the regions' values a_k (stiffness.h), F = sum of a_k F_k, with
 * F_k what region k alone makes of the force: one solve with a right-hand side a region. By turns
 *
 *     least over a of  sum of w (along_i sum of a_k F_ik - target_i)^2 + roughness + (a_k - 1)^2
 *
 * which is linear least squares, and the law's directions and the motion between the scans
 * (supine_patient_law_fit), until the one no longer changes the other. What the surfaces do not
 * tell of a region, its neighbours do: the diagonal of the resolution matrix says how much.
 *
 * All of it counts only where blocks of 40 mm that it has not seen come nearer than with even
 * tissue under the same force. */
#ifndef SUPINE_PATIENT_EXPAND_H
#define SUPINE_PATIENT_EXPAND_H

#include "precompute/patient/matching.h"
#include "precompute/patient/stiffness.h"

/** Called with the share of the work done; false asks to stop. */
typedef bool supine_patient_progress(void *context, double share);

/** A region counts as seen where the surfaces tell so much of it. */
#define SUPINE_PATIENT_SEEN 0.5

/** What is known beforehand. */
typedef struct supine_patient_expand_task {
  supine_patient_moved moved;
  const supine_model *model;         /**< its force is the one that is held */
  const double *gravity;             /**< of the other state */
  supine_patient_progress *progress; /**< optional */
  void *context;
} supine_patient_expand_task;

/** What expandability was worth. */
typedef struct supine_patient_expand_report {
  bool tried, kept;
  double fitted[2];   /**< without and with it: from surface to surface along normals, mm RMS */
  double held_out[2]; /**< the same on blocks that neither had seen */
  double softest, stiffest; /**< nine tenths of what is seen have an E between, of mean 1 */
  size_t regions, unseen;
} supine_patient_expand_report;

/** Finds the expandability, and keeps it where held-out blocks improve: the matching then stands at
 * rows of the law with it, else at those without.
 * @param patient    the law without; with, where it was kept
 * @param stiffness  counts 0 where it was not kept
 * @retval SUPINE_ERROR_INTERRUPTED, SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_expand_task *task, supine_patient *patient,
                                    supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error);

#endif
