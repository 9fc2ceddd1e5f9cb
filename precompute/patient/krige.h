/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit measured displacements by a displacement law, the motion of the body between two scans, and a
 * correction r of the residual. Each row is one component, measured along the unit vector `axis`:
 *
 *     value = axis . (u(c) + motion + r) + noise
 *
 * A landmark gives three rows, one for each axis. A point of a surface gives one row, along the
 * normal of the other surface. u(c) is the displacement by the law with nine constants c
 * (patient.h). The prior of c is a normal distribution about the constants of the default law
 * (deep); it is narrow to keep that law, or wide to find a new one. The correction r is found by
 * kriging; its covariance is a multiple of the covariance in runtime/kriging.h. The most likely c
 * are found by generalised least squares (damped Gauss-Newton). */
#ifndef SUPINE_PATIENT_KRIGE_H
#define SUPINE_PATIENT_KRIGE_H

#include <supine/status.h>

#include "precompute/patient/pairs.h"
#include "precompute/patient/patient.h"

/* One measured component of a displacement. */
typedef struct supine_patient_row {
  supine_patient_place place;
  double axis[3]; /* unit vector */
  double value;   /* measured displacement along `axis`, mm */
  double weight;  /* factor on the squared residual */
  double noise;   /* standard deviation of `value`, mm */
  size_t block;   /* index of the block of rows that are held out together */
  /* [regions] force that each region of expandability 1 causes at the row's vertex; may be NULL */
  const double *response;
} supine_patient_row;

/* Write three rows for each pair of points, one for each axis, into rows [3 pairs->count]. */
void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows);

/* Assign each row to a block: a cube of 40 mm in a grid with a random origin. Return the number of
 * blocks, or 0 if out of memory. */
size_t supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, unsigned long seed);

/* The unknown terms of a fit are, in order: c1, c3, c5; log c2, log c4, log c6; c7, c8, c9;
 * translation [3]; small rotation [3]; and a factor on the whole displacement law. If the
 * expandabilities of regions are fitted, they follow as further terms. */
enum { SUPINE_PATIENT_TERMS = 16, SUPINE_PATIENT_REGIONS_MAX = 256 };

/* Compute the derivatives x of the predicted displacement (law plus motion) along the row's axis
 * with respect to the 16 unknowns. Return the predicted minus the measured displacement, mm. */
double supine_patient_power_design(const supine_patient_power *law, const supine_patient_row *row,
                                   double x[SUPINE_PATIENT_TERMS]);

/* Options of the fit. If all are 0, the default law (deep) and a correction are fitted. */
typedef struct supine_patient_fit_options {
  supine_patient_law law;
  supine_patient_scan_motion scan_motion;
  bool uncorrected;
  bool size_only;      /* fit only the motion and one factor on the default law (deep) */
  double gravity[3];   /* direction of gravity in the emptier state; 0,0,0 counts as supine */
  double path_span[3]; /* gains of the emptier minus those of the fuller state */
  double sill;         /* factor on the covariance of the correction; 0 to choose the most likely */
  double noise;        /* factor on the noise of every row; 0 to choose the most likely */
  size_t region_count; /* number of regions whose expandability is fitted, or 0 */
  const double *precision; /* [region_count, region_count] prior precision of the expandabilities */
} supine_patient_fit_options;

typedef struct supine_patient_krige {
  const supine_patient_row *rows;
  size_t count;
  supine_patient_fit_options options;
  size_t terms;
  double region[SUPINE_PATIENT_REGIONS_MAX]; /* expandability of each region */
  double sill, noise;        /* factors on the covariance of the correction and on the noise */
  supine_patient_power mean; /* prior mean of the constants */
  supine_patient_power uncorrected_law;
  supine_patient_power law;
  double scaled_sill;            /* sill, or sill / factor if only a factor on the law is fitted */
  supine_patient_centre *centre; /* [count] kernel of each row; the kernel's weight is not set */
  double *factor;  /* [count, count] Cholesky factor of the rows' covariance, or NULL */
  double *design;  /* [count, terms + 1] derivatives and residual of each row, whitened */
  double *weight;  /* [count] weight of each row's kernel */
  double *scratch; /* [count] */
  double *normal;  /* [0] normal matrix, or after the fit its Cholesky factor; [1] work space */
  double squares;  /* whitened squared residuals plus squared deviations from the prior */
  double right_side[SUPINE_PATIENT_TERMS + SUPINE_PATIENT_REGIONS_MAX];
} supine_patient_krige;

/* Fit one factor on the default law (deep); the scaled law becomes the prior mean. Then fit the law
 * and its correction. With SUPINE_PATIENT_DEEP and a sill of at least 1, the second fit changes the
 * law only by another factor. With a smaller sill, it fits all nine constants, whose prior standard
 * deviations are about 30 %. SUPINE_PATIENT_PAPER has a wider prior. Rows of weight 0 do not count.
 * @param rows   [count], must outlive the fit
 * @param krige  release with supine_patient_krige_free, also after a failure
 * @retval SUPINE_ERROR_NUMERICAL  the rows do not determine the displacement law
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_krige_fit(const supine_patient_fit_options *options,
                                       const supine_patient_row *rows, size_t count,
                                       supine_patient_krige *krige, supine_error *error);
void supine_patient_krige_free(supine_patient_krige *krige);

/* Compute the share [region_count] of each region's expandability that the rows, not the prior,
 * determine: the diagonal of the resolution matrix. */
void supine_patient_krige_resolution(const supine_patient_krige *krige, double *share);

/* Compute the standard errors of the constants c1 to c9; 0 for constants that are not fitted. */
void supine_patient_krige_errors(const supine_patient_krige *krige,
                                 double error[SUPINE_PATIENT_CONSTANTS]);

/* Predict the displacement along the row's axis, mm. Not thread-safe: overwrites krige->scratch.
 * @param variance  written: variance of the prediction, without measurement noise, mm^2 */
double supine_patient_krige_predict(supine_patient_krige *krige, const supine_patient_row *row,
                                    double *variance);
void supine_patient_krige_copy_law(const supine_patient_krige *krige, supine_patient *patient);

/** Predictors of a displacement: three baselines, a law, and the law with its correction. */
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
  double points;                          /**< number of landmarks, or of matched vertices */
  double blocks;                          /**< number of cubes of 40 mm that contain points */
  double fitted[SUPINE_PATIENT_SCORES];   /**< errors of the predictors at fitted points */
  double held_out[SUPINE_PATIENT_SCORES]; /**< errors of the predictors at held-out points */
  /** Held-out error of predicting a translation or, without a fitted motion, no displacement. */
  double baseline;
  double band;              /**< share of the held-out points within the 95 % band, % */
  double explained;         /**< 100 (1 - (held-out error of the corrected law / baseline)^2), % */
  double expected_point;    /**< expected error of a point in 3-D, mm */
  double expected_constant; /**< expected_point^2 / mean displacement, mm */
  double error[SUPINE_PATIENT_CONSTANTS]; /**< standard errors of c1 to c9 */
} supine_patient_fit_report;

/** Fit a displacement law and its correction to rows, and measure the error of the prediction on
 * held-out blocks of 40 mm.
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
