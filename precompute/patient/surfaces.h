/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file A patient's law from surfaces of the same lungs in another state, with any meshes.
 *
 * Each round moves every vertex of the reference surface by the present law. The nearest point
 * of the other surface, if its normal is compatible, gives a row along that normal (point to
 * plane, so that surfaces may slide), with a robust weight (Tukey's biweight). The law is then
 * fitted to the rows. Rounds repeat until no vertex moves.
 *
 * A small distance between surfaces does not prove the motion of points: sliding along the
 * surface is not observed. */
#ifndef SUPINE_PATIENT_SURFACES_H
#define SUPINE_PATIENT_SURFACES_H

#include "precompute/patient/patient_file.h"

/** Data and options of a fit to surfaces. */
typedef struct supine_patient_surface_task {
  const supine_lungs *rest;
  const supine_mesh *state;  /**< the same lungs, mm, same frame */
  const supine_model *model; /**< stiffness and spreading of the force; with expandability its
                              * force is held fixed */
  const supine_patient_pairs *landmarks; /**< optional, fitted as well; not with expandability */
  supine_patient_fit_options options;
  bool expandability; /**< fit it too (expand.h), with the paper's law, uncorrected */
} supine_patient_surface_task;

/** Fit a law to a surface in another state; write patient, reports, stiffness and applied force
 * into the record.
 * @retval SUPINE_ERROR_MESH  no overlap (frames, units or sides differ), equal surfaces, or too
 *   few compatible points
 * @retval those of supine_patient_fit */
supine_status supine_patient_fit_surface(const supine_patient_surface_task *task,
                                         supine_patient_record *record, supine_error *error);

#endif
