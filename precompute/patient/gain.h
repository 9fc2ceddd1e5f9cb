/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * How much of a patient's force turns with gravity: what two scans in one posture leave open, and a
 * third in another posture tells. */
#ifndef SUPINE_PATIENT_GAIN_H
#define SUPINE_PATIENT_GAIN_H

#include "precompute/patient/patient_file.h"

typedef struct supine_patient_gain {
  double gain;
  double error; /**< its standard error, by leaving each block of 40 mm out (jackknife) */
  double scale; /**< breath scale of the third scan: 1 where it is as far from rest as the second */
  double left;  /**< mm RMS */
  double left_without; /**< the same at a gain of 0: all of the force fixed to the body */
} supine_patient_gain;

/** Finds the gain from points in a third state, with the law's field u as it was fitted:
 *
 *     u_3(p) = s f(g_3, p) / f(g, p) u(p) (+ t),    f of supine_patient_force at that gain
 *
 * s and the translation t by linear least squares, the gain by search between 0 and 2.
 * @param record   with its posture; its force is not used
 * @param pairs    from the same rest to the third state
 * @param gravity  of the third state
 * @param moved    a translation between the scans is found as well
 * @retval SUPINE_ERROR_ARGUMENT  the posture is the one that was fitted
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_gain_fit(const supine_patient_record *record,
                                      const supine_patient_pairs *pairs, const double gravity[3],
                                      bool moved, supine_patient_gain *found, supine_error *error);

#endif
