/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a law, the motion between the scans and a correction of the residual to measured rows:
 *
 *     value = axis . (u(c) + motion + r) + noise
 *
 * A landmark gives three rows, one for each axis. A point of a surface gives one row, along the
 * normal of the other surface. u(c) is the displacement by the law with nine constants c. Their
 * prior is a normal distribution about the constants of a known law, narrow to keep that law or
 * wide to find a new one. The correction r is found by kriging; its covariance is a multiple of
 * that in runtime/kriging.h. The most likely c are found by generalised least squares (damped
 * Gauss-Newton). */
#ifndef SUPINE_PATIENT_KRIGE_H
#define SUPINE_PATIENT_KRIGE_H

#include <supine/status.h>

#include "precompute/patient/pairs.h"
#include "precompute/patient/patient.h"

/* One measured component of a displacement. */
typedef struct supine_patient_row {
  supine_patient_place place;
  double axis[3]; /* unit vector */
  double value;   /* displacement along the axis, mm */
  double weight;  /* factor on the squared residual */
  double noise;   /* standard deviation of the noise, mm */
  size_t block;   /* index of the block of rows that are held out together */
  /* [regions] spread force due to each region if its expandability is 1; NULL without regions */
  const double *response;
} supine_patient_row;

/* Make three rows of each pair of landmarks, into rows [3 pairs->count]. */
void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows);

/* Assign each row to a cube of 40 mm (a block) in a grid with a random origin. Return the number of
 * blocks, or 0 if out of memory. */
size_t supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, unsigned long seed);

/* The terms are the unknowns of the fit: c1, c3, c5; log c2, log c4, log c6; c7 to c9; translation;
 * small rotation; relative size of the law; and the expandabilities of regions, if they are
 * fitted. */
enum { SUPINE_PATIENT_TERMS = 16, SUPINE_PATIENT_REGIONS_MAX = 256 };

/* Compute the derivatives x of a row's predicted displacement with respect to the terms. Return the
 * displacement predicted by the law and the motion, minus the measured one, mm. */
double supine_patient_power_design(const supine_patient_power *law, const supine_patient_row *row,
                                   double x[SUPINE_PATIENT_TERMS]);

/* Options of the fit. If all are 0, the deep law and its correction are fitted, without motion. */
typedef struct supine_patient_fit_options {
  supine_patient_law law;
  supine_patient_scan_motion scan_motion;
  bool uncorrected;
  bool size_only;      /* fit only the size of the deep law and the motion */
  double gravity[3];   /* unit vector in the emptier state, or 0,0,0 for supine */
  double path_span[3]; /* difference between the two states' gains (supine_patient_deep) */
  double sill;  /* factor on the covariance of the correction, or 0 for the most likely one */
  double noise; /* factor on the noise of the rows, or 0 for the most likely factor */
  /* Number of regions with a fitted expandability a_k: force = sum over k of a_k response_k. */
  size_t region_count;
  const double *precision; /* [regions, regions] prior precision of expandability */
} supine_patient_fit_options;

typedef struct supine_patient_krige {
  const supine_patient_row *rows;
  size_t count;
  supine_patient_fit_options options;
  size_t terms;
  double region[SUPINE_PATIENT_REGIONS_MAX]; /* expandability of each region */
  double sill, noise; /* chosen factors on the covariance of the correction and on the noise */
  supine_patient_power mean; /* prior mean of the constants */
  supine_patient_power uncorrected_law;
  supine_patient_power law;
  double scaled_sill;            /* sill, multiplied to match the fitted size of the law */
  supine_patient_centre *centre; /* [count] kernel of each row; its weight is in `weight` */
  double *factor;  /* [count, count] Cholesky factor of the rows' covariance, or NULL */
  double *design;  /* [count, terms + 1] derivatives and residual of each row, whitened */
  double *weight;  /* [count] weight of each row's kernel */
  double *scratch; /* [count] */
  double *normal;  /* [2, terms, terms] normal matrix (after the fit, its factor) and work space */
  double squares;  /* whitened squared residual plus squared deviation from the prior */
  /* Right-hand side of the normal equations. */
  double right_side[SUPINE_PATIENT_TERMS + SUPINE_PATIENT_REGIONS_MAX];
} supine_patient_krige;

