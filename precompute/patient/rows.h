/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measurements as rows: axis . (u + motion) = value. A landmark gives three rows, a point of a
 * surface one, along the normal of the other surface. And fits of the laws to rows. */
#ifndef SUPINE_PATIENT_ROWS_H
#define SUPINE_PATIENT_ROWS_H

#include "precompute/patient/patient.h"

typedef struct supine_patient_row {
  supine_patient_place place;
  double force[4]; /* spread force 1, X - 1/2, Y - 1/2, Z - 1/2 at the point */
  double axis[3];
  double value;  /* mm */
  double weight; /* of the squared residual */
  double noise;  /* standard deviation, mm */
  size_t block;
} supine_patient_row;

/* Which motion between the scans is fitted with the law. */
typedef enum supine_patient_moved {
  SUPINE_PATIENT_STILL = 0,
  SUPINE_PATIENT_TRANSLATION,
  SUPINE_PATIENT_RIGID
} supine_patient_moved;

/* Make three rows of each pair into rows [3 count]. */
void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows);

/* Compute u of a row's point, mm: the law under the row's force, and the correction. */
void supine_patient_row_displacement(const supine_patient *patient, const supine_patient_row *row,
                                     double u[3]);

/* Assign each row to a block, a cube of 40 mm of a grid with random origin; return the number of
 * blocks. */
size_t supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, unsigned long seed);

/* Assign blocks at random to folds, [blocks].
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_rows_deal(size_t blocks, size_t folds, unsigned long seed,
                                       size_t *fold_of);

/* --- the law --------------------------------------------------------------------------------- */

/* Unknowns: c1, c3, c5; logarithms of c2, c4, c6; c7 to c9; translation; small rotation;
 * all of the law. */
enum { SUPINE_PATIENT_TERMS = 16 };

typedef struct supine_patient_power {
  double powers[SUPINE_PATIENT_POWERS];
  double linear[9]; /* c1, c3, c5 in mm; translation in mm; small rotation in rad */
} supine_patient_power;

/* Bounds of c2, c4, c6 and of c7, c8, c9. */
extern const double supine_patient_exponent_least, supine_patient_exponent_most,
    supine_patient_slope_most;

/* Compute the derivative of a row by each unknown, and return the law's residual, mm. */
double supine_patient_power_design(const supine_patient_power *law, const supine_patient_row *row,
                                   double x[SUPINE_PATIENT_TERMS]);

/* Write a law and the motion into a patient, without a correction. */
void supine_patient_take(const supine_patient_power *law, supine_patient *patient);

/* Compute the residual of a row, mm. */
double supine_patient_power_residual(const supine_patient_power *fit,
                                     const supine_patient_row *row);

/* Compute the displacement of a row's point along its axis for a force of 1, mm. */
double supine_patient_power_along(const supine_patient_power *fit, const supine_patient_row *row);

/* Compute the law's displacement at a row's point, mm, without the motion. */
void supine_patient_power_displacement(const supine_patient_power *fit,
                                       const supine_patient_row *row, double u[3]);

/* Fit the length and the motion of a law whose exponents, slopes and ratios of lengths are known,
 * `shape` in mm, by least squares.
 * @retval SUPINE_ERROR_NUMERICAL  the rows do not determine them */
supine_status supine_patient_scale_fit(const supine_patient_row *rows, size_t count,
                                       supine_patient_moved moved,
                                       const supine_patient_power *shape, supine_patient_power *fit,
                                       supine_error *error);

/* --- maps without a law ---------------------------------------------------------------------- */

enum { SUPINE_PATIENT_AFFINE = 12 };

/* Fit a translation or an affine map x -> t + M x, about the box's centre, to the rows whose
 * fold_of is not `without` (NULL: all rows).
 * @return false if the rows do not determine it */
bool supine_patient_affine_fit(const supine_patient_row *rows, size_t count, const size_t *fold_of,
                               size_t without, bool translation, double map[SUPINE_PATIENT_AFFINE]);

/* Compute a map's residual of a row, mm. */
double supine_patient_affine_residual(const double map[SUPINE_PATIENT_AFFINE],
                                      const supine_patient_row *row);

#endif
