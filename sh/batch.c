/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The caller's arrays of many fields: strides, blocks, threads. */
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>

#include "sh/base/parallel.h"

#include "sh/internal.h"

enum { THREADS_MAX = 256 }; /* as supine_parallel_for: each has its own workspace */

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

typedef struct run {
  const supine_sh_transform *plan;
  supine_sh_block_function *block;
  const void *context;
  size_t shift, end;  /* items are fields counted from `shift` places before the first */
  size_t few;         /* items taken at a time, in whole blocks */
  atomic_size_t next; /* the first item that no thread has taken */
  const supine_sh_workspace *work; /* [threads] */
} run;

/* Threads take a few fields at a time until none is left: one that is held up holds up no other.
 * Blocks begin at the same fields whoever takes them, so the numbers do not depend on it. */
static void run_blocks(void *context, size_t begin, size_t end, size_t thread) {
  run *job = context;
  const size_t width = job->plan->width;
  const size_t few = job->few;
  (void)begin; /* one item of supine_parallel_for is a thread */
  (void)end;
  for (size_t item = atomic_fetch_add(&job->next, few); item < job->end;
       item = atomic_fetch_add(&job->next, few)) {
    const size_t last = job->end - item < few ? job->end : item + few;
    for (size_t b = item; b < last; b += width) {
      const size_t start = b < job->shift ? job->shift : b;
      const size_t stop = last - b < width ? last : b + width;
      if (start < stop) {
        job->block(job->context, &job->work[thread], start - job->shift, stop - start);
      }
    }
  }
  supine_sh_rows_finish();
}

supine_status supine_sh_batch_run(const supine_sh_transform *plan, const supine_sh_batch *full,
                                  supine_sh_block_function *block, const void *context,
                                  const double *output, supine_error *error) {
  if (full->fields == 0) {
    return SUPINE_OK;
  }
  const size_t shift = (uintptr_t)output / sizeof *output % (SUPINE_SH_ALIGNMENT / sizeof *output);
  const size_t blocks = (full->fields + shift - 1) / plan->width + 1;
  const size_t wanted = full->threads < THREADS_MAX ? full->threads : THREADS_MAX;
  const size_t threads = blocks < wanted ? blocks : wanted;
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
  const size_t shares = 16 * threads; /* some to spare, yet long runs of memory */
  const size_t few = plan->width * ((blocks - 1) / shares + 1);
  run job = {plan, block, context, shift, full->fields + shift, few, 0, work};
  supine_parallel_for(threads, 1, threads, run_blocks, &job);

cleanup:
  free(arrays);
  free(work);
  return status;
}
