/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Find the share of a patient's force that turns with gravity. Two scans in one posture
 * do not determine it; scans in other postures do. */
#ifndef SUPINE_PATIENT_GAIN_H
#define SUPINE_PATIENT_GAIN_H

#include "precompute/patient/patient_file.h"

/** A further state of the same lungs: its surface, or matched points of it and the fuller state. */
typedef struct supine_patient_other {
  double gravity[3];
  const supine_patient_pairs *pairs; /**< NULL if the state is a surface */
  const supine_mesh *surface;        /**< used if pairs is NULL */
  double scale;                      /**< out: 1 where it is as far from full inflation as rest */
  double left;                       /**< out: RMS residual, mm; of a surface along its normals */
  double left_without; /**< out: the same at a gain of 0, with all of the force fixed to the body */
} supine_patient_other;

typedef struct supine_patient_gain {
  bool told; /**< some state was in another posture, so the gain was fitted */
  bool open; /**< the fit ended at a bound: the gain is undetermined and kept */
  double gain;
  double
      error; /**< standard error of the gain, by leaving out each eighth of the lungs (jackknife) */
} supine_patient_gain;

/** Move points [count, 3] of the emptier state to their places in the fuller one, where they came
 * from. */
void supine_patient_refer(const supine_patient *patient, size_t count, double *points);

/** Find the gain from further states, with the fitted field u of the law, scaled to the whole
 * way from full inflation to rest (supine_patient_path):
 *
 *     u_j(p) = s_j f(g_j, p) / f(g, p) u(p) (+ t_j)      f of supine_patient_force at that gain,
 *                                                        for a surface, the spread force
 *
 * minus the displacement of the fuller state from full inflation, if known. s_j and the
 * translations t_j come from linear least squares, the gain from a search between 0 and 2; the
 * nearest points of surfaces are found again each round.
 * @param record  gives posture, stiffness and the gain that is kept if the states determine none
 * @param rest    the surface of the fuller state; NULL where no state is a surface
 * @param reach   spreading length of its force, mm
 * @param moved   also fit a translation between the scans
 * @param others  [count] the results are written into them
 * @retval SUPINE_ERROR_MESH    too few compatible points
 * @retval SUPINE_ERROR_MEMORY, those of the solve */
supine_status supine_patient_gain_fit(const supine_patient_record *record, const supine_lungs *rest,
                                      double reach, bool moved, supine_patient_other *others,
                                      size_t count, supine_patient_gain *found,
                                      supine_error *error);

#endif
