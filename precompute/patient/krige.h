/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Kriging of what a law leaves of rows (rows.h), each row one component of one point:
 *
 *     value = axis . (u (1 + b) + motion + g) + noise      b ~ N(0, 0.3^2)
 *
 * The covariance of g is that of points that are located (runtime/kriging.h); rows let a surface
 * give the component along its normal alone. */
#ifndef SUPINE_PATIENT_KRIGE_H
#define SUPINE_PATIENT_KRIGE_H

#include "precompute/patient/rows.h"

typedef struct supine_patient_krige supine_patient_krige;

typedef struct supine_patient_krige_options {
  supine_patient_moved moved; /* which motion is free */
  bool scale_known; /* all of the law was fitted: b is 0, and g's covariance the share of it, or
                       none, that makes the rows most likely */
  bool noise_known; /* the rows' noise as it is; else that of 0.25 to 2 times it which makes the
                       rows most likely */
} supine_patient_krige_options;

/* Compute the size |u| of the law's displacement, mm. */
double supine_patient_krige_size(double scale, const double u[3]);

/* Compute the covariance of one axis between two centres, mm^2. */
double supine_patient_krige_covariance(const supine_patient_centre *a,
                                       const supine_patient_centre *b);

/* Fit rows; those of weight 0 do not count.
 * @param law    with the motion that it was fitted with
 * @param rows   [count], kept by the caller for as long as the fit
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_krige_create(const supine_patient_power *law,
                                          const supine_patient_row *rows, size_t count,
                                          const supine_patient_krige_options *options,
                                          supine_patient_krige **krige, supine_error *error);
void supine_patient_krige_destroy(supine_patient_krige *krige);

/* The factor on the rows' noise. */
double supine_patient_krige_noise(const supine_patient_krige *krige);

/* Predict a row's value, mm.
 * @param variance  optional: of the prediction without noise, mm^2
 * @param scratch   [rows of the fit] */
double supine_patient_krige_predict(const supine_patient_krige *krige,
                                    const supine_patient_row *row, double *variance,
                                    double *scratch);

/* Move law, correction and motion into a patient, whose frame is there. */
void supine_patient_krige_take(const supine_patient_krige *krige, supine_patient *patient);

/* Select the rows that a correction is made of: every k-th of `single` rows, then of points with
 * three each, as many as a correction has centres. The number of rows. */
size_t supine_patient_krige_thin(const supine_patient_row *rows, size_t single, size_t triples,
                                 supine_patient_row *thinned);

#endif
