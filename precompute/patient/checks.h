/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Compare scans and landmarks with each other before they are believed: do they show one
 * person, in the stated order? The limits are those of docs/inputs.md. */
#ifndef SUPINE_PATIENT_CHECKS_H
#define SUPINE_PATIENT_CHECKS_H

#include <supine/findings.h>

#include "precompute/lungs/lungs.h"
#include "precompute/patient/pairs.h"
#include "precompute/patient/patient_file.h"

/** Measures of lungs by which the scans of two people can often be told apart: of the left, then
 * the right lung; 0 of a lung that is absent. */
typedef struct supine_patient_size {
  double volume[2];    /**< mL */
  double spread[2][3]; /**< supine_mesh_spread from side to side, front to back, up and down, mm */
} supine_patient_size;

/** Measure one lung.
 * @param side   +1 left, -1 right
 * @param begin  begin <= vertex < end is the lung */
void supine_patient_size_add(const supine_mesh *mesh, int side, size_t begin, size_t end,
                             supine_patient_size *size);

/** Measure lungs. */
supine_patient_size supine_patient_size_of(const supine_lungs *lungs);

/** Warn if lungs in two scans of one posture hardly show one person. Nothing is told if one scan
 * has a lung that the other has not. */
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

/** Warn if a scan holds another volume than its state names. States from rest or full inflation
 * name none.
 * @param held  volume of the scan, mL; 0 if unknown */
void supine_patient_check_volume(const supine_volume *named, double held,
                                 supine_findings *findings);

/** Warn if scans and their states give a volume at rest that people hardly have. Return whether
 * they do.
 * @param share  volume at rest / volume at full inflation
 * @param gravity  direction in which it is at rest, LPS */
bool supine_patient_tell_rest(double share, const double gravity[3], supine_findings *findings);

/** Warn if lungs are not those of the scan of a fit: by width, depth and height if surfaces were
 * fitted, by volume, and by the share of the landmarks outside. Of one lung, only landmarks tell.
 * @param state  which state the lungs show: 0 the fuller, 1 the emptier */
supine_status supine_patient_check_lungs(const supine_patient_record *fitted, size_t state,
                                         const supine_lungs *lungs, supine_findings *findings,
                                         supine_error *error);

/** Warn if a scan is given another state than a fit has it in: another posture, or a volume by
 * which full inflation would be another.
 * @param held     volume of the scan, mL
 * @param resting  volumes at rest of the fit */
void supine_patient_check_state(const supine_state *given, const supine_state *fitted, double held,
                                const supine_resting *resting, supine_findings *findings);

#endif
