/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What was measured, as rows: axis . (u + motion) = value. A landmark gives three, a point of a
 * surface one, along the normal of the other surface. And the laws' fits to rows. */
#ifndef SUPINE_PATIENT_ROWS_H
#define SUPINE_PATIENT_ROWS_H

#include "precompute/patient/patient.h"

typedef struct supine_patient_row {
  supine_patient_place place;
  double force[4]; /* what the force 1, X - 1/2, Y - 1/2, Z - 1/2 comes to here */
  double axis[3];
  double value;  /* mm */
  double weight; /* of its square */
  double noise;  /* standard deviation, mm */
  size_t block;
} supine_patient_row;

/* Which motion between the scans is to be found with the law. */
typedef enum supine_patient_moved {
  SUPINE_PATIENT_STILL = 0,
  SUPINE_PATIENT_TRANSLATION,
  SUPINE_PATIENT_RIGID
} supine_patient_moved;

/* Three rows a pair into rows [3 count]. */
void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows);

/* Gives each row its block, a cube of 40 mm, the grid's origin drawn from the seed; the number of
 * blocks. */
size_t supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, unsigned long seed);

/* Deals blocks at random to so many folds, [blocks].
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_rows_deal(size_t blocks, size_t folds, unsigned long seed,
                                       size_t *fold_of);

/* --- the paper's law ------------------------------------------------------------------------- */

typedef struct supine_patient_power {
  double powers[SUPINE_PATIENT_POWERS];
  double linear[9]; /* c1, c3, c5 in mm; translation in mm; small rotation in rad */
  double squares;   /* what is left, weighted, mm^2 */
  double pulled;    /* what holds down powers that the rows leave open has come to, mm^2 */
  bool at_bound[SUPINE_PATIENT_POWERS];
} supine_patient_power;

/* The six starts. */
extern const double supine_patient_starts[SUPINE_PATIENT_STARTS][SUPINE_PATIENT_POWERS];

/* Variable projection: what is linear is solved for at each step of the rest (GSL's
 * multifit_nlinear, Levenberg-Marquardt).
 * @param powers     where to start
 * @param steps      at most
 * @param tolerance  of the unknowns' relative change in a step
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_power_fit(const supine_patient_row *rows, size_t count,
                                       supine_patient_moved moved,
                                       const double powers[SUPINE_PATIENT_POWERS], size_t steps,
                                       double tolerance, supine_patient_power *fit,
                                       supine_error *error);

/* What a fit leaves of a row, mm. */
double supine_patient_power_residual(const supine_patient_power *fit,
                                     const supine_patient_row *row);

/* How far a force of 1 moves a row's point along its axis, mm. */
double supine_patient_power_along(const supine_patient_power *fit, const supine_patient_row *row);

/* The law's displacement at a row's point, mm, without the motion. */
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

/* Fit a translation or an affine map x -> t + M x, about the box's centre, to the rows of which
 * fold_of is not `without` (NULL: all).
 * @return false where the rows do not determine it */
bool supine_patient_affine_fit(const supine_patient_row *rows, size_t count, const size_t *fold_of,
                               size_t without, bool translation, double map[SUPINE_PATIENT_AFFINE]);

/* What a map leaves of a row, mm. */
double supine_patient_affine_residual(const double map[SUPINE_PATIENT_AFFINE],
                                      const supine_patient_row *row);

#endif
