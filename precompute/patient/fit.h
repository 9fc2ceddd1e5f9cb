/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * From landmarks or surfaces to a patient's law, with what it is worth on held-out blocks. */
#ifndef SUPINE_PATIENT_FIT_H
#define SUPINE_PATIENT_FIT_H

#include "precompute/patient/patient.h"
#include "precompute/patient/rows.h"

/** Held-out blocks: folds, and seeds that the grid of blocks is placed with. */
enum { SUPINE_PATIENT_FOLDS = 5, SUPINE_PATIENT_SEEDS = 3 };

/** Zero-initialised: the deep law, corrected, no motion between the scans. */
typedef struct supine_patient_fit_options {
  supine_patient_law law;
  supine_patient_moved moved;
  bool uncorrected;  /**< leave the correction out */
  double gravity[3]; /**< of the emptier state; all 0: supine */
  double way[3];     /**< between the states, as supine_patient_deep has it; all 0: 1 */
} supine_patient_fit_options;

/** Held-out or fitted errors, mm RMS, of a law and of what it is to be better than. */
typedef struct supine_patient_scores {
  double none, translation, affine;
  double law;       /**< without its correction */
  double corrected; /**< with it */
} supine_patient_scores;

typedef struct supine_patient_fit_report {
  size_t count;      /**< landmarks, or points of a surface */
  size_t blocks;     /**< cubes that they fall into */
  size_t components; /**< measured at each: 3 of landmarks alone, else 1 */
  supine_patient_scores fitted;
  supine_patient_scores held_out; /**< on blocks that the fit had not seen */
  double band;                    /**< share of held-out points within the 95 % band */
  double
      expected; /**< mm RMS, expected of held-out points (of a component, where one is measured) */
  double explained;        /**< share of the squared displacement, held out */
  double explained_fitted; /**< the same, of what was fitted */
  double expected_point;   /**< mm RMS, expected of points of the surface in all three directions */
  double moved;            /**< their mean displacement, mm */
  double error[SUPINE_PATIENT_CONSTANTS]; /**< standard errors of c1 to c9 */
} supine_patient_fit_report;

/** The deep law in the form of nine constants, for gravity along a unit vector (all 0: supine), its
 * lengths as far as the way between two states is of that from full inflation to rest along x, y
 * and z (all 0: 1). */
supine_patient_power supine_patient_deep(const double gravity[3], const double way[3]);

/** Fit a law and its correction to rows, and hold blocks of 40 mm out.
 * @param frame    of the box coordinates
 * @param rows     [single + 3 triples]; their blocks are set
 * @param single   points of which one component is known, first among the rows
 * @param triples  landmarks
 * @param report   optional
 * @retval SUPINE_ERROR_FORMAT     fewer points than the law has unknowns
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_fit(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t single, size_t triples,
                                 const supine_patient_fit_options *options, supine_patient *patient,
                                 supine_patient_fit_report *report, supine_error *error);

#endif
