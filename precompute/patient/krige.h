/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit measured displacements by a displacement law, the motion of the body between two scans, and a
 * correction r of the residual. A measurement (supine_patient_row) is the component `value` of one
 * displacement along a unit vector `axis`:
 *
 *     value = axis . (u(c) + motion + r) + noise
 *
 * u(c) is the displacement by the law with nine constants c (patient.h). A landmark gives three
 * measurements, along x, y and z. A vertex of a surface gives one, along the normal of the surface
 * that it is matched to. The prior of c is a normal distribution about the constants of the default
 * displacement law; it is narrow to stay close to that law, or wide to find a new one. The
 * correction r is found by kriging; its covariance is a multiple of that in runtime/kriging.h. The
 * most likely c are found by generalised least squares (damped Gauss-Newton). */
#ifndef SUPINE_PATIENT_KRIGE_H
#define SUPINE_PATIENT_KRIGE_H

#include "base/arena.h"
#include "precompute/patient/pairs.h"
#include "precompute/patient/patient.h"

/* One measured component of a displacement. */
typedef struct supine_patient_row {
  supine_patient_place place;
  double axis[3];  /* unit vector along which the displacement was measured */
  double value;    /* measured displacement along `axis`, mm */
  double weight;   /* factor on the squared residual of this measurement */
  double noise;    /* standard deviation of `value`, mm */
  size_t block;    /* index of the 40 mm cube whose measurements are held out together */
  size_t landmark; /* index of the landmark, plus 1; 0 for a vertex of a surface */
} supine_patient_row;

/* Write into rows, for each pair of points, its displacement along x, y and z. */
void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows);

/* Set the `block` of each measurement: the index of the cube of 40 mm that contains its point,
 * in a grid with a random origin. Write the number of cubes into `blocks`. */
supine_status supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                        size_t count, unsigned long seed, size_t *blocks,
                                        supine_error *error);

/* Index of the first of the unknowns of each kind in a fit (constants c1 to c9: patient.h). */
enum {
  SUPINE_PATIENT_BY_SIZE = 0,        /* [3] c1, c3, c5 */
  SUPINE_PATIENT_BY_EXPONENT = 3,    /* [3] log c2, log c4, log c6 */
  SUPINE_PATIENT_BY_SLOPE = 6,       /* [3] c7, c8, c9 */
  SUPINE_PATIENT_BY_TRANSLATION = 9, /* [3] translation of the body */
  SUPINE_PATIENT_BY_ROTATION = 12,   /* [3] small rotation of the body */
  SUPINE_PATIENT_BY_SCALE = 15,      /* factor on the whole displacement law */
  SUPINE_PATIENT_TERMS
};

/* Predict a measurement by the displacement law and the motion of the body. Return the prediction
 * minus the measured value, mm. Write its derivatives with respect to the constants of the law, the
 * motion, and a factor on the law into x. */
double supine_patient_power_design(const supine_patient_power *law, const supine_patient_row *row,
                                   double x[SUPINE_PATIENT_TERMS]);

/* Options of supine_patient_krige_fit. If all are 0, it fits a displacement law close to the
 * default one, and a correction of the remaining errors by kriging. */
typedef struct supine_patient_fit_options {
  supine_patient_law law;
  supine_patient_scan_motion scan_motion;
  bool uncorrected;
  bool size_only;    /* fit only the motion of the body and one scale factor of the default law */
  double gravity[3]; /* direction of gravity in the emptier state; 0,0,0 counts as supine */
  /* [axis] share of the displacement from full inflation to rest that lies between the scans */
  double path_span[3];
  double sill;  /* factor on the covariance of the kriging correction; 0: find it by likelihood */
  double noise; /* factor on the noise of every measurement; 0: find it by likelihood */
} supine_patient_fit_options;

typedef struct supine_patient_krige {
  const supine_patient_row *rows; /* [count] measurements */
  size_t count;
  supine_patient_fit_options options;
  double sill, noise; /* factors on the covariance of the kriging correction, and on the noise */
  supine_patient_power mean; /* prior mean of the displacement law's constants */
  supine_patient_power uncorrected_law;
  supine_patient_power law;
  double scaled_sill; /* `sill`; if the fit only scales the law, divided by the fitted factor */
  supine_patient_centre *centre; /* [count] points of the measurements; `weight` is not used */
  double *cholesky; /* [count, count] Cholesky factor of the measurements' covariance, or NULL */
  double *design;   /* [count, terms + 1] derivatives and residual of each measurement, whitened */
  double *kernel_weight; /* [count] weight of each measurement in a prediction */
  double *normal_matrix; /* [2, terms, terms] normal matrix, after the fit its Cholesky factor; then
                            work space */
  supine_arena arena;    /* holds the arrays above */
  double objective;      /* squared whitened residuals plus squared deviations from the prior */
  double right_side[SUPINE_PATIENT_TERMS];
} supine_patient_krige;

