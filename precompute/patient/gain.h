/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * How much of a patient's force turns with gravity: what two scans in one posture leave open, and
 * others in other postures tell. */
#ifndef SUPINE_PATIENT_GAIN_H
#define SUPINE_PATIENT_GAIN_H

#include "precompute/patient/patient_file.h"

/** A further state of the same lungs: its surface, or its points from the fuller state. */
typedef struct supine_patient_other {
  double gravity[3];
  const supine_patient_pairs *pairs; /**< or NULL */
  const supine_mesh *surface;        /**< where there are no pairs */
  double scale;                      /**< found: 1 where it is as far from full inflation as rest */
  double left;                       /**< found: mm RMS; of a surface along its normals */
  double left_without; /**< found: the same at a gain of 0: all of the force fixed to the body */
} supine_patient_other;

typedef struct supine_patient_gain {
  bool told; /**< a state in another posture was given, so the gain was fitted */
  bool open; /**< the fit ended at a bound: the states do not determine the gain, which stays */
  double gain;
  double error; /**< its standard error, by leaving each block of 40 mm out (jackknife) */
} supine_patient_gain;

/** Move points [count, 3] of the emptier state to where they are in the fuller one. */
void supine_patient_refer(const supine_patient *patient, size_t count, double *points);

/** Finds the gain from further states, with the law's field u as it was fitted, over its part of
 * the way from full inflation to rest (supine_patient_path):
 *
 *     u_j(p) = s_j f(g_j, p) / f(g, p) u(p) (+ t_j)      f of supine_patient_force at that gain,
 *                                                        of a surface what it comes to (its catch)
 *
 * less what the fuller state is below full inflation, where that is known. s_j and the translations
 * t_j by linear least squares, the gain by search between 0 and 2; points of surfaces are found
 * anew in rounds.
 * @param record  with its posture, its stiffness and a force whose gain is kept where none is told
 * @param rest    the surface of the fuller state; NULL where no state is a surface
 * @param reach   spreading length of its force, mm
 * @param moved   a translation between the scans is found as well
 * @param others  [count] what was found is written into them
 * @retval SUPINE_ERROR_MESH    next to no compatible points
 * @retval SUPINE_ERROR_MEMORY, those of the solve */
supine_status supine_patient_gain_fit(const supine_patient_record *record, const supine_lungs *rest,
                                      double reach, bool moved, supine_patient_other *others,
                                      size_t count, supine_patient_gain *found,
                                      supine_error *error);

#endif
