/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compress rows to a few functions of the direction, and evaluate the result. */
#include <cblas.h>
#include <stdlib.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "base/remedy.h"
#include "sh/expansion.h"

void supine_sh_compression_free(supine_compression *compression) {
  free(compression->coefficients);
  free(compression->modes);
  free(compression->mix);
  *compression = (supine_compression){0};
}

supine_status supine_sh_compression_create(const supine_expansion *expansion, size_t mode_count,
                                           supine_compression *made) {
  *made = (supine_compression){.row_count = expansion->row_count,
                               .band = expansion->band,
                               .order = expansion->order,
                               .mode_count = mode_count};
  made->coefficients = malloc(expansion->row_count * mode_count * sizeof(float));
  made->modes =
      calloc(mode_count * supine_sh_terms(expansion->band, expansion->order), sizeof(double));
  made->mix = calloc(expansion->rank * mode_count, sizeof(double));
  return made->coefficients != NULL && made->modes != NULL && made->mix != NULL
             ? SUPINE_OK
             : SUPINE_ERROR_MEMORY;
}

typedef struct mix_work {
  const supine_expansion *expansion;
  supine_compression *made;
} mix_work;

static void mix_range(void *context, size_t begin, size_t end, size_t thread) {
  enum { BLOCK = 128 };
  const mix_work *work = context;
  const int rank = (int)work->expansion->rank;
  const size_t count = work->made->mode_count;
  double block[BLOCK * SUPINE_MODES_MADE_MAX];
  (void)thread;
  for (size_t i = begin; i < end; i += BLOCK) {
    const size_t n = end - i < BLOCK ? end - i : BLOCK;
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (int)n, (int)count, rank, 1.0,
                work->expansion->columns + i * work->expansion->rank, rank, work->made->mix,
                (int)count, 0.0, block, (int)count);
    for (size_t k = 0; k < n * count; ++k) {
      work->made->coefficients[i * count + k] = (float)block[k];
    }
  }
}

void supine_sh_compression_mix(const supine_expansion *expansion, supine_compression *made) {
  const int terms = (int)supine_sh_terms(expansion->band, expansion->order);
  const int count = (int)made->mode_count;
  mix_work work = {expansion, made};
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)expansion->rank, count, terms, 1.0,
              expansion->functions, terms, made->modes, terms, 0.0, made->mix, count);
  supine_parallel_for(expansion->row_count, 1024, 0, mix_range, &work);
}

supine_status supine_sh_compress_harmonics(const supine_expansion *expansion,
                                           supine_compression *compression, supine_error *error) {
  const size_t terms = supine_sh_terms(expansion->band, expansion->order);
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_give("modes", "16", ""),
                                                     supine_remedy_give("band", "7", "")};
  SUPINE_REFUSE_ADVISE(terms > SUPINE_MODES_MADE_MAX, error, advice, SUPINE_ERROR_ARGUMENT,
                       "band %zu has %zu functions, but a basis file holds at most %d",
                       expansion->band, terms, SUPINE_MODES_MADE_MAX);
  if (supine_sh_compression_create(expansion, terms, compression) != SUPINE_OK) {
    return supine_error_memory(error, "%zu harmonics", terms);
  }
  for (size_t t = 0; t < terms; ++t) {
    compression->modes[t * terms + t] = 1.0;
  }
  supine_sh_compression_mix(expansion, compression);
  return SUPINE_OK;
}

/* Keep the first `count` of `width` values of `size` bytes in each row, and close the gaps. */
static void keep_columns(void *data, size_t rows, size_t width, size_t count, size_t size) {
  unsigned char *bytes = data;
  for (size_t r = 1; r < rows; ++r) {
    memmove(bytes + r * count * size, bytes + r * width * size, count * size);
  }
}

size_t supine_sh_modes_needed(size_t count, const double *singular, double total, double error) {
  static const double same_error = 1.01;
  const double limit = (same_error * same_error - 1.0) * error * error;
  double dropped = 0.0;
  do {
    --count;
    dropped += singular[count] * singular[count] / total;
  } while (count > 0 && dropped <= limit);
  return count + 1;
}

void supine_sh_compression_truncate(supine_compression *compression, size_t rank, size_t count) {
  const size_t width = compression->mode_count;
  if (count < width) {
    keep_columns(compression->coefficients, compression->row_count, width, count, sizeof(float));
    keep_columns(compression->mix, rank, width, count, sizeof(double));
    compression->mode_count = count;
  }
}

void supine_sh_compression_weights(const supine_compression *compression, const double g[3],
                                   double *weights) {
  supine_sh_compression_weights_at(compression, g, 0.0, weights);
}

void supine_sh_compression_weights_at(const supine_compression *compression, const double g[3],
                                      double t, double *weights) {
  double y[(SUPINE_SH_BAND_MAX + 1) * (SUPINE_SH_BAND_MAX + 1)] = {0.0};
  const size_t terms = supine_sh_terms(compression->band, compression->order);
  /* This cannot fail: g is a unit vector, and expansions of an order have at most as many terms as
   * harmonics of the highest band. */
  (void)supine_sh_evaluate_products(compression->band, compression->order, g, t, y);
  for (size_t k = 0; k < compression->mode_count; ++k) {
    weights[k] = 0.0;
    for (size_t i = 0; i < terms; ++i) {
      weights[k] += compression->modes[k * terms + i] * y[i];
    }
  }
}
