/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A law and the kriging of its residual, fitted together to rows (rows.h):
 *
 *     value = axis . (u(c) + motion + g) + noise
 *
 * The nine constants c have a normal prior about those of a known law, narrow to keep that law,
 * wide to find a new one. The fit takes the most likely c (generalised least squares,
 * Gauss-Newton with damping); g has the covariance in runtime/kriging.h, or a share of it. */
#ifndef SUPINE_PATIENT_KRIGE_H
#define SUPINE_PATIENT_KRIGE_H

#include "precompute/patient/rows.h"

typedef struct supine_patient_krige supine_patient_krige;

/* What is known before the fit. */
typedef struct supine_patient_krige_options {
  supine_patient_power mean; /* prior mean of the constants, and start of the search */
  double spread[3]; /* standard deviations: of lengths, relative; of exponents' logarithms; of
                       slopes; 0: known */
  bool shape_kept;  /* if g has its full covariance, fit only the size of the law */
  supine_patient_moved moved; /* which motion between the scans is fitted */
  double sill;                /* factor on the covariance of g; 0: no g; below 0: the most likely */
  double noise;               /* factor on the noise of the rows; below 0: the most likely */
} supine_patient_krige_options;

/* Give the options for a law whose size is known. `deep` keeps its shape, or varies all
 * constants by 30 % if g is smaller than in other patients; `paper` leaves all constants free. */
supine_patient_krige_options supine_patient_krige_prior(supine_patient_law law,
                                                        const supine_patient_power *mean,
                                                        supine_patient_moved moved);

/* Fit rows; rows of weight 0 are ignored.
 * @param rows  [count], must outlive the fit
 * @retval SUPINE_ERROR_NUMERICAL  the rows do not determine the law
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_krige_create(const supine_patient_krige_options *options,
                                          const supine_patient_row *rows, size_t count,
                                          supine_patient_krige **krige, supine_error *error);
void supine_patient_krige_destroy(supine_patient_krige *krige);

/* The fitted law, with the given or fitted sill and noise. */
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

/* Write law, correction and motion into a patient whose frame is set. */
void supine_patient_krige_take(const supine_patient_krige *krige, supine_patient *patient);

/* Compute the covariance of one axis between two centres, mm^2. */
double supine_patient_krige_covariance(const supine_patient_centre *a,
                                       const supine_patient_centre *b);

/* Fit the law alone, without g. */
supine_status supine_patient_law_fit(const supine_patient_krige_options *options,
                                     const supine_patient_row *rows, size_t count,
                                     supine_patient_power *law, supine_error *error);

#endif
