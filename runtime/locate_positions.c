/* SPDX-License-Identifier: MIT */
/* Compute the position and expected error of every vertex from the fit of supine_locate. */
#include <math.h>

#include "runtime/expected.h"
#include "runtime/rigid.h"

/* Poses of the found state (`at`), of the scan, and of the found state with 1 % of the reference
 * volume added (`fuller`). */
typedef struct poses {
  supine_pose at, scan, fuller;
  double constant; /* (expected error without observations)^2 / displacement, mm */
  double per_step; /* prior standard deviation of the volume / volume added in `fuller` */
} poses;

static supine_status find_poses(const supine_location *found, const supine_basis *basis, poses *p,
                                supine_error *error) {
  const supine_locate_fit *fit = found->fit;
  const supine_state scan = supine_basis_scan(basis);
  supine_status status = supine_basis_pose(basis, &found->state, &p->at, error);
  if (status == SUPINE_OK) {
    status = supine_basis_pose(basis, &scan, &p->scan, error);
  }
  p->fuller = p->at;
  if (status == SUPINE_OK && fit->options.volume) {
    status = supine_expected_shifted(basis, &found->state, &p->fuller, error);
    p->per_step = fit->deviation / (supine_expected_shift * supine_expected_reference(basis));
  }
  if (status == SUPINE_OK) {
    p->constant =
        fmin(supine_expected_constant(basis),
             fmax(fit->options.model.least, supine_expected_rms(basis, &p->at, &p->scan)));
  }
  return status;
}

typedef struct block {
  float law[3 * LOCATE_BLOCK], scan[3 * LOCATE_BLOCK], volume[3 * LOCATE_BLOCK];
  float size[LOCATE_BLOCK];
  float shift[3 * LOCATE_BLOCK], variance[LOCATE_BLOCK];
} block;

static void predict(const supine_location *found, const supine_basis *basis, const poses *p,
                    size_t lung, size_t begin, size_t end, block *b) {
  const supine_locate_fit *fit = found->fit;
  (void)supine_deform_range(basis, &p->at, begin, end, b->law);
  (void)supine_deform_range(basis, &p->scan, begin, end, b->scan);
  if (fit->options.volume) {
    (void)supine_deform_range(basis, &p->fuller, begin, end, b->volume);
  }
  for (size_t i = 0; i < end - begin; ++i) {
    float square = 0;
    for (size_t j = 3 * i; j < 3 * i + 3; ++j) {
      const float u = b->law[j] - b->scan[j];
      square += u * u;
      b->volume[j] = fit->options.volume ? (b->volume[j] - b->law[j]) * (float)p->per_step : 0;
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
 * true error). For a fitted rotation, it would ignore the error of the rotation. */
static void finish(const supine_location *found, const poses *p, const block *b, size_t count,
                   float *xyz, float *sigma) {
  const supine_locate_fit *fit = found->fit;
  const bool bounded = !fit->options.rotation && fit->kriging.count >= 3;
  for (size_t i = 0; i < count; ++i) {
    double body[3];
    double variance = fmax((double)b->size[i], fit->options.model.least) * p->constant;
    for (size_t k = 0; k < 3; ++k) {
      const double v = fit->options.volume ? (double)b->volume[3 * i + k] : 0;
      body[k] = (double)b->law[3 * i + k] + (double)b->shift[3 * i + k];
      variance += v * v;
    }
    for (size_t k = 0; k < 3; ++k) {
      const double *row = found->rotation + 3 * k;
      xyz[3 * i + k] =
          (float)(row[0] * body[0] + row[1] * body[1] + row[2] * body[2] + fit->origin[k]);
    }
    const double stated = (double)b->variance[i];
    sigma[i] = (float)sqrt(bounded && variance < stated ? variance : stated);
  }
}

supine_status supine_locate_positions(const supine_location *found, const supine_basis *basis,
                                      float *xyz, float *sigma, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  poses p = {.per_step = 0};
  block b;
  const supine_status status = find_poses(found, basis, &p, error);
  for (size_t lung = 0; lung < info->lung_count && status == SUPINE_OK; ++lung) {
    const size_t last = info->lung_begin[lung + 1];
    for (size_t begin = info->lung_begin[lung]; begin < last; begin += LOCATE_BLOCK) {
      const size_t end = last - begin < LOCATE_BLOCK ? last : begin + LOCATE_BLOCK;
      predict(found, basis, &p, lung, begin, end, &b);
      finish(found, &p, &b, end - begin, xyz + 3 * begin, sigma + begin);
    }
  }
  if (status == SUPINE_OK) {
    supine_rigid_restore(basis, xyz);
  }
  return status;
}
