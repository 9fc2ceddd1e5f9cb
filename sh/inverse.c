/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Coefficients to values. */
#include "sh/internal.h"

typedef struct inverse {
  const supine_sh_transform *plan;
  supine_sh_batch batch;
  const double *coefficients;
  double *values;
} inverse;

static void sum_degrees(const supine_sh_transform *plan, const supine_sh_workspace *work) {
  const double *t = plan->synthesis;
  const double *x = work->coefficients;
  double *y = work->spectra;
  for (size_t m = 0; m <= plan->band; ++m) {
    for (size_t parity = 0; parity < 2; ++parity) {
      const size_t degrees = supine_sh_degrees(plan->band, m, parity);
      for (size_t sine = 0; sine < (m > 0 ? 2 : 1); ++sine) {
        supine_sh_product(plan->pairs, degrees, plan->width, t, degrees, x, y);
        x += degrees * plan->width;
        y += plan->pairs * plan->width;
      }
      t += degrees * plan->pairs;
    }
  }
}

static void inverse_block(const void *context, const supine_sh_workspace *work, size_t begin,
                          size_t fields) {
  const inverse *job = context;
  const supine_sh_transform *plan = job->plan;
  const size_t stride = job->batch.point_stride;
  const size_t ring = plan->longitudes * stride;
  const supine_sh_mode mode =
      supine_sh_row_mode(plan->latitudes * plan->longitudes, job->batch.fields);
  supine_sh_block_load(plan, &job->batch, begin, fields, job->coefficients, work->coefficients);
  sum_degrees(plan, work);
  for (size_t p = 0; p < plan->pairs; ++p) {
    const size_t mirror = plan->latitudes - 1 - p;
    supine_sh_ring_inverse(plan, work, fields, stride, mode, job->values + p * ring + begin,
                           mirror == p ? NULL : job->values + mirror * ring + begin, p,
                           plan->pairs);
  }
}

supine_status supine_sh_inverse(const supine_sh_transform *plan, const supine_sh_batch *batch,
                                const double *coefficients, double *values, supine_error *error) {
  inverse job = {.plan = plan, .coefficients = coefficients, .values = values};
  const supine_status status =
      supine_sh_batch_check(plan, batch, plan->latitudes * plan->longitudes, &job.batch, error);
  if (status != SUPINE_OK) {
    return status;
  }
  return supine_sh_batch_run(plan, &job.batch, inverse_block, &job, values, error);
}
