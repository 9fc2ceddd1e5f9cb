/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measurements as rows: axis . (u + motion) = value. A landmark gives three rows, a point of a
 * surface one, along the normal of the other surface. */
#ifndef SUPINE_PATIENT_ROWS_H
#define SUPINE_PATIENT_ROWS_H

#include <supine/status.h>

#include "precompute/patient/pairs.h"
#include "precompute/patient/patient.h"

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

#endif
