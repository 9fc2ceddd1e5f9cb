/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Fit a patient's law to landmarks or surfaces, and measure its error on held-out blocks. */
#ifndef SUPINE_PATIENT_FIT_H
#define SUPINE_PATIENT_FIT_H

#include "precompute/patient/patient.h"
#include "precompute/patient/rows.h"

/** Folds of the held-out blocks, and seeds of the grids that cut the blocks. */
enum { SUPINE_PATIENT_FOLDS = 5, SUPINE_PATIENT_SEEDS = 3 };

/** Zero-initialised: the deep law, corrected, no motion between the scans. */
typedef struct supine_patient_fit_options {
  supine_patient_law law;
  supine_patient_moved moved;
  bool uncorrected;  /**< leave the correction out */
  double gravity[3]; /**< of the emptier state; all 0: supine */
  double way[3];     /**< share of full inflation to rest between the states, by axis
                      * (supine_patient_deep); all 0: 1 */
} supine_patient_fit_options;

/** Errors of a law and of its baselines, fitted or held out, mm RMS. */
typedef struct supine_patient_scores {
  double none, translation, affine;
  double law;       /**< without correction */
  double corrected; /**< with correction */
} supine_patient_scores;

typedef struct supine_patient_fit_report {
  size_t count;      /**< landmarks, or points of a surface */
  size_t blocks;     /**< cubes of 40 mm with points in them */
  size_t components; /**< components measured per point: 3 if all are landmarks, else 1 */
  supine_patient_scores fitted;
  supine_patient_scores held_out; /**< on held-out blocks */
  double band;                    /**< share of held-out points within the 95 % band */
  double expected;  /**< expected error of held-out points, mm RMS (of one component, if one is
                     * measured) */
  double explained; /**< held-out share of the squared displacement that the law explains */
  double explained_fitted; /**< the same of the fitted points */
  double expected_point; /**< expected error of points of the surface in three dimensions, mm RMS */
  double moved;          /**< mean displacement of the fitted points, mm */
  double error[SUPINE_PATIENT_CONSTANTS]; /**< standard errors of c1 to c9 */
} supine_patient_fit_report;

/** Express the deep law by nine constants for gravity along a unit vector (all 0: supine). `way`
 * scales its lengths along x, y and z by the share of full inflation to rest between the two
 * states (all 0: 1). */
supine_patient_power supine_patient_deep(const double gravity[3], const double way[3]);

/** Fit a law and its correction to rows, and measure its error on held-out blocks of 40 mm.
 * @param frame    of the box coordinates
 * @param rows     [single + 3 triples]; their `block` is written
 * @param single   rows of points with one known component; they come first
 * @param triples  landmarks, three rows each
 * @param report   optional
 * @retval SUPINE_ERROR_FORMAT     fewer points than the law has unknowns
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_fit(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t single, size_t triples,
                                 const supine_patient_fit_options *options, supine_patient *patient,
                                 supine_patient_fit_report *report, supine_error *error);

#endif
