/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Rows of landmarks, and the blocks that they are held out by. */
#include <math.h>

#include <gsl/gsl_rng.h>

#include "precompute/patient/rows.h"

/* Side of a block, mm: neighbours within it are left out together. Landmarks a third of that apart
 * move alike to a few mm, so single ones left out would look better than they are. */
static const double block_side = 40.0;

void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows) {
  for (size_t i = 0; i < pairs->count; ++i) {
    const double *from = pairs->from + 3 * i;
    const supine_patient_place place = supine_patient_find(frame, from);
    for (size_t a = 0; a < 3; ++a) {
      supine_patient_row *row = &rows[3 * i + a];
      *row = (supine_patient_row){
          .place = place,
          .force = {1.0, place.box[0] - 0.5, place.box[1] - 0.5, place.box[2] - 0.5},
          .value = pairs->to[3 * i + a] - from[a],
          .weight = 1.0};
      row->axis[a] = 1.0;
    }
  }
}

size_t supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, unsigned long seed) {
  enum { CELLS = 64 }; /* a side: 2.5 m */
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
  /* Cells to blocks numbered as they first appear. */
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
