/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compress a field to a few functions of the direction of gravity, and evaluate the result. */
#include <cblas.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/projection/projection.h"
#include "sh/base/parallel.h"
#include <supine/sh.h>

void supine_projection_compression_free(supine_compression *compression) {
  free(compression->coefficients);
  free(compression->modes);
  free(compression->mix);
  *compression = (supine_compression){0};
}

supine_status supine_projection_compression_create(const supine_projection *projection,
                                                   size_t mode_count, supine_compression *made) {
  *made = (supine_compression){
      .vertex_count = projection->vertex_count, .band = projection->band, .mode_count = mode_count};
  made->coefficients = malloc(projection->vertex_count * mode_count * sizeof(float));
  made->modes = calloc(mode_count * supine_sh_count(projection->band), sizeof(double));
  made->mix = calloc(projection->rank * mode_count, sizeof(double));
  if (made->coefficients == NULL || made->modes == NULL || made->mix == NULL) {
    supine_projection_compression_free(made);
    return SUPINE_ERROR_MEMORY;
  }
  return SUPINE_OK;
}

typedef struct mix_work {
  const supine_projection *projection;
  supine_compression *made;
} mix_work;

static void mix_range(void *context, size_t begin, size_t end, size_t thread) {
  enum { BLOCK = 128 };
  const mix_work *work = context;
  const int rank = (int)work->projection->rank;
  const size_t count = work->made->mode_count;
  double block[BLOCK * SUPINE_MODES_MADE_MAX];
  (void)thread;
  for (size_t i = begin; i < end; i += BLOCK) {
    const size_t n = end - i < BLOCK ? end - i : BLOCK;
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (int)n, (int)count, rank, 1.0,
                work->projection->columns + i * work->projection->rank, rank, work->made->mix,
                (int)count, 0.0, block, (int)count);
    for (size_t k = 0; k < n * count; ++k) {
      work->made->coefficients[i * count + k] = (float)block[k];
    }
  }
}

void supine_projection_compression_mix(const supine_projection *projection,
                                       supine_compression *made) {
  const int terms = (int)supine_sh_count(projection->band);
  const int count = (int)made->mode_count;
  mix_work work = {projection, made};
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)projection->rank, count, terms, 1.0,
              projection->functions, terms, made->modes, terms, 0.0, made->mix, count);
  supine_parallel_for(projection->vertex_count, 1024, 0, mix_range, &work);
}

supine_status supine_projection_compress_harmonics(const supine_projection *projection,
                                                   supine_compression *compression,
                                                   supine_error *error) {
  const size_t terms = supine_sh_count(projection->band);
  if (terms > SUPINE_MODES_MADE_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "band %zu has %zu harmonics, but a basis file holds at most %d: "
                            "give --modes 16, or --band 7 or less",
                            projection->band, terms, SUPINE_MODES_MADE_MAX);
  }
  supine_compression made;
  if (supine_projection_compression_create(projection, terms, &made) != SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu harmonics", terms);
  }
  for (size_t t = 0; t < terms; ++t) {
    made.modes[t * terms + t] = 1.0;
  }
  supine_projection_compression_mix(projection, &made);
  *compression = made;
  return SUPINE_OK;
}

/* Keep the first `count` of `width` values of `size` bytes in each row, and close the gaps. */
static void keep_columns(void *data, size_t rows, size_t width, size_t count, size_t size) {
  unsigned char *bytes = data;
  for (size_t r = 1; r < rows; ++r) {
    memmove(bytes + r * count * size, bytes + r * width * size, count * size);
  }
}

size_t supine_projection_modes_needed(size_t count, const double *singular, double total,
                                      double error) {
  static const double same_error = 1.01;
  const double limit = (same_error * same_error - 1.0) * error * error;
  double dropped = 0.0;
  while (count > 1) {
    dropped += singular[count - 1] * singular[count - 1] / total;
    if (dropped > limit) {
      break;
    }
    --count;
  }
  return count;
}

void supine_projection_compression_truncate(supine_compression *compression, size_t rank,
                                            size_t count) {
  const size_t width = compression->mode_count;
  if (count < width) {
    keep_columns(compression->coefficients, compression->vertex_count, width, count, sizeof(float));
    keep_columns(compression->mix, rank, width, count, sizeof(double));
    compression->mode_count = count;
  }
}

void supine_projection_compression_weights(const supine_compression *compression, const double g[3],
                                           double *weights) {
  double y[(SUPINE_SH_BAND_MAX + 1) * (SUPINE_SH_BAND_MAX + 1)] = {0.0};
  const size_t terms = supine_sh_count(compression->band);
  (void)supine_sh_evaluate(compression->band, g, y); /* cannot fail: g is a unit vector */
  for (size_t k = 0; k < compression->mode_count; ++k) {
    weights[k] = 0.0;
    for (size_t t = 0; t < terms; ++t) {
      weights[k] += compression->modes[k * terms + t] * y[t];
    }
  }
}

void supine_projection_compression_field(const supine_compression *compression,
                                         const double *weights, double *field) {
  for (size_t i = 0; i < compression->vertex_count; ++i) {
    const float *c = compression->coefficients + i * compression->mode_count;
    field[i] = 0.0;
    for (size_t k = 0; k < compression->mode_count; ++k) {
      field[i] += weights[k] * (double)c[k];
    }
  }
}

supine_status supine_projection_compression_volume_forms(
    const supine_compression *compression, const supine_lungs *lungs, const double *share,
    const double *directions, supine_volume_forms *forms, supine_error *error) {
  const size_t count = compression->mode_count;
  const size_t values = compression->vertex_count * count;
  double *columns = malloc(values * sizeof *columns);
  if (columns == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY,
                            "no memory for volume coefficients of %zu modes", count);
  }
  for (size_t i = 0; i < values; ++i) {
    columns[i] = (double)compression->coefficients[i];
  }
  const supine_status status =
      supine_physics_volume_forms_create(lungs, share, directions, columns, count, forms, error);
  free(columns);
  return status;
}
