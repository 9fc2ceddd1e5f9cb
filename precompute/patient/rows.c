/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make rows of landmarks, group rows into blocks to hold out, and compute residuals of laws and
 * maps. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <gsl/gsl_rng.h>
#include <lapacke.h>

#include "precompute/patient/krige.h"

#include "sh/base/vec3.h"

/* Side of a block, mm: neighbours within it are left out together. Landmarks a third of that
 * apart move alike to a few mm, so leaving out single ones would understate the error. */
static const double block_side = 40.0;

/* Standard deviation of a landmark, mm per axis. */
static const double landmark_noise = 2.0;

void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows) {
  for (size_t i = 0; i < 3 * pairs->count; ++i) {
    rows[i] = (supine_patient_row){
        .place = supine_patient_find(frame, pairs->from + i / 3 * 3,
                                     pairs->side != NULL ? pairs->side[i / 3] : 0.0),
        .value = pairs->to[i] - pairs->from[i],
        .weight = 1.0,
        .noise = landmark_noise};
    rows[i].axis[i % 3] = 1.0;
  }
}

size_t supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, unsigned long seed) {
  enum { CELLS = 64 }; /* cells of the grid on a side: 2.5 m */
  size_t blocks = 0;
  double origin[3] = {0.0};
  size_t *number =
      calloc((size_t)CELLS * CELLS * CELLS, sizeof *number); /* of a cell's block, + 1 */
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  const bool able = number != NULL && random != NULL;
  if (able) {
    gsl_rng_set(random, seed);
  }
  for (int k = 0; k < 3 && able; ++k) {
    const double half = 0.5 * (frame->maximum[k] - frame->minimum[k]);
    origin[k] = -half - block_side * gsl_rng_uniform(random);
  }
  for (size_t i = 0; i < count && able; ++i) {
    size_t cell = 0;
    for (int k = 0; k < 3; ++k) {
      const double at = floor((rows[i].place.arm[k] - origin[k]) / block_side);
      cell = cell * CELLS + (size_t)fmin(CELLS - 1, fmax(0.0, at));
    }
    number[cell] = number[cell] == 0 ? ++blocks : number[cell];
    rows[i].block = number[cell] - 1;
  }
  gsl_rng_free(random);
  free(number);
  return blocks;
}

size_t supine_patient_rows_fold(const supine_patient_frame *frame, supine_patient_row *rows,
                                size_t count, unsigned long seed, size_t *fold) {
  const size_t blocks = supine_patient_rows_block(frame, rows, count, seed + 1);
  size_t *fold_of = malloc((blocks + 1) * sizeof *fold_of);
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  const bool able = fold_of != NULL && random != NULL;
  if (able) {
    gsl_rng_set(random, 1000 + seed);
    for (size_t b = 0; b < blocks; ++b) { /* shuffle */
      const size_t other = gsl_rng_uniform_int(random, b + 1);
      fold_of[b] = fold_of[other];
      fold_of[other] = b % SUPINE_PATIENT_FOLDS;
    }
    for (size_t i = 0; i < count; ++i) {
      fold[i] = fold_of[rows[i].block];
    }
  }
  gsl_rng_free(random);
  free(fold_of);
  return able ? blocks : 0;
}

double supine_patient_power_design(const supine_patient_power *law, const supine_patient_row *row,
                                   double x[SUPINE_PATIENT_TERMS]) {
  const double force = supine_patient_force_at(law, &row->place);
  double along[3]; /* displacement for a force of 1 and lengths of 1 mm */
  double motion[3];
  double turned[3];
  double even = 0.0; /* along the row, for a force of 1 */
  supine_patient_power unit = *law;
  unit.c[0] = unit.c[2] = unit.c[4] = 1.0;
  supine_patient_direction(&unit, &row->place, 1.0, along);
  supine_patient_motion(law, &row->place, motion);
  supine_cross(row->place.arm, row->axis, turned);
  for (size_t a = 0; a < 3; ++a) {
    along[a] *= row->axis[a];
    even += law->c[2 * a] * along[a];
  }
  for (size_t a = 0; a < 3; ++a) {
    const double box = fmin(1.0, fmax(1e-12, row->place.box[a]));
    x[a] = force * along[a];
    x[3 + a] = law->c[2 * a] * x[a] * law->c[2 * a + 1] * log(box);
    x[6 + a] = even * row->place.force[1 + a];
    x[9 + a] = row->axis[a];
    x[12 + a] = turned[a];
  }
  x[15] = even * force;
  return x[15] + supine_dot(motion, row->axis) - row->value;
}

/* Compute the derivatives of axis . (t + M arm) by t and M, with arm in units of 100 mm. */
static void affine_design(const supine_patient_row *row, double x[SUPINE_PATIENT_AFFINE]) {
  for (size_t a = 0; a < 3; ++a) {
    x[a] = row->axis[a];
    for (size_t b = 0; b < 3; ++b) {
      x[3 + 3 * a + b] = row->axis[a] * 0.01 * row->place.arm[b];
    }
  }
}

void supine_patient_affine_fit(const supine_patient_row *rows, size_t count, bool translation,
                               double map[SUPINE_PATIENT_AFFINE]) {
  enum { N = SUPINE_PATIENT_AFFINE };
  double matrix[N * N] = {0.0};
  double trace = 0.0;
  const lapack_int size = translation ? 3 : N;
  memset(map, 0, N * sizeof *map);
  for (size_t i = 0; i < count; ++i) {
    double x[N];
    affine_design(&rows[i], x);
    cblas_dsyr(CblasColMajor, CblasUpper, N, rows[i].weight, x, 1, matrix, N);
    cblas_daxpy(size, rows[i].weight * rows[i].value, x, 1, map, 1);
    trace += rows[i].weight * cblas_ddot(N, x, 1, x, 1);
  }
  for (size_t a = 0; a < N; ++a) {
    matrix[a * N + a] += 1e-9 * trace; /* regular where rows leave a term undetermined */
  }
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', size, 1, matrix, N, map, N) != 0) {
    memset(map, 0, N * sizeof *map);
  }
}

double supine_patient_affine_residual(const double map[SUPINE_PATIENT_AFFINE],
                                      const supine_patient_row *row) {
  double x[SUPINE_PATIENT_AFFINE];
  affine_design(row, x);
  return cblas_ddot(SUPINE_PATIENT_AFFINE, x, 1, map, 1) - row->value;
}