/* Fit a displacement law (patient.h) and its kriging correction in two steps:
 * - Multiply the default displacement law by a fitted factor, to get the prior mean of step two.
 * - Fit law and correction. With SUPINE_PATIENT_PAPER, all nine constants of the law have a wide
 *   prior. With SUPINE_PATIENT_DEEP, their prior standard deviations are about 30 %; but if the
 *   factor `sill` on the correction's covariance is at least 1, the law is only scaled again.
 * @param rows   [count] measurements; those of weight 0 do not count; must outlive the fit
 * @param krige  release with supine_patient_krige_free, also after a failure */
supine_status supine_patient_krige_fit(const supine_patient_fit_options *options,
                                       const supine_patient_row *rows, size_t count,
                                       supine_patient_krige *krige, supine_error *error);
void supine_patient_krige_free(supine_patient_krige *krige);

/* Compute standard errors of the displacement law's constants c1 to c9; 0 for those not fitted. */
void supine_patient_krige_errors(const supine_patient_krige *krige,
                                 double error[SUPINE_PATIENT_CONSTANTS]);

/* Set the law and the correction of a patient to those that were fitted. */
void supine_patient_krige_copy_law(const supine_patient_krige *krige, supine_patient *patient);

/** Predictors of a displacement, whose errors are compared: no displacement, a translation, an
 * affine map, the fitted formula of patient.h (LAW), and this formula with a kriging correction. */
typedef enum supine_patient_score {
  SUPINE_PATIENT_SCORE_NONE,
  SUPINE_PATIENT_SCORE_TRANSLATION,
  SUPINE_PATIENT_SCORE_AFFINE,
  SUPINE_PATIENT_SCORE_LAW,
  SUPINE_PATIENT_SCORE_CORRECTED,
  SUPINE_PATIENT_SCORES
} supine_patient_score;

/** Result of a fit; errors are RMS distances, in mm. If there are landmarks, they are those of
 * landmarks; otherwise, of vertices along the normals of the other surface. Scores predict the
 * emptier scan. */
typedef struct supine_patient_fit_report {
  size_t points; /**< number of landmarks or, without landmarks, of matched vertices */
  size_t blocks; /**< number of cubes of 40 mm with points */
  double fitted[SUPINE_PATIENT_SCORES];   /**< RMS error of each predictor at fitted points, mm */
  double held_out[SUPINE_PATIENT_SCORES]; /**< the same residuals at held-out points, mm */
  /** RMS error at held-out points, mm, of a translation, or of no displacement if no motion of the
   * body is fitted. */
  double baseline;
  bool has_band;    /**< whether there are landmarks, and therefore a `band` */
  double band;      /**< share of the held-out landmarks with an error below its 95 % bound, % */
  double explained; /**< percentage by which the law with its kriging correction reduces the squared
                       `baseline` */
  /** Errors at held-out landmarks that are moved back to the fuller scan, divided by those where
   * the emptier scan is predicted: there, tissue and errors are compressed. Without landmarks, the
   * cube root of the ratio of the volumes. */
  double stretch;
  double expected_point;    /**< expected error of a point predicted in the fuller scan, mm */
  double expected_constant; /**< expected squared error there, mm^2, per mm of displacement */
  /** Mean share of the error's variance that the other landmarks left at held-out ones, 0 without
   * a correction by landmarks (supine_patient_shares). */
  double expected_share;
  double expected_from; /**< RMS displacement, mm, below which this constant falls in proportion */
  bool has_errors;      /**< whether any of c1 to c9 was fitted, and therefore has an `error` */
  double error[SUPINE_PATIENT_CONSTANTS]; /**< standard errors of c1 to c9 (patient.h) */
} supine_patient_fit_report;

/** Fit a displacement law and its kriging correction to measurements. Measure the error of the
 * prediction by cross-validation, which holds out cubes of 40 mm.
 * @param rows     [single + 3 triples] measurements; the index of their cube, `block`, is written
 * @param single   number of vertices, each with one measurement; these measurements come first
 * @param triples  number of landmarks, each with three measurements
 * @param patient  in: `frame`, the bounding box of the lungs; out: the law and its correction */
supine_status supine_patient_fit(const supine_patient_fit_options *options,
                                 supine_patient_row *rows, size_t single, size_t triples,
                                 supine_patient *patient, supine_patient_fit_report *report,
                                 supine_error *error);

#endif
