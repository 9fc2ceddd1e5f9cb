/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Error of a compressed field against the full solve on held-out directions. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/accuracy.h>
#include <supine/parallel.h>
#include <supine/sh.h>
#include <supine/volume.h>

#include "internal.h"

/* Bins of a float's exponent and first 8 bits of mantissa: 0.4 % wide over its whole range. */
enum { BIN_SHIFT = 15, BIN_COUNT = 1 << 16, BLOCK = 512, VOLUME_HALVINGS = 10 };

/* What one thread has seen. */
typedef struct tally {
  double error2, field2, max;  /* at one breath scale */
  double error_mm2, max_mm;    /* at one volume */
  uint32_t bins[2][BIN_COUNT]; /* of both errors */
} tally;

typedef struct accuracy_work {
  const supine_truth *truth;
  const supine_compression *compression;
  const double *directions; /* [N, 3] */
  const double *weights;    /* [D, K] */
  const double *scales;     /* [D, 2] true and compressed breath scale; NULL: open */
  tally *tallies;           /* one a thread */
} accuracy_work;

static void count_error(tally *sums, size_t which, double error) {
  const float value = (float)error;
  uint32_t bits;
  memcpy(&bits, &value, sizeof bits);
  ++sums->bins[which][bits >> BIN_SHIFT];
}

/* F of the compression at direction `d` for a block of vertices. */
SUPINE_CLONES static void compressed_block(const accuracy_work *work, size_t d, size_t begin,
                                           size_t end, double *out) {
  const size_t count = work->compression->mode_count;
  const double *w = work->weights + d * count;
  for (size_t i = begin; i < end; ++i) {
    const float *c = work->compression->coefficients + i * count;
    double sum = 0.0;
    for (size_t k = 0; k < count; ++k) {
      sum += w[k] * (double)c[k];
    }
    out[i - begin] = sum;
  }
}

static void true_block(const accuracy_work *work, size_t d, size_t begin, size_t end, double *out) {
  const supine_truth *truth = work->truth;
  if (truth->fields != NULL) {
    memcpy(out, truth->fields + d * work->compression->vertex_count + begin,
           (end - begin) * sizeof *out);
    return;
  }
  const double *functions = truth->functions + d * truth->rank;
  for (size_t i = begin; i < end; ++i) {
    double sum = 0.0;
    for (size_t r = 0; r < truth->rank; ++r) {
      sum += truth->columns[i * truth->rank + r] * functions[r];
    }
    out[i - begin] = sum;
  }
}

static void compare_block(const accuracy_work *work, tally *sums, size_t begin, size_t end) {
  double length[BLOCK];
  double is[BLOCK];
  double should[BLOCK];
  for (size_t i = begin; i < end; ++i) {
    const double *u = work->directions + 3 * i;
    length[i - begin] = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
  }
  for (size_t d = 0; d < work->truth->direction_count; ++d) {
    true_block(work, d, begin, end, should);
    compressed_block(work, d, begin, end, is);
    for (size_t i = 0; i < end - begin; ++i) {
      const double error = fabs(is[i] - should[i]) * length[i];
      const double field = should[i] * length[i];
      sums->error2 += error * error;
      sums->field2 += field * field;
      sums->max = fmax(sums->max, error);
      count_error(sums, 0, error);
    }
    for (size_t i = 0; work->scales != NULL && i < end - begin; ++i) {
      const double *s = work->scales + 2 * d;
      const double error = fabs(s[1] * is[i] - s[0] * should[i]) * length[i];
      sums->error_mm2 += error * error;
      sums->max_mm = fmax(sums->max_mm, error);
      count_error(sums, 1, error);
    }
  }
}

static void compare_range(void *context, size_t begin, size_t end, size_t thread) {
  const accuracy_work *work = context;
  for (size_t first = begin; first < end; first += BLOCK) {
    compare_block(work, &work->tallies[thread], first, first + BLOCK < end ? first + BLOCK : end);
  }
}

/* The value that 95 % of the counts of all threads lie below: the upper edge of its bin. */
static double percentile95(const tally *tallies, size_t threads, size_t which) {
  uint64_t total = 0;
  for (size_t b = 0; b < BIN_COUNT; ++b) {
    for (size_t t = 0; t < threads; ++t) {
      total += tallies[t].bins[which][b];
    }
  }
  const uint64_t wanted = total - total / 20;
  uint64_t seen = 0;
  for (size_t b = 0; b < BIN_COUNT; ++b) {
    for (size_t t = 0; t < threads; ++t) {
      seen += tallies[t].bins[which][b];
    }
    if (seen >= wanted) {
      const uint32_t bits = (uint32_t)(b + 1) << BIN_SHIFT;
      float value;
      memcpy(&value, &bits, sizeof value);
      return (double)value;
    }
  }
  return 0.0;
}

