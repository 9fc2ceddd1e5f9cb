/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Compare scans and landmarks with each other before they are believed: do they show one
 * person, in the stated order? The limits are those of docs/inputs.md. */
#ifndef SUPINE_PATIENT_CHECKS_H
#define SUPINE_PATIENT_CHECKS_H

#include <supine/findings.h>

#include "precompute/lungs/lungs.h"
#include "precompute/patient/pairs.h"

/** Measures of two lungs by which the scans of two people can often be told apart. */
typedef struct supine_patient_size {
  double width, depth, height; /**< of the bounding box, mm */
  double volume;               /**< mL */
  double left;                 /**< the left lung's share of the volume */
} supine_patient_size;

/** Measure lungs. Return false if there are not two of them. */
bool supine_patient_size_of(const supine_lungs *lungs, supine_patient_size *size);

/** Warn if two scans in one posture differ more than scans of one person do. */
void supine_patient_check_person(const supine_patient_size *first,
                                 const supine_patient_size *second, supine_findings *findings);

/** Warn if landmarks lie outside the lungs in which they were set: they are another person's,
 * mirrored, or in other axes.
 * @param state   names the lungs, such as "first scan"
 * @param points  [count, 3] mm */
supine_status supine_patient_check_landmarks(const char *state, const supine_mesh *lungs,
                                             size_t count, const double *points,
                                             supine_findings *findings, supine_error *error);

/** Return the standard error of the logarithm of supine_patient_pairs_growth, by leaving out each
 * of 20 groups of pairs. */
double supine_patient_growth_error(const supine_patient_pairs *pairs);

/** Refuse landmarks that grow where the lungs shrink, or shrink where the lungs grow, beyond the
 * error of the landmarks' growth: their first and second points are exchanged.
 * @param growth  volume of the lungs in the state of the second points / that in the state of the
 *   first */
supine_status supine_patient_check_order(const supine_patient_pairs *pairs, double growth,
                                         supine_error *error);

/** Drop pairs, with a warning that names them, counted from 1, whose displacement differs from the
 * median displacement of their eight neighbours by far more than it does for half of the pairs:
 * they were mismatched. At most one pair in five is dropped; if more differ, all are kept, and
 * fewer than 30 pairs are not compared.
 * @param name  file of the pairs, for the warning */
supine_status supine_patient_drop_mismatched(const char *name, supine_patient_pairs *pairs,
                                             supine_findings *findings, supine_error *error);

/** Warn if lungs have another size than in the scan of the fit: width, depth, height or volume.
 * @param low, high  bounding box of the scan that was fitted, mm
 * @param volume     its volume, mL, or 0 if unknown */
void supine_patient_check_size(const supine_lungs *lungs, const double low[3], const double high[3],
                               double volume, supine_findings *findings);

#endif
