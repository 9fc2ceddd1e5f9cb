/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Rows of landmarks, and the blocks that are held out together. */
#include <math.h>
#include <string.h>

#include <gsl/gsl_rng.h>
#include <lapacke.h>

#include "precompute/patient/rows.h"

/* Side of a block, mm: neighbours within it are left out together. Landmarks a third of that
 * apart move alike to a few mm, so leaving out single ones would understate the error. */
static const double block_side = 40.0;

/* Standard deviation of a landmark, mm per axis. */
static const double landmark_noise = 2.0;

void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows) {
  for (size_t i = 0; i < pairs->count; ++i) {
    const double *from = pairs->from + 3 * i;
    const double side = pairs->side != NULL ? pairs->side[i] : 0.0;
    const supine_patient_place place = supine_patient_find(frame, from, side);
    for (size_t a = 0; a < 3; ++a) {
      supine_patient_row *row = &rows[3 * i + a];
      *row = (supine_patient_row){
          .place = place,
          .force = {1.0, place.box[0] - 0.5, place.box[1] - 0.5, place.box[2] - 0.5},
          .value = pairs->to[3 * i + a] - from[a],
          .weight = 1.0,
          .noise = landmark_noise};
      row->axis[a] = 1.0;
    }
  }
}

void supine_patient_row_displacement(const supine_patient *patient, const supine_patient_row *row,
                                     double u[3]) {
  const double *c = patient->powers + 3;
  const double force =
      row->force[0] + c[0] * row->force[1] + c[1] * row->force[2] + c[2] * row->force[3]; /* (18) */
  double r[3];
  supine_patient_direction(patient, &row->place, u);
  for (size_t k = 0; k < 3; ++k) {
    u[k] *= force;
  }
  supine_patient_correct(patient, &row->place, u, r);
  for (size_t k = 0; k < 3; ++k) {
    u[k] += r[k];
  }
}

size_t supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, unsigned long seed) {
  enum { CELLS = 64 }; /* cells of the grid on a side: 2.5 m */
  size_t blocks = 0;
  double origin[3];
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  if (random == NULL) {
    return 0;
  }
  gsl_rng_set(random, seed);
  for (int k = 0; k < 3; ++k) {
    const double half = 0.5 * (frame->maximum[k] - frame->minimum[k]);
    origin[k] = -half - block_side * gsl_rng_uniform(random);
  }
  gsl_rng_free(random);
  for (size_t i = 0; i < count; ++i) {
    size_t cell = 0;
    for (int k = 0; k < 3; ++k) {
      const double at = floor((rows[i].place.arm[k] - origin[k]) / block_side);
      cell = cell * CELLS + (size_t)fmin(CELLS - 1, fmax(0.0, at));
    }
    rows[i].block = cell;
  }
  /* Marks cells that have a block number, in order of first appearance. */
  static const size_t numbered = (size_t)1 << 40;
  for (size_t i = 0; i < count; ++i) {
    if (rows[i].block < numbered) {
      const size_t cell = rows[i].block;
      for (size_t j = i; j < count; ++j) {
        rows[j].block = rows[j].block == cell ? numbered + blocks : rows[j].block;
      }
      ++blocks;
    }
  }
  for (size_t i = 0; i < count; ++i) {
    rows[i].block -= numbered;
  }
  return blocks;
}

supine_status supine_patient_rows_deal(size_t blocks, size_t folds, unsigned long seed,
                                       size_t *fold_of) {
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  if (random == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  gsl_rng_set(random, seed);
  for (size_t b = 0; b < blocks; ++b) {
    const size_t other = gsl_rng_uniform_int(random, b + 1);
    fold_of[b] = fold_of[other];
    fold_of[other] = b % folds;
  }
  gsl_rng_free(random);
  return SUPINE_OK;
}

/* axis . (t + M arm), arm in units of 100 mm. */
static void affine_design(const supine_patient_row *row, double x[SUPINE_PATIENT_AFFINE]) {
  for (size_t a = 0; a < 3; ++a) {
    x[a] = row->axis[a];
    for (size_t b = 0; b < 3; ++b) {
      x[3 + 3 * a + b] = row->axis[a] * 0.01 * row->place.arm[b];
    }
  }
}

bool supine_patient_affine_fit(const supine_patient_row *rows, size_t count, const size_t *fold_of,
                               size_t without, bool translation,
                               double map[SUPINE_PATIENT_AFFINE]) {
  enum { N = SUPINE_PATIENT_AFFINE };
  double matrix[N * N] = {0.0};
  double trace = 0.0;
  memset(map, 0, N * sizeof *map);
  for (size_t i = 0; i < count; ++i) {
    double x[N];
    if (fold_of != NULL && fold_of[i] == without) {
      continue;
    }
    affine_design(&rows[i], x);
    for (size_t a = 0; a < N; ++a) {
      for (size_t b = 0; b < N; ++b) {
        matrix[a * N + b] += rows[i].weight * x[a] * x[b];
      }
      map[a] += rows[i].weight * x[a] * rows[i].value;
      trace += rows[i].weight * x[a] * x[a];
    }
  }
  const lapack_int size = translation ? 3 : N;
  for (size_t a = 0; a < N; ++a) {
    matrix[a * N + a] += 1e-9 * trace; /* regular where rows leave a term undetermined */
    map[a] = a < (size_t)size ? map[a] : 0.0;
  }
  return LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', size, 1, matrix, N, map, N) == 0;
}

double supine_patient_affine_residual(const double map[SUPINE_PATIENT_AFFINE],
                                      const supine_patient_row *row) {
  double x[SUPINE_PATIENT_AFFINE];
  double left = -row->value;
  affine_design(row, x);
  for (size_t a = 0; a < SUPINE_PATIENT_AFFINE; ++a) {
    left += x[a] * map[a];
  }
  return left;
}
