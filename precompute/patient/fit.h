/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * From landmarks or surfaces to a patient's law, with what it is worth. */
#ifndef SUPINE_PATIENT_FIT_H
#define SUPINE_PATIENT_FIT_H

#include "precompute/patient/patient.h"
#include "precompute/patient/rows.h"

/** Held-out blocks: folds, and seeds that the grid of blocks is placed with. */
enum { SUPINE_PATIENT_FOLDS = 5, SUPINE_PATIENT_SEEDS = 3, SUPINE_PATIENT_CONSTANTS = 9 };

/** Zero-initialised: the law that holds out best, no motion between the scans. */
typedef struct supine_patient_fit_options {
  bool law_given;
  supine_patient_law law;
  supine_patient_moved moved;
} supine_patient_fit_options;

/** Root mean squares, mm, of what laws leave. */
typedef struct supine_patient_fit_report {
  size_t count;      /**< landmarks, or points of a surface */
  size_t blocks;     /**< cubes that they fall into */
  size_t components; /**< measured at each: 3 of a landmark, 1 of a surface */
  supine_patient_scores fitted;
  supine_patient_scores held_out;       /**< on blocks that the fit had not seen */
  double explained;                     /**< share of the squared displacement, held out */
  double explained_fitted;              /**< the same, of what was fitted */
  double ridge_quadratic;               /**< chosen by held-out blocks */
  double ridge_lung;                    /**< INFINITY: one map for both lungs */
  double starts[SUPINE_PATIENT_STARTS]; /**< what each start left of the paper's law, mm RMS */
  double start_apart;     /**< largest distance between two starts' fields, mm, over the
                               points */
  size_t starts_agreeing; /**< within 1 % of the best */
  bool at_bound[SUPINE_PATIENT_POWERS];
  double error[SUPINE_PATIENT_CONSTANTS]; /**< standard errors of c1 to c9 by block bootstrap */
  double low[SUPINE_PATIENT_CONSTANTS];   /**< its 2.5th and 97.5th percentiles */
  double high[SUPINE_PATIENT_CONSTANTS];
} supine_patient_fit_report;

/** c1 to c9 of a patient, the force scaled to 1 at the box's centre. */
void supine_patient_constants(const supine_patient *patient, double c[SUPINE_PATIENT_CONSTANTS]);

/** Fits all three laws to rows, holds blocks of 40 mm out of each, and keeps one law.
 * @param frame       of the box coordinates
 * @param rows        [components * count]; their blocks are set
 * @param components  rows a point: 3 or 1
 * @param report      optional
 * @retval SUPINE_ERROR_FORMAT     fewer points than the law has unknowns
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_fit(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, size_t components,
                                 const supine_patient_fit_options *options, supine_patient *patient,
                                 supine_patient_fit_report *report, supine_error *error);

#endif
