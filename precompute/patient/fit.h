/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Fit a patient's law to landmarks or surfaces, and measure its error on held-out blocks. */
#ifndef SUPINE_PATIENT_FIT_H
#define SUPINE_PATIENT_FIT_H

#include "precompute/patient/krige.h"

/** Seeds of the grids that cut the held-out blocks. */
enum { SUPINE_PATIENT_SEEDS = 3 };

/** Predictions of the displacement: the baselines, the law, and the law with its correction. */
typedef enum supine_patient_score {
  SUPINE_PATIENT_SCORE_NONE,
  SUPINE_PATIENT_SCORE_TRANSLATION,
  SUPINE_PATIENT_SCORE_AFFINE,
  SUPINE_PATIENT_SCORE_LAW,
  SUPINE_PATIENT_SCORE_CORRECTED,
  SUPINE_PATIENT_SCORES
} supine_patient_score;

/** Result of a fit; errors are in mm RMS. */
typedef struct supine_patient_fit_report {
  double points;     /**< number of landmarks, or of points of a surface */
  double blocks;     /**< number of cubes of 40 mm with points in them */
  size_t components; /**< components measured per point: 3 if all are landmarks, else 1 */
  double fitted[SUPINE_PATIENT_SCORES];   /**< on the fitted points */
  double held_out[SUPINE_PATIENT_SCORES]; /**< on held-out blocks */
  double baseline;  /**< on held-out blocks: of a translation if the scans moved, else of none */
  double band;      /**< % of the held-out points within the 95 % band */
  double expected;  /**< expected error of held-out points (of one component, if one is measured) */
  double explained; /**< held-out share of the squared displacement that the law explains, % */
  double explained_fitted;                /**< the same share of the fitted points, % */
  double expected_point;                  /**< expected error of points in three dimensions */
  double expected_constant;               /**< its square for each mm of displacement, mm */
  double error[SUPINE_PATIENT_CONSTANTS]; /**< standard errors of c1 to c9 */
} supine_patient_fit_report;

/** Fit a law and its correction to rows, and measure its error on held-out blocks of 40 mm.
 * @param rows     [single + 3 triples]; their `block` is written
 * @param single   rows of points with one known component; they come first
 * @param triples  landmarks, three rows each
 * @param patient  in: the frame of the rows; out: the law and its correction
 * @retval SUPINE_ERROR_FORMAT     fewer points than the law has unknowns
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_fit(const supine_patient_fit_options *options,
                                 supine_patient_row *rows, size_t single, size_t triples,
                                 supine_patient *patient, supine_patient_fit_report *report,
                                 supine_error *error);

#endif
