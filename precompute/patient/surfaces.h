/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * A patient's law from surfaces of the same lungs in another state, of any meshing.
 *
 * Each vertex of the surface at rest is moved by the law so far; the point of the other surface
 * nearest to where it comes, if its normal points the same way, gives a row along that normal
 * (point to plane, so that surfaces may slide), weighted down the farther it is beyond what most
 * are (Tukey's biweight); the law is fitted to the rows; and so on until nothing moves.
 *
 * A small distance between surfaces does not prove the motion of points: what slides along the
 * surface does not show. */
#ifndef SUPINE_PATIENT_SURFACES_H
#define SUPINE_PATIENT_SURFACES_H

#include "precompute/patient/applied.h"
#include "precompute/patient/expand.h"
#include "precompute/patient/fit.h"

/** How the surfaces came together. */
typedef struct supine_patient_surface_report {
  size_t rounds;
  size_t vertices;      /**< that took part */
  double matched;       /**< share of them with a compatible point */
  double before, after; /**< RMS of point to plane at rest and in the end, mm */
} supine_patient_surface_report;

/** What a law is fitted to. */
typedef struct supine_patient_surface_task {
  const supine_lungs *rest;
  const supine_mesh *state;  /**< the same lungs, mm, same frame */
  const supine_model *model; /**< stiffness and spreading of the force; the force itself is
                                  held where expandability is to be found */
  const supine_patient_pairs *landmarks; /**< optional, to be matched as well */
  supine_patient_fit_options options;    /**< the gravity below counts */
  double gravity[3];                     /**< of the emptier state */
  bool expandability; /**< to be found as well (expand.h): by the paper's law, uncorrected */
  supine_patient_progress *progress; /**< optional */
  void *progress_context;
} supine_patient_surface_task;

/** What was found. */
typedef struct supine_patient_surface_fit {
  supine_patient patient;
  supine_patient_fit_report report;
  supine_patient_surface_report surface;
  supine_patient_stiffness stiffness; /**< counts 0: even */
  supine_patient_expand_report expand;
  supine_patient_applied applied;
} supine_patient_surface_fit;

/** Fits a law to a surface in another state.
 * @retval SUPINE_ERROR_MESH  nothing overlaps (frames, units or sides differ), axes are reversed,
 * the same surface as rest, or next to no compatible points
 * @retval SUPINE_ERROR_INTERRUPTED  progress said so
 * @retval those of supine_patient_fit */
supine_status supine_patient_fit_surface(const supine_patient_surface_task *task,
                                         supine_patient_surface_fit *fit, supine_error *error);

#endif