/* Fit the size of the deep law, which becomes the prior mean. Then fit the law and its correction.
 * SUPINE_PATIENT_DEEP changes only the size of the deep law if the sill is at least 1; otherwise
 * the prior standard deviation of the constants is 30 %. SUPINE_PATIENT_PAPER has a wide prior.
 * Rows of weight 0 do not count.
 * @param rows   [count], must outlive the fit
 * @param krige  release with supine_patient_krige_free, also after a failure
 * @retval SUPINE_ERROR_NUMERICAL  the rows do not determine the law
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_krige_fit(const supine_patient_fit_options *options,
                                       const supine_patient_row *rows, size_t count,
                                       supine_patient_krige *krige, supine_error *error);
void supine_patient_krige_free(supine_patient_krige *krige);

/* Compute the share [regions] of each region's expandability that the rows, not the prior,
 * determine: the diagonal of the resolution matrix 1 - normal^-1 precision. */
void supine_patient_krige_resolution(const supine_patient_krige *krige, double *share);

/* Compute the standard errors of c1 to c9; 0 for constants that are not fitted. */
void supine_patient_krige_errors(const supine_patient_krige *krige,
                                 double error[SUPINE_PATIENT_CONSTANTS]);

/* Predict a row's value, mm. Not thread-safe: it overwrites the scratch space.
 * @param variance  written: variance of the prediction without noise, mm^2 */
double supine_patient_krige_predict(supine_patient_krige *krige, const supine_patient_row *row,
                                    double *variance);

/* Copy the law, the correction and the motion into a patient. */
void supine_patient_krige_copy_law(const supine_patient_krige *krige, supine_patient *patient);

/** Predictions of the displacement: three baselines, the law, and the law with its correction. */
typedef enum supine_patient_score {
  SUPINE_PATIENT_SCORE_NONE,
  SUPINE_PATIENT_SCORE_TRANSLATION,
  SUPINE_PATIENT_SCORE_AFFINE,
  SUPINE_PATIENT_SCORE_LAW,
  SUPINE_PATIENT_SCORE_CORRECTED,
  SUPINE_PATIENT_SCORES
} supine_patient_score;

/** Result of a fit; errors are RMS, in mm. */
typedef struct supine_patient_fit_report {
  double points;                          /**< number of landmarks or points of a surface */
  double blocks;                          /**< number of blocks of 40 mm that contain points */
  double fitted[SUPINE_PATIENT_SCORES];   /**< error at the fitted points */
  double held_out[SUPINE_PATIENT_SCORES]; /**< error at held-out points */
  /** Held-out error of a translation if the scans moved, otherwise of no displacement. */
  double baseline;
  double band;           /**< share of the held-out points within the 95 % band, % */
  double explained;      /**< share of the squared held-out displacement that the law explains, % */
  double expected_point; /**< expected error of a point, in three dimensions */
  double expected_constant;               /**< expected_point^2 / mean displacement, mm */
  double error[SUPINE_PATIENT_CONSTANTS]; /**< standard errors of c1 to c9 */
} supine_patient_fit_report;

/** Fit a law and its correction to rows, and measure its error on held-out blocks of 40 mm.
 * @param rows     [single + 3 triples]; `block` of each is written
 * @param single   number of points on surfaces, one row each; these rows come first
 * @param triples  number of landmarks, three rows each
 * @param patient  in: the frame of the rows; out: the law and its correction
 * @retval SUPINE_ERROR_FORMAT     fewer points than the law has unknowns
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_fit(const supine_patient_fit_options *options,
                                 supine_patient_row *rows, size_t single, size_t triples,
                                 supine_patient *patient, supine_patient_fit_report *report,
                                 supine_error *error);

#endif
