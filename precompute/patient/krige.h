/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measurements as rows: a landmark gives three, a point of a surface one, along the normal of the
 * other surface. A law and the kriging of its residual are fitted together to rows:
 *
 *     value = axis . (u(c) + motion + g) + noise
 *
 * The nine constants c have a normal prior about those of a known law, narrow to keep that law,
 * wide to find a new one. The fit takes the most likely c (generalised least squares,
 * Gauss-Newton with damping); g has the covariance in runtime/kriging.h, or a share of it. */
#ifndef SUPINE_PATIENT_KRIGE_H
#define SUPINE_PATIENT_KRIGE_H

#include <supine/status.h>

#include "precompute/patient/pairs.h"
#include "precompute/patient/patient.h"

/* --- measurements ---------------------------------------------------------------------------- */

typedef struct supine_patient_row {
  supine_patient_place place;
  double axis[3];
  double value;  /* mm */
  double weight; /* of the squared residual */
  double noise;  /* standard deviation, mm */
  size_t block;
} supine_patient_row;

/* Make three rows of each pair into rows [3 count]. */
void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows);

/* Assign each row to a block, a cube of 40 mm of a grid with random origin; return the number of
 * blocks. */
size_t supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, unsigned long seed);

/* The same, and assign blocks at random to folds: [count] the fold of each row. Return the number
 * of blocks; 0: no memory. */
size_t supine_patient_rows_fold(const supine_patient_frame *frame, supine_patient_row *rows,
                                size_t count, unsigned long seed, size_t *fold);

/* Folds of the held-out blocks. */
enum { SUPINE_PATIENT_FOLDS = 5 };

/* --- the law at a row ------------------------------------------------------------------------ */

/* Unknowns: c1, c3, c5; logarithms of c2, c4, c6; c7 to c9; translation; small rotation;
 * all of the law. */
enum { SUPINE_PATIENT_TERMS = 16 };

/* Compute the derivative of a row by each unknown, and return the law's residual, mm. */
double supine_patient_power_design(const supine_patient_power *law, const supine_patient_row *row,
                                   double x[SUPINE_PATIENT_TERMS]);

/* Compute the residual of a row, mm. */
double supine_patient_power_residual(const supine_patient_power *law,
                                     const supine_patient_row *row);

/* --- maps without a law ---------------------------------------------------------------------- */

enum { SUPINE_PATIENT_AFFINE = 12 };

/* Fit a translation or an affine map x -> t + M x, about the box's centre; 0 where the rows do not
 * determine it. */
void supine_patient_affine_fit(const supine_patient_row *rows, size_t count, bool translation,
                               double map[SUPINE_PATIENT_AFFINE]);

/* Compute a map's residual of a row, mm. */
double supine_patient_affine_residual(const double map[SUPINE_PATIENT_AFFINE],
                                      const supine_patient_row *row);

/* --- the fit --------------------------------------------------------------------------------- */

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
