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

#include "precompute/patient/fit.h"
#include "precompute/physics/model.h"

/** How the surfaces came together. */
typedef struct supine_patient_surface_report {
  double distance[SUPINE_PATIENT_STARTS]; /**< RMS of point to plane after each start, mm */
  double point_apart;   /**< largest distance between where two starts put a vertex, mm */
  size_t rounds;        /**< of the best start */
  size_t vertices;      /**< that took part */
  double matched;       /**< share of them with a compatible point */
  double before, after; /**< RMS of point to plane at rest and in the end, mm */
} supine_patient_surface_report;

/** The frame of a surface: its lungs' box and midline. */
supine_patient_frame supine_patient_frame_of_lungs(const supine_lungs *lungs);

/** Fits a law to a surface in another state.
 *
 * @param rest       at rest
 * @param state      the same lungs, mm, same frame
 * @param model      stiffness and spreading of the force; its force and directions do not count
 * @param landmarks  optional, to be matched as well
 * @param options    without a law given: the paper's, as surfaces show no sliding
 * @retval SUPINE_ERROR_MESH  nothing overlaps (frames, units or sides differ), the same surface as
 *                            rest, or next to no compatible points
 * @retval those of supine_patient_fit */
supine_status supine_patient_fit_surface(const supine_lungs *rest, const supine_mesh *state,
                                         const supine_model *model,
                                         const supine_patient_pairs *landmarks,
                                         const supine_patient_fit_options *options,
                                         supine_patient *patient, supine_patient_fit_report *report,
                                         supine_patient_surface_report *surface,
                                         supine_error *error);

#endif
