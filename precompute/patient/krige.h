/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A law and the kriging of what it leaves, fitted to rows (rows.h) together:
 *
 *     value = axis . (u(c) + motion + g) + noise
 *
 * The nine constants c have a normal prior about those of a known law: narrow where that law is to
 * be kept, wide where it is to be found. They are the most likely ones (generalised least squares,
 * Gauss-Newton with damping); g has the covariance of points that are located (runtime/kriging.h),
 * or a share of it. */
#ifndef SUPINE_PATIENT_KRIGE_H
#define SUPINE_PATIENT_KRIGE_H

#include "precompute/patient/rows.h"

typedef struct supine_patient_krige supine_patient_krige;

/* What is known beforehand. */
typedef struct supine_patient_krige_options {
  supine_patient_power mean; /* of the constants, and where their search begins */
  double spread[3]; /* standard deviations: of lengths, relative; of exponents' logarithms; of
                       slopes; 0: known */
  bool shape_kept;  /* where g has all of its covariance the law's size alone is found */
  supine_patient_moved moved; /* which motion is free */
  double sill; /* share of g's covariance, 0: no g; below 0: whichever makes the rows most likely */
  double noise; /* factor on the rows' noise; below 0: the most likely */
} supine_patient_krige_options;

/* The options of a law whose size is known. Of `deep` the shape is kept, or, where the rows leave
 * less to g than people's do, all constants within 30 %; of `paper` they are free. */
supine_patient_krige_options supine_patient_krige_prior(supine_patient_law law,
                                                        const supine_patient_power *mean,
                                                        supine_patient_moved moved);

/* Fit rows; those of weight 0 do not count.
 * @param rows  [count], kept by the caller for as long as the fit
 * @retval SUPINE_ERROR_NUMERICAL  the rows do not determine the law
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_krige_create(const supine_patient_krige_options *options,
                                          const supine_patient_row *rows, size_t count,
                                          supine_patient_krige **krige, supine_error *error);
void supine_patient_krige_destroy(supine_patient_krige *krige);

/* The law, and its sill and noise as they were given or found. */
const supine_patient_power *supine_patient_krige_law(const supine_patient_krige *krige);
double supine_patient_krige_sill(const supine_patient_krige *krige);
double supine_patient_krige_noise(const supine_patient_krige *krige);

/* Compute the standard errors of c1 to c9. */
void supine_patient_krige_errors(const supine_patient_krige *krige,
                                 double error[SUPINE_PATIENT_CONSTANTS]);

/* Predict a row's value, mm.
 * @param variance  of the prediction without noise, mm^2
 * @param scratch   [rows of the fit] */
double supine_patient_krige_predict(const supine_patient_krige *krige,
                                    const supine_patient_row *row, double *variance,
                                    double *scratch);

/* Move law, correction and motion into a patient, whose frame is there. */
void supine_patient_krige_take(const supine_patient_krige *krige, supine_patient *patient);

/* Compute the covariance of one axis between two centres, mm^2. */
double supine_patient_krige_covariance(const supine_patient_centre *a,
                                       const supine_patient_centre *b);

/* Fit the law alone, without g. */
supine_status supine_patient_law_fit(const supine_patient_krige_options *options,
                                     const supine_patient_row *rows, size_t count,
                                     supine_patient_power *law, supine_error *error);

#endif
