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

/* Zero-initialised: the deep law, corrected, no motion between the scans. */
typedef struct supine_patient_fit_options {
  supine_patient_law law;
  supine_patient_moved moved;
  bool uncorrected;  /* leave g out */
  double gravity[3]; /* of the emptier state; all 0: supine */
  double way[3];     /* share of full inflation to rest between the states, by axis
                      * (supine_patient_deep); all 0: 1 */
  double sill;       /* factor on the covariance of g; 0: the most likely one */
  double noise;      /* factor on the noise of the rows; 0: the most likely one */
} supine_patient_fit_options;

/* A fit. */
typedef struct supine_patient_krige {
  const supine_patient_row *rows;
  size_t count;
  supine_patient_law kind;
  supine_patient_moved moved;
  bool size_only;             /* the law's size and the motion alone are unknown */
  double sill, noise;         /* factors in use; a sill of 0: no g */
  supine_patient_power mean;  /* prior mean of the constants */
  supine_patient_power alone; /* the law fitted without g */
  supine_patient_power law;
  double scaled_sill;            /* factor on the covariance of g, for a law of size 1 */
  supine_patient_centre *centre; /* [count] of each row, with weight 0 */
  double *factor;                /* [count, count] Cholesky factor of the covariance, if g */
  double *design;                /* [count, TERMS + 1] whitened derivatives and residual */
  double *weight;                /* [count] */
  double *scratch;               /* [count] */
  double normal[SUPINE_PATIENT_TERMS * SUPINE_PATIENT_TERMS]; /* of the terms, Cholesky-factored */
  double right[SUPINE_PATIENT_TERMS];
  double squares; /* squared whitened residual, with the prior's */
} supine_patient_krige;

/* Fit the size of the deep law, which is the prior's mean, then the law and g. Where g is smaller
 * than in other patients, `deep` varies all constants by 30 %; `paper` leaves them free. Rows of
 * weight 0 are ignored.
 * @param rows   [count], must outlive the fit
 * @param krige  freed with supine_patient_krige_free, after a failure too
 * @retval SUPINE_ERROR_NUMERICAL  the rows do not determine the law
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_krige_fit(const supine_patient_fit_options *options,
                                       const supine_patient_row *rows, size_t count,
                                       supine_patient_krige *krige, supine_error *error);
void supine_patient_krige_free(supine_patient_krige *krige);

/* Compute the standard errors of c1 to c9. */
void supine_patient_krige_errors(const supine_patient_krige *krige,
                                 double error[SUPINE_PATIENT_CONSTANTS]);

/* Predict a row's value, mm.
 * @param variance  of the prediction without noise, mm^2 */
double supine_patient_krige_predict(supine_patient_krige *krige, const supine_patient_row *row,
                                    double *variance);

/* Write law, correction and motion into a patient whose frame is set. */
void supine_patient_krige_take(const supine_patient_krige *krige, supine_patient *patient);

/* Fit a law without g.
 * @param mean  prior mean of the constants; NULL: fit only the size of the deep law */
supine_status supine_patient_law_fit(const supine_patient_fit_options *options,
                                     const supine_patient_power *mean,
                                     const supine_patient_row *rows, size_t count,
                                     supine_patient_power *law, supine_error *error);

#endif
