/* SPDX-License-Identifier: MIT */
/* Compute the position and expected error of every vertex from the fit of supine_locate. */
#include <math.h>

#include "base/vec3.h"
#include "runtime/location.h"
#include "runtime/rigid.h"

void supine_location_evaluate(const supine_location *found, const supine_expected_model *model,
                              size_t lung, size_t begin, size_t end, supine_location_block *b) {
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
                                        .volume = found->options.volume ? b->volume : NULL};
  supine_kriging_predict(&found->kriging, &target, b->shift, b->variance);
}

double supine_location_square(const supine_location *found, const supine_location_block *block,
                              size_t i) {
  const double variance = (double)block->variance[i];
  double prior = 0;
  if (found->options.rotation || found->kriging.lines != NULL || found->kriging.count < 3) {
    return variance;
  }
  for (size_t k = 0; k < SUPINE_EXPECTED_HEART; ++k) {
    prior += block->formula.square[i][k];
  }
  return fmin(prior, variance);
}

void supine_location_move(const supine_location *found, const double at[3], double moved[3]) {
  for (size_t k = 0; k < 3; ++k) {
    moved[k] = supine_dot(found->info.rotation + 3 * k, at) + found->origin[k];
  }
}

void supine_location_turn_all(const supine_location *found, size_t count, float *vectors) {
  for (float *x = vectors; x < vectors + 3 * count; x += 3) {
    const double before[3] = {(double)x[0], (double)x[1], (double)x[2]};
    for (size_t k = 0; k < 3; ++k) {
      x[k] = (float)supine_dot(found->info.rotation + 3 * k, before);
    }
  }
}

void supine_location_move_all(const supine_location *found, size_t count, float *xyz) {
  supine_location_turn_all(found, count, xyz);
  for (size_t e = 0; e < 3 * count; ++e) {
    xyz[e] = (float)((double)xyz[e] + found->origin[e % 3]);
  }
}

/* Write the positions of a block in the frame of the observations, and their expected errors. */
static void finish(const supine_location *found, const supine_location_block *b, size_t count,
                   float *xyz, float *sigma) {
  for (size_t i = 0; i < count; ++i) {
    double variance = supine_location_square(found, b, i);
    for (size_t k = SUPINE_EXPECTED_HEART; k < SUPINE_EXPECTED_TERMS; ++k) {
      variance += b->formula.square[i][k];
    }
    sigma[i] = (float)sqrt(found->factor * found->factor * variance + found->excess);
  }
  for (size_t e = 0; e < 3 * count; ++e) {
    xyz[e] = b->law[e] + b->shift[e];
  }
  supine_location_move_all(found, count, xyz);
}

supine_status supine_locate_positions(const supine_location *found, const supine_basis *basis,
                                      float *xyz, float *sigma, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_state scan = supine_basis_scan(basis);
  supine_expected_model model;
  supine_location_block b;
  const supine_status status =
      supine_expected_prepare(basis, &found->info.state, &scan, found->deviation,
                              found->options.model.least, &model, error);
  if (status == SUPINE_OK) {
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      const size_t last = info->lung_begin[lung + 1];
      for (size_t begin = info->lung_begin[lung]; begin < last; begin += LOCATE_BLOCK) {
        const size_t end = last - begin < LOCATE_BLOCK ? last : begin + LOCATE_BLOCK;
        supine_location_evaluate(found, &model, lung, begin, end, &b);
        finish(found, &b, end - begin, xyz + 3 * begin, sigma + begin);
      }
    }
  }
  if (status == SUPINE_OK) {
    supine_rigid_restore(basis, xyz);
  }
  return status;
}
