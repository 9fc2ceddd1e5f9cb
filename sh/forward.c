/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Values to coefficients. */
#include "sh/internal.h"

typedef struct forward {
  const supine_sh_transform *plan;
  supine_sh_batch batch;
  const double *values;
  double *coefficients;
  size_t j; /* of a single ring */
} forward;

/* Sums over the pairs first <= p < first + rows, whose spectra the workspace holds. */
static void sum_latitudes(const supine_sh_transform *plan, const supine_sh_workspace *work,
                          size_t first, size_t rows) {
  const double *t = plan->analysis + first;
  const double *x = work->spectra;
  double *y = work->coefficients;
  for (size_t m = 0; m <= plan->band; ++m) {
    for (size_t parity = 0; parity < 2; ++parity) {
      const size_t degrees = supine_sh_degrees(plan->band, m, parity);
      for (size_t sine = 0; sine < (m > 0 ? 2 : 1); ++sine) {
        supine_sh_product(degrees, rows, plan->width, t, plan->pairs, x, y);
        x += rows * plan->width;
        y += degrees * plan->width;
      }
      t += degrees * plan->pairs;
    }
  }
}

static void forward_block(const void *context, const supine_sh_workspace *work, size_t begin,
                          size_t fields) {
  const forward *job = context;
  const supine_sh_transform *plan = job->plan;
  const size_t stride = job->batch.point_stride;
  const size_t ring = plan->longitudes * stride;
  for (size_t p = 0; p < plan->pairs; ++p) {
    const size_t mirror = plan->latitudes - 1 - p;
    supine_sh_ring_forward(plan, work, fields, stride, job->values + p * ring + begin,
                           mirror == p ? NULL : job->values + mirror * ring + begin, p,
                           plan->pairs);
  }
  sum_latitudes(plan, work, 0, plan->pairs);
  supine_sh_block_store(plan, &job->batch, begin, fields,
                        supine_sh_row_mode(plan->count, job->batch.fields), work,
                        job->coefficients);
}

supine_status supine_sh_forward(const supine_sh_transform *plan, const supine_sh_batch *batch,
                                const double *values, double *coefficients, supine_error *error) {
  forward job = {.plan = plan, .values = values, .coefficients = coefficients};
  const supine_status status =
      supine_sh_batch_check(plan, batch, plan->latitudes * plan->longitudes, &job.batch, error);
  if (status != SUPINE_OK) {
    return status;
  }
  return supine_sh_batch_run(plan, &job.batch, forward_block, &job, coefficients, error);
}

static void ring_block(const void *context, const supine_sh_workspace *work, size_t begin,
                       size_t fields) {
  const forward *job = context;
  const supine_sh_transform *plan = job->plan;
  const int north = job->j < plan->pairs;
  const double *ring = job->values + begin;
  supine_sh_ring_forward(plan, work, fields, job->batch.point_stride, north ? ring : NULL,
                         north ? NULL : ring, 0, 1);
  sum_latitudes(plan, work, north ? job->j : plan->latitudes - 1 - job->j, 1);
  supine_sh_block_store(plan, &job->batch, begin, fields, SUPINE_SH_ADD, work, job->coefficients);
}

supine_status supine_sh_forward_ring(const supine_sh_transform *plan, const supine_sh_batch *batch,
                                     size_t j, const double *ring, double *coefficients,
                                     supine_error *error) {
  if (j >= plan->latitudes) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "latitude %zu is not among the plan's %zu", j, plan->latitudes);
  }
  forward job = {.plan = plan, .values = ring, .coefficients = coefficients, .j = j};
  const supine_status status =
      supine_sh_batch_check(plan, batch, plan->longitudes, &job.batch, error);
  if (status != SUPINE_OK) {
    return status;
  }
  return supine_sh_batch_run(plan, &job.batch, ring_block, &job, coefficients, error);
}
