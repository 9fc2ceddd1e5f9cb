/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Error against the number of functions: every prefix of the harmonics and of the modes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/clones.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"
#include <supine/sh.h>

#include "precompute/projection/error_table.h"
#include "precompute/projection/compression.h"

enum { VERTICES_MAX = 4096, LANES = 8 }; /* vertices side by side: sums wait for each other */

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
  double *coefficients;     /* [count / LANES, P, LANES], 0 past the last vertex */
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
    double *out = work->coefficients + i / LANES * terms * LANES + i % LANES;
    for (size_t r = 0; r < projection->rank; ++r) {
      if (projection->functions == NULL) {
        out[r * LANES] = row[r];
        continue;
      }
      for (size_t t = 0; t < terms; ++t) {
        out[t * LANES] += row[r] * projection->functions[r * terms + t];
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

/* left -= c y of a few terms, and how much is left in all. */
SUPINE_CLONES static double take_off(const double *c, const double *y, size_t terms,
                                     const double square[LANES], double left[LANES]) {
  double sum = 0.0;
  for (size_t t = 0; t < terms; ++t) {
    for (size_t k = 0; k < LANES; ++k) {
      left[k] -= c[t * LANES + k] * y[t];
    }
  }
  for (size_t k = 0; k < LANES; ++k) {
    sum += square[k] * left[k] * left[k];
  }
  return sum;
}

/* Some vertices side by side, which every direction looks at while they are near. */
static void errors_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const table_work *work = context;
  const size_t n = work->field->vertex_count;
  const size_t bands = work->projection->band + 1;
  const size_t terms = bands * bands;
  const size_t modes = work->field->mode_count;
  for (size_t first = 0; first < work->count; first += LANES) {
    const size_t count = work->count - first < LANES ? work->count - first : LANES;
    const double *c = work->coefficients + first * terms;
    double m[SUPINE_MODES_MADE_MAX * LANES] = {0.0};
    double square[LANES] = {0.0};
    for (size_t j = 0; j < count; ++j) {
      const size_t vertex = (first + j) * work->stride;
      square[j] = supine_dot(work->directions + 3 * vertex, work->directions + 3 * vertex);
      for (size_t k = 0; k < modes; ++k) {
        m[k * LANES + j] = (double)work->field->coefficients[vertex * modes + k];
      }
    }
    for (size_t d = begin; d < end; ++d) {
      double *sums = work->sums + d * (1 + bands + modes);
      const double *y = work->y + d * terms;
      double truth[LANES] = {0.0};
      double left[LANES];
      for (size_t j = 0; j < count; ++j) {
        truth[j] = true_value(work->truth, n, d, (first + j) * work->stride);
        sums[0] += square[j] * truth[j] * truth[j];
      }
      memcpy(left, truth, sizeof left);
      for (size_t l = 0; l < bands; ++l) {
        sums[1 + l] += take_off(c + l * l * LANES, y + l * l, 2 * l + 1, square, left);
      }
      memcpy(left, truth, sizeof left);
      for (size_t k = 0; k < modes; ++k) {
        sums[1 + bands + k] +=
            take_off(m + k * LANES, work->weights + d * modes + k, 1, square, left);
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
  work.coefficients = calloc((work.count + LANES) * bands * bands, sizeof(double));
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