/* Breath scales at which both sides gain `volume`; false where some direction does not reach it. */
static bool find_scales(const supine_truth *truth, const supine_volume_forms *forms,
                        const double *weights, double volume, double *scales) {
  for (size_t d = 0; d < truth->direction_count; ++d) {
    double cubic[3];
    supine_volume_forms_contract(forms, weights + d * forms->column_count, cubic);
    if (supine_volume_scale(truth->cubic + 3 * d, volume, &scales[2 * d], NULL) != SUPINE_OK ||
        supine_volume_scale(cubic, volume, &scales[2 * d + 1], NULL) != SUPINE_OK) {
      return false;
    }
  }
  return true;
}

/* Weights of the modes at every direction: [D, K] = Y [D, P] modes^T. */
static supine_status find_weights(const supine_truth *truth, const supine_compression *compression,
                                  double *weights) {
  const size_t terms = supine_sh_count(compression->band);
  double *y = malloc(terms * sizeof *y);
  if (y == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_status status = SUPINE_OK;
  for (size_t d = 0; d < truth->direction_count && status == SUPINE_OK; ++d) {
    status = supine_sh_evaluate(compression->band, truth->directions + 3 * d, y);
    for (size_t k = 0; k < compression->mode_count && status == SUPINE_OK; ++k) {
      double sum = 0.0;
      for (size_t t = 0; t < terms; ++t) {
        sum += compression->modes[k * terms + t] * y[t];
      }
      weights[d * compression->mode_count + k] = sum;
    }
  }
  free(y);
  return status;
}

supine_status supine_accuracy_measure(const supine_truth *truth,
                                      const supine_compression *compression,
                                      const double *directions, const supine_volume_forms *forms,
                                      double volume, supine_accuracy *accuracy,
                                      supine_error *error) {
  const size_t count = truth->direction_count;
  const size_t n = compression->vertex_count;
  const size_t threads = supine_thread_count();
  const bool closed = forms != NULL && truth->cubic != NULL;
  double *weights = malloc(count * compression->mode_count * sizeof *weights);
  double *scales = malloc(2 * count * sizeof *scales);
  tally *tallies = calloc(threads, sizeof *tallies);
  supine_accuracy made = {.direction_count = count};
  supine_status status = SUPINE_OK;
  if (weights == NULL || scales == NULL || tallies == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to measure the error");
    goto cleanup;
  }
  status = find_weights(truth, compression, weights);
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "held-out directions: %s", supine_status_string(status));
    goto cleanup;
  }
  if (closed) {
    made.volume = volume;
    for (int i = 0; !find_scales(truth, forms, weights, made.volume, scales); ++i) {
      if (i == VOLUME_HALVINGS) {
        status = supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                  "the lungs do not reach even %g mL before the surface folds",
                                  made.volume);
        goto cleanup;
      }
      made.volume *= 0.5;
    }
  }
  accuracy_work work = {truth, compression, directions, weights, closed ? scales : NULL, tallies};
  supine_parallel_for(n, BLOCK, threads, compare_range, &work);
  double error2 = 0.0;
  double field2 = 0.0;
  double error_mm2 = 0.0;
  for (size_t t = 0; t < threads; ++t) {
    error2 += tallies[t].error2;
    field2 += tallies[t].field2;
    error_mm2 += tallies[t].error_mm2;
    made.relative_max = fmax(made.relative_max, tallies[t].max);
    made.max_mm = fmax(made.max_mm, tallies[t].max_mm);
  }
  const double samples = (double)n * (double)count;
  const double field = sqrt(field2 / samples);
  made.relative_rms = sqrt(error2 / samples) / field;
  made.relative_p95 = percentile95(tallies, threads, 0) / field;
  made.relative_max /= field;
  made.rms_mm = sqrt(error_mm2 / samples);
  made.p95_mm = closed ? percentile95(tallies, threads, 1) : 0.0;
  *accuracy = made;
cleanup:
  free(weights);
  free(scales);
  free(tallies);
  return status;
}
