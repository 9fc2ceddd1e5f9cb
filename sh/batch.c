/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The caller's arrays of many fields: strides, blocks, threads. */
#include <stdint.h>
#include <stdlib.h>

#include <supine/parallel.h>

#include "internal.h"

/* Whether an array of `rows` rows of `row` doubles, `stride` apart, fits the address space. */
static int fits(size_t rows, size_t stride, size_t row) {
  const size_t most = PTRDIFF_MAX / sizeof(double);
  return row <= most && (rows <= 1 || stride <= (most - row) / (rows - 1));
}

supine_status supine_sh_batch_check(const supine_sh_transform *plan, const supine_sh_batch *batch,
                                    size_t points, supine_sh_batch *full, supine_error *error) {
  *full = *batch;
  if (full->point_stride == 0) {
    full->point_stride = full->fields;
  }
  if (full->coefficient_stride == 0) {
    full->coefficient_stride = 1;
  }
  if (full->field_stride == 0) {
    full->field_stride = full->coefficient_stride == 1 ? plan->count : 1;
  }
  if (full->threads == 0) {
    full->threads = supine_thread_count();
  }
  if (full->point_stride < full->fields || !fits(points, full->point_stride, full->fields)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "point stride %zu cannot hold %zu fields at %zu directions",
                            full->point_stride, full->fields, points);
  }
  const int together = full->coefficient_stride == 1 && full->field_stride >= plan->count &&
                       fits(full->fields, full->field_stride, plan->count);
  const int apart = full->field_stride == 1 && full->coefficient_stride >= full->fields &&
                    fits(plan->count, full->coefficient_stride, full->fields);
  if (!together && !apart) {
    return supine_error_set(
        error, SUPINE_ERROR_ARGUMENT,
        "coefficient stride %zu and field stride %zu cannot hold %zu coefficients of %zu fields: "
        "one must be 1 and the other span the rest",
        full->coefficient_stride, full->field_stride, plan->count, full->fields);
  }
  return SUPINE_OK;
}

SUPINE_CLONES
static void store_row(size_t fields, int add, const double *restrict row, double *restrict out) {
  if (add) {
    for (size_t f = 0; f < fields; ++f) {
      out[f] += row[f];
    }
  } else {
    for (size_t f = 0; f < fields; ++f) {
      out[f] = row[f];
    }
  }
}

void supine_sh_block_store(const supine_sh_transform *plan, const supine_sh_batch *batch,
                           size_t begin, size_t fields, int add, const double *block,
                           double *coefficients) {
  if (batch->field_stride == 1) {
    for (size_t i = 0; i < plan->count; ++i) {
      store_row(fields, add, block + i * plan->width,
                coefficients + plan->position[i] * batch->coefficient_stride + begin);
    }
    return;
  }
  for (size_t f = 0; f < fields; ++f) {
    double *out = coefficients + (begin + f) * batch->field_stride;
    for (size_t i = 0; i < plan->count; ++i) {
      const double before = add ? out[plan->position[i]] : 0;
      out[plan->position[i]] = before + block[i * plan->width + f];
    }
  }
}

void supine_sh_block_load(const supine_sh_transform *plan, const supine_sh_batch *batch,
                          size_t begin, size_t fields, const double *coefficients, double *block) {
  for (size_t i = 0; i < plan->count; ++i) {
    const double *in = coefficients + plan->position[i] * batch->coefficient_stride;
    double *row = block + i * plan->width;
    for (size_t f = 0; f < fields; ++f) {
      row[f] = in[(begin + f) * batch->field_stride];
    }
    for (size_t f = fields; f < plan->width; ++f) {
      row[f] = 0;
    }
  }
}

typedef struct run {
  const supine_sh_transform *plan;
  supine_sh_block_function *block;
  const void *context;
  const supine_sh_workspace *work; /* [threads] */
} run;

static void run_blocks(void *context, size_t begin, size_t end, size_t thread) {
  const run *job = context;
  const size_t width = job->plan->width;
  for (size_t f = begin; f < end; f += width) {
    job->block(job->context, &job->work[thread], f, end - f < width ? end - f : width);
  }
}

supine_status supine_sh_batch_run(const supine_sh_transform *plan, const supine_sh_batch *full,
                                  supine_sh_block_function *block, const void *context,
                                  supine_error *error) {
  const size_t blocks = full->fields / plan->width + (full->fields % plan->width != 0);
  const size_t threads = blocks < full->threads ? blocks : full->threads;
  if (threads == 0) {
    return SUPINE_OK;
  }
  const size_t ring = 2 * plan->longitudes * plan->width;
  const size_t spectra = 2 * (2 * plan->band + 1) * plan->pairs * plan->width;
  const size_t coefficients = plan->count * plan->width;
  const size_t each = 2 * ring + spectra + coefficients;
  supine_sh_workspace *work = calloc(threads, sizeof *work);
  double *arrays = aligned_alloc(SUPINE_SH_ALIGNMENT, threads * each * sizeof *arrays);
  supine_status status = SUPINE_OK;
  if (work == NULL || arrays == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory for the transform");
    goto cleanup;
  }
  for (size_t t = 0; t < threads; ++t) {
    double *own = arrays + t * each;
    work[t] = (supine_sh_workspace){own, own + ring, own + 2 * ring, own + 2 * ring + spectra};
  }
  run job = {plan, block, context, work};
  supine_parallel_for(full->fields, plan->width, threads, run_blocks, &job);

cleanup:
  free(arrays);
  free(work);
  return status;
}
