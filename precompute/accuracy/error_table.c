/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Error against the number of functions: every prefix of the harmonics and of the modes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/parallel.h"
#include "sh/base/vec3.h"
#include <supine/sh.h>

#include "precompute/accuracy/error_table.h"
#include "precompute/projection/compression.h"

enum { VERTICES_MAX = 4096 };

void supine_accuracy_error_table_free(supine_error_table *table) {
  free(table->harmonics);
  free(table->modes);
  *table = (supine_error_table){0};
}

typedef struct table_work {
  const supine_truth *truth;
  const supine_projection *projection;
  const supine_compression *field;
  const double *directions; /* [N, 3] */
  size_t count, stride;     /* vertices looked at */
  double *coefficients;     /* [count, P] */
  double *y;                /* [D, P] */
  double *weights;          /* [D, K] */
  double *sums;             /* [D, 1 + bands + K]: squares of the field and of each error */
} table_work;

/* Coefficients of every harmonic at the vertices looked at. */
static void coefficients_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const table_work *work = context;
  const supine_projection *projection = work->projection;
  const size_t terms = supine_sh_count(projection->band);
  for (size_t i = begin; i < end; ++i) {
    const double *row = projection->columns + i * work->stride * projection->rank;
    double *out = work->coefficients + i * terms;
    if (projection->functions == NULL) {
      memcpy(out, row, terms * sizeof *out);
      continue;
    }
    memset(out, 0, terms * sizeof *out);
    for (size_t r = 0; r < projection->rank; ++r) {
      for (size_t t = 0; t < terms; ++t) {
        out[t] += row[r] * projection->functions[r * terms + t];
      }
    }
  }
}

static double true_value(const supine_truth *truth, size_t vertex_count, size_t d, size_t vertex) {
  if (truth->fields != NULL) {
    return truth->fields[d * vertex_count + vertex];
  }
  double sum = 0.0;
  for (size_t r = 0; r < truth->rank; ++r) {
    sum += truth->columns[vertex * truth->rank + r] * truth->functions[d * truth->rank + r];
  }
  return sum;
}

static void errors_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const table_work *work = context;
  const size_t n = work->field->vertex_count;
  const size_t bands = work->projection->band + 1;
  const size_t terms = bands * bands;
  const size_t modes = work->field->mode_count;
  for (size_t d = begin; d < end; ++d) {
    double *sums = work->sums + d * (1 + bands + modes);
    const double *y = work->y + d * terms;
    const double *w = work->weights + d * modes;
    for (size_t i = 0; i < work->count; ++i) {
      const size_t vertex = i * work->stride;
      const double *u = work->directions + 3 * vertex;
      const double square = supine_dot(u, u);
      const double truth = true_value(work->truth, n, d, vertex);
      const double *c = work->coefficients + i * terms;
      const float *m = work->field->coefficients + vertex * modes;
      sums[0] += square * truth * truth;
      double left = truth;
      for (size_t l = 0, t = 0; l < bands; ++l) {
        for (; t < (l + 1) * (l + 1); ++t) {
          left -= c[t] * y[t];
        }
        sums[1 + l] += square * left * left;
      }
      left = truth;
      for (size_t k = 0; k < modes; ++k) {
        left -= (double)m[k] * w[k];
        sums[1 + bands + k] += square * left * left;
      }
    }
  }
}

static supine_status find_weights(const table_work *work) {
  const size_t terms = supine_sh_count(work->projection->band);
  const size_t count = work->truth->direction_count;
  const supine_status status =
      supine_sh_evaluate_many(work->projection->band, count, work->truth->directions, work->y);
  for (size_t d = 0; d < count && status == SUPINE_OK; ++d) {
    supine_projection_compression_weights(work->field, work->y + d * terms,
                                          work->weights + d * work->field->mode_count);
  }
  return status;
}

supine_status supine_accuracy_error_table_create(const supine_truth *truth,
                                                 const supine_projection *projection,
                                                 const supine_compression *compression,
                                                 const double *directions,
                                                 supine_error_table *table) {
  const size_t n = compression->vertex_count;
  const size_t stride = (n + VERTICES_MAX - 1) / VERTICES_MAX;
  const size_t bands = projection->band + 1;
  const size_t modes = compression->mode_count;
  const size_t count = truth->direction_count;
  const size_t width = 1 + bands + modes;
  table_work work = {truth,  projection, compression, directions, (n + stride - 1) / stride,
                     stride, NULL,       NULL,        NULL,       NULL};
  supine_error_table made = {bands, malloc(bands * sizeof(double)), modes,
                             malloc(modes * sizeof(double))};
  work.coefficients = malloc(work.count * bands * bands * sizeof(double));
  work.y = malloc(count * bands * bands * sizeof(double));
  work.weights = malloc(count * modes * sizeof(double));
  work.sums = calloc(count * width, sizeof(double));
  supine_status status = SUPINE_ERROR_MEMORY;
  if (made.harmonics == NULL || made.modes == NULL || work.coefficients == NULL || work.y == NULL ||
      work.weights == NULL || work.sums == NULL) {
    goto cleanup;
  }
  status = find_weights(&work);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  supine_parallel_for(work.count, 64, 0, coefficients_range, &work);
  supine_parallel_for(count, 1, 0, errors_range, &work);
  for (size_t d = 1; d < count; ++d) {
    for (size_t j = 0; j < width; ++j) {
      work.sums[j] += work.sums[d * width + j];
    }
  }
  for (size_t l = 0; l < bands; ++l) {
    made.harmonics[l] = sqrt(work.sums[1 + l] / work.sums[0]);
  }
  for (size_t k = 0; k < modes; ++k) {
    made.modes[k] = sqrt(work.sums[1 + bands + k] / work.sums[0]);
  }
  *table = made;
  made = (supine_error_table){0};
cleanup:
  supine_accuracy_error_table_free(&made);
  free(work.coefficients);
  free(work.y);
  free(work.weights);
  free(work.sums);
  return status;
}
