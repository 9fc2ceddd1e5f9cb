/* SPDX-License-Identifier: MIT */
/* Compute the position and expected error of every vertex from the fit of supine_locate. */
#include <math.h>

#include "runtime/expected.h"
#include "runtime/location.h"
#include "runtime/rigid.h"

typedef struct block {
  supine_expected_block formula;
  float law[3 * LOCATE_BLOCK], scan[3 * LOCATE_BLOCK], volume[3 * LOCATE_BLOCK];
  float size[LOCATE_BLOCK];
  float shift[3 * LOCATE_BLOCK], variance[LOCATE_BLOCK];
} block;

static void predict(const supine_location *fit, const supine_expected_model *model, size_t lung,
                    size_t begin, size_t end, block *b) {
  const float *vertices = supine_basis_vertices(model->basis) + 3 * begin;
  float(*x)[3 * LOCATE_BLOCK] = b->formula.x;
  supine_expected_evaluate(model, begin, end, &b->formula);
  for (size_t i = 0; i < end - begin; ++i) {
    float square = 0;
    for (size_t j = 3 * i; j < 3 * i + 3; ++j) {
      const float u = x[EXPECTED_AT][j] - x[EXPECTED_FROM][j];
      square += u * u;
      b->law[j] = vertices[j] + x[EXPECTED_AT][j];
      b->scan[j] = vertices[j] + x[EXPECTED_FROM][j];
      b->volume[j] = (x[EXPECTED_FULLER][j] - x[EXPECTED_AT][j]) * (float)model->per_step;
    }
    b->size[i] = sqrtf(square);
  }
  const supine_kriging_target target = {.count = end - begin,
                                        .lung = lung,
                                        .position = b->scan,
                                        .size = b->size,
                                        .volume = fit->options.volume ? b->volume : NULL};
  supine_kriging_predict(&fit->kriging, &target, b->shift, b->variance);
}

/* Convert the corrected positions to the frame of the observations, and write the expected errors
 * of kriging. If at least three points were observed and no rotation was fitted, limit each to the
 * expected error without observations. For two points, this limit would be too small (0.85 of the
 * true error). For a fitted rotation, it would ignore the error of the rotation, and for lines of
 * sight that along the lines. */
static void finish(const supine_location *fit, const block *b, size_t count, float *xyz,
                   float *sigma) {
  const bool bounded =
      !fit->options.rotation && fit->kriging.lines == NULL && fit->kriging.count >= 3;
  for (size_t i = 0; i < count; ++i) {
    double body[3];
    double variance = (double)b->variance[i];
    double prior = 0;
    for (size_t k = 0; k < SUPINE_EXPECTED_HEART; ++k) {
      prior += b->formula.square[i][k];
    }
    variance = bounded && prior < variance ? prior : variance;
    for (size_t k = SUPINE_EXPECTED_HEART; k < SUPINE_EXPECTED_TERMS; ++k) {
      variance += b->formula.square[i][k];
    }
    for (size_t k = 0; k < 3; ++k) {
      body[k] = (double)b->law[3 * i + k] + (double)b->shift[3 * i + k];
    }
    for (size_t k = 0; k < 3; ++k) {
      const double *row = fit->info.rotation + 3 * k;
      xyz[3 * i + k] =
          (float)(row[0] * body[0] + row[1] * body[1] + row[2] * body[2] + fit->origin[k]);
    }
    sigma[i] = (float)sqrt(fit->factor * fit->factor * variance + fit->excess);
  }
}

supine_status supine_locate_positions(const supine_location *found, const supine_basis *basis,
                                      float *xyz, float *sigma, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_state scan = supine_basis_scan(basis);
  supine_expected_model model;
  block b;
  const supine_status status =
      supine_expected_prepare(basis, &found->info.state, &scan, found->deviation,
                              found->options.model.least, &model, error);
  if (status == SUPINE_OK) {
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      const size_t last = info->lung_begin[lung + 1];
      for (size_t begin = info->lung_begin[lung]; begin < last; begin += LOCATE_BLOCK) {
        const size_t end = last - begin < LOCATE_BLOCK ? last : begin + LOCATE_BLOCK;
        predict(found, &model, lung, begin, end, &b);
        finish(found, &b, end - begin, xyz + 3 * begin, sigma + begin);
      }
    }
  }
  if (status == SUPINE_OK) {
    supine_rigid_restore(basis, xyz);
  }
  return status;
}
