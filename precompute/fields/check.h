/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Question another simulator's fields before a basis of them is believed. The limits, and on what
 * they were measured, are in the table of checks (docs/inputs.md, group "Fields"). */
#ifndef SUPINE_FIELDS_CHECK_H
#define SUPINE_FIELDS_CHECK_H

#include "precompute/fields/fields.h"
#include <supine/findings.h>

/** How large the displacements of fields are. */
typedef struct supine_fields_motion {
  double rms_mm;     /**< RMS over all runs */
  double nearest[3]; /**< the direction of gravity nearest to that of supine posture */
  double along_mm;   /**< mean displacement along gravity in the runs of this direction */
} supine_fields_motion;

/** Check the directions of gravity and the sizes of the displacements.
 * @param name      of the file, for messages
 * @param findings  warnings are added
 * @param motion    written
 * @retval SUPINE_ERROR_FORMAT  the directions do not determine how gravity displaces the lungs, or
 *   the displacements are positions */
supine_status supine_fields_check(const char *name, const supine_fields *fields,
                                  const supine_lungs *lungs, supine_findings *findings,
                                  supine_fields_motion *motion, supine_error *error);

/** Check that the fit predicts runs that it has not seen.
 * @retval SUPINE_ERROR_FORMAT  directions of gravity do not predict the displacements */
supine_status supine_fields_check_fit(const char *name, const supine_fit_report *report,
                                      supine_findings *findings, supine_error *error);

#endif
