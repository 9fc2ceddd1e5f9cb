/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Fit a patient's displacement law to two scans in any order, and its gain to further ones. */
#ifndef SUPINE_PATIENT_SCANS_H
#define SUPINE_PATIENT_SCANS_H

#include <supine/findings.h>

#include "precompute/patient/patient_file.h"

/** What is known of two scans of one person: surfaces, landmarks, and states. Initialise to zero,
 * and release with supine_patient_scans_free. */
typedef struct supine_patient_scans {
  supine_lungs lungs[2];      /**< empty if a scan has no surface */
  supine_patient_pairs pairs; /**< landmarks in both scans; may be empty */
  const double *midline;      /**< x of the plane between the lungs, mm; NULL for the middle */
  bool reordered;             /**< set by supine_patient_scans_order: they were exchanged */
  supine_findings findings;   /**< set by supine_patient_scans_order, for the user */
} supine_patient_scans;

void supine_patient_scans_free(supine_patient_scans *scans);

/** Put the fuller scan first, and write both states, their volumes and the bounding box of the
 * emptier one into the record. If the states do not tell which scan is fuller, compare the volumes
 * of the surfaces or, without two surfaces, use the volume change of an affine map of the
 * landmarks.
 * @param record  in: `state`, of the scans as given; a missing volume (SUPINE_VOLUME_DEFAULT) is
 *   found from surfaces */
supine_status supine_patient_scans_order(supine_patient_scans *scans, supine_patient_record *record,
                                         supine_error *error);

/** Fit the displacement law to ordered scans. Warn if their surfaces differ no more than those of
 * one scan do.
 * @param options        `gravity` and `path_span` are taken from the record
 * @param expandability  as supine_patient_fit_surface */
supine_status supine_patient_scans_fit(supine_patient_scans *scans,
                                       const supine_patient_fit_options *options,
                                       bool expandability, supine_patient_record *record,
                                       supine_error *error);

/** Fit landmarks of a further scan by supine_patient_gain_fit_landmarks, and append the result to
 * the record. Call supine_patient_scans_fit first.
 * @param pairs  points in the first of the two scans as given, and in the further scan; they may be
 *   moved */
supine_status supine_patient_scans_fit_further_landmarks(
    const supine_patient_scans *scans, const supine_state *state, bool scans_moved,
    supine_patient_pairs *pairs, supine_patient_record *record, supine_error *error);

/** Fit the surface of a further scan by supine_patient_gain_fit_surface, and append the result to
 * the record. Warn in scans->findings if the further scan hardly is of the same person as the scan
 * in the same posture. Call supine_patient_scans_fit first. */
supine_status supine_patient_scans_fit_further_surface(supine_patient_scans *scans,
                                                       const supine_state *state, bool scans_moved,
                                                       const supine_lungs *scan,
                                                       supine_patient_record *record,
                                                       supine_error *error);

#endif
