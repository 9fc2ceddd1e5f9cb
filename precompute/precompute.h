/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a basis file from lungs. */
#ifndef SUPINE_PRECOMPUTE_H
#define SUPINE_PRECOMPUTE_H

#include "precompute/lungs/lungs.h"
#include "precompute/physics/model.h"
#include "precompute/physics/reference.h"
#include "precompute/projection/accuracy.h"
#include "precompute/projection/projection.h"

typedef struct supine_precompute_options {
  supine_model model;
  const supine_reference *reference; /**< NULL if the resting volume (FRC) is unknown */
  size_t band;                       /**< highest degree of the harmonics */
  size_t modes;    /**< largest number of modes; 0 uses the harmonics instead of modes */
  size_t held_out; /**< number of held-out directions of gravity, or 0 for the default */
  /** @{ Constants of the expected position error (supine/locate.h) of a patient's fit, or 0: the
   * metadata expected_error_mm and expected_error_from_mm; and whether the fit had a scan in
   * another posture. */
  double expected_error, expected_from;
  bool turn_fitted;
  /** @} */
  supine_scan_frame frame;
  /** @{ Texts for the metadata of the basis file. Each may be NULL. */
  const char *made_by;         /**< command line that makes the basis */
  const char *patient;         /**< JSON text of the displacement law fitted to the patient */
  const char *patient_summary; /**< name of the fitted displacement law, and its held-out error */
  const char *assumed;         /**< what was assumed: axes, unit, displacement law, volumes, ... */
  const char *findings;        /**< notes and warnings, one per line */
  /** @} */
} supine_precompute_options;

typedef struct supine_precompute_report {
  size_t mode_count;
  supine_accuracy accuracy;
  /** Share of triangles that turn over, 0 to 1 (supine_accuracy_turned_over). */
  double turned_over;
} supine_precompute_report;

/** Make a basis from lungs and a physical model, measure its error, and write the file atomically.
 */
supine_status supine_precompute(const supine_lungs *lungs, const supine_precompute_options *options,
                                const char *path, supine_precompute_report *report,
                                supine_error *error);

#endif
