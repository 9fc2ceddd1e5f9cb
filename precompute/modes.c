/* SPDX-License-Identifier: GPL-3.0-or-later */
/* From projected columns to the functions of orientation that run time evaluates. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_blas.h>
#include <gsl/gsl_eigen.h>

#include <supine/parallel.h>
#include <supine/projection.h>
#include <supine/sh.h>

#include "internal.h"

/* Singular values below this share of the first are rounding. */
static const double rank_tolerance = 1e-7;

void supine_compression_free(supine_compression *compression) {
  free(compression->coefficients);
  free(compression->modes);
  free(compression->mix);
  *compression = (supine_compression){0};
}

typedef struct mix_work {
  const supine_projection *projection;
  supine_compression *compression;
} mix_work;

/* coefficients = columns x mix, row by row. */
SUPINE_CLONES static void mix_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const mix_work *work = context;
  const size_t rank = work->projection->rank;
  const size_t count = work->compression->mode_count;
  double sums[SUPINE_MODES_MADE_MAX];
  for (size_t i = begin; i < end; ++i) {
    const double *row = work->projection->columns + i * rank;
    for (size_t k = 0; k < count; ++k) {
      sums[k] = 0.0;
    }
    for (size_t r = 0; r < rank; ++r) {
      const double *mix = work->compression->mix + r * count;
      for (size_t k = 0; k < count; ++k) {
        sums[k] += row[r] * mix[k];
      }
    }
    float *out = work->compression->coefficients + i * count;
    for (size_t k = 0; k < count; ++k) {
      out[k] = (float)sums[k];
    }
  }
}

static supine_status compression_create(const supine_projection *projection, size_t mode_count,
                                        supine_compression *made) {
  *made = (supine_compression){
      .vertex_count = projection->vertex_count, .band = projection->band, .mode_count = mode_count};
  made->coefficients = malloc(projection->vertex_count * mode_count * sizeof(float));
  made->modes = calloc(mode_count * supine_sh_count(projection->band), sizeof(double));
  made->mix = calloc(projection->rank * mode_count, sizeof(double));
  if (made->coefficients == NULL || made->modes == NULL || made->mix == NULL) {
    supine_compression_free(made);
    return SUPINE_ERROR_MEMORY;
  }
  return SUPINE_OK;
}

static void mix_columns(const supine_projection *projection, supine_compression *made) {
  mix_work work = {projection, made};
  supine_parallel_for(projection->vertex_count, 1024, 0, mix_range, &work);
}

/* functions[r, t], which are the identity where they are not stored. */
static double function_at(const supine_projection *projection, size_t r, size_t t) {
  return projection->functions != NULL
             ? projection->functions[r * supine_sh_count(projection->band) + t]
             : (double)(r == t);
}

supine_status supine_compress_harmonics(const supine_projection *projection,
                                        supine_compression *compression, supine_error *error) {
  const size_t terms = supine_sh_count(projection->band);
  if (terms > SUPINE_MODES_MADE_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "band %zu has %zu harmonics, and a basis holds at most %d functions: "
                            "ask for modes instead, or for band 7 or less",
                            projection->band, terms, SUPINE_MODES_MADE_MAX);
  }
  supine_compression made;
  if (compression_create(projection, terms, &made) != SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu harmonics", terms);
  }
  for (size_t t = 0; t < terms; ++t) {
    made.modes[t * terms + t] = 1.0;
    for (size_t r = 0; r < projection->rank; ++r) {
      made.mix[r * terms + t] = function_at(projection, r, t);
    }
  }
  mix_columns(projection, &made);
  *compression = made;
  return SUPINE_OK;
}

typedef struct gram_work {
  const supine_projection *projection;
  const double *weight;
  double *partial; /* [threads, R, R] */
} gram_work;

/* Upper triangle of columns^T diag(weight) columns over a piece of the vertices. */
SUPINE_CLONES static void gram_range(void *context, size_t begin, size_t end, size_t thread) {
  const gram_work *work = context;
  const size_t rank = work->projection->rank;
  double *gram = work->partial + thread * rank * rank;
  for (size_t i = begin; i < end; ++i) {
    const double *row = work->projection->columns + i * rank;
    const double weight = work->weight != NULL ? work->weight[i] : 1.0;
    for (size_t a = 0; a < rank; ++a) {
      const double scaled = weight * row[a];
      for (size_t b = a; b < rank; ++b) {
        gram[a * rank + b] += scaled * row[b];
      }
    }
  }
}

static supine_status gram_matrix(const supine_projection *projection, const double *weight,
                                 gsl_matrix *gram) {
  const size_t rank = projection->rank;
  const size_t threads = supine_thread_count();
  gram_work work = {projection, weight, calloc(threads * rank * rank, sizeof(double))};
  if (work.partial == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_parallel_for(projection->vertex_count, 1024, threads, gram_range, &work);
  for (size_t a = 0; a < rank; ++a) {
    for (size_t b = a; b < rank; ++b) {
      double sum = 0.0;
      for (size_t t = 0; t < threads; ++t) {
        sum += work.partial[(t * rank + a) * rank + b];
      }
      gsl_matrix_set(gram, a, b, sum);
      gsl_matrix_set(gram, b, a, sum);
    }
  }
  free(work.partial);
  return SUPINE_OK;
}

/* Symmetric eigenproblem, eigenvalues falling; destroys `matrix`. */
static int eigen(gsl_matrix *matrix, gsl_vector *values, gsl_matrix *vectors) {
  gsl_eigen_symmv_workspace *workspace = gsl_eigen_symmv_alloc(matrix->size1);
  if (workspace == NULL) {
    return -1;
  }
  const int result = gsl_eigen_symmv(matrix, values, vectors, workspace);
  gsl_eigen_symmv_free(workspace);
  return result != 0 ? result : gsl_eigen_symmv_sort(values, vectors, GSL_EIGEN_SORT_VAL_DESC);
}

/* With G = columns^T W columns = H H^T, the weighted coefficient matrix C = columns x functions has
 * the singular values of A = H^T functions and its right singular vectors. A has R rows only:
 * they come from the R x R eigenproblem of A A^T. */
supine_status supine_compress_modes(const supine_projection *projection, const double *weight,
                                    size_t mode_max, supine_compression *compression,
                                    double *singular, double *total, supine_error *error) {
  const size_t rank = projection->rank;
  const size_t terms = supine_sh_count(projection->band);
  supine_status status = SUPINE_OK;
  if (mode_max < 1 || mode_max > SUPINE_MODES_MADE_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "%zu modes asked, 1 to %d are possible",
                            mode_max, SUPINE_MODES_MADE_MAX);
  }
  gsl_matrix *gram = gsl_matrix_alloc(rank, rank);
  gsl_matrix *root = gsl_matrix_alloc(rank, rank);
  gsl_matrix *vectors = gsl_matrix_alloc(rank, rank);
  gsl_vector *values = gsl_vector_alloc(rank);
  gsl_matrix *functions = gsl_matrix_alloc(rank, terms);
  gsl_matrix *reduced = gsl_matrix_alloc(rank, terms);
  supine_compression made = {0};
  if (gram == NULL || root == NULL || vectors == NULL || values == NULL || functions == NULL ||
      reduced == NULL || gram_matrix(projection, weight, gram) != SUPINE_OK) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for modes of band %zu",
                              projection->band);
    goto cleanup;
  }
  for (size_t r = 0; r < rank; ++r) {
    for (size_t t = 0; t < terms; ++t) {
      gsl_matrix_set(functions, r, t, function_at(projection, r, t));
    }
  }
  if (eigen(gram, values, vectors) != 0) {
    status = supine_error_set(error, SUPINE_ERROR_NUMERICAL, "eigenvalues did not converge");
    goto cleanup;
  }
  for (size_t a = 0; a < rank; ++a) { /* H = vectors sqrt(values) */
    for (size_t b = 0; b < rank; ++b) {
      gsl_matrix_set(root, a, b,
                     gsl_matrix_get(vectors, a, b) * sqrt(fmax(gsl_vector_get(values, b), 0.0)));
    }
  }
  (void)gsl_blas_dgemm(CblasTrans, CblasNoTrans, 1.0, root, functions, 0.0, reduced);
  (void)gsl_blas_dgemm(CblasNoTrans, CblasTrans, 1.0, reduced, reduced, 0.0, gram);
  if (eigen(gram, values, vectors) != 0) {
    status = supine_error_set(error, SUPINE_ERROR_NUMERICAL, "eigenvalues did not converge");
    goto cleanup;
  }
  const double first = gsl_vector_get(values, 0);
  if (!(first > 0.0)) {
    status = supine_error_set(error, SUPINE_ERROR_NUMERICAL, "the field is zero everywhere");
    goto cleanup;
  }
  size_t count = 0;
  double sum = 0.0;
  for (size_t k = 0; k < rank; ++k) {
    const double value = gsl_vector_get(values, k);
    sum += fmax(value, 0.0);
    if (count == k && k < mode_max && k < terms &&
        value > rank_tolerance * rank_tolerance * first) {
      ++count;
    }
  }
  if (compression_create(projection, count, &made) != SUPINE_OK) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu modes", count);
    goto cleanup;
  }
  for (size_t k = 0; k < count; ++k) { /* V_k = A^T U_k / sigma_k */
    double *mode = made.modes + k * terms;
    gsl_vector_view out = gsl_vector_view_array(mode, terms);
    gsl_vector_const_view u = gsl_matrix_const_column(vectors, k);
    (void)gsl_blas_dgemv(CblasTrans, 1.0 / sqrt(gsl_vector_get(values, k)), reduced, &u.vector, 0.0,
                         &out.vector);
    for (size_t r = 0; r < rank; ++r) {
      gsl_vector_const_view row = gsl_matrix_const_row(functions, r);
      (void)gsl_blas_ddot(&row.vector, &out.vector, &made.mix[r * count + k]);
    }
  }
  mix_columns(projection, &made);
  for (size_t k = 0; singular != NULL && k < mode_max; ++k) {
    singular[k] = k < count ? sqrt(gsl_vector_get(values, k)) : 0.0;
  }
  if (total != NULL) {
    *total = sum;
  }
  *compression = made;
cleanup:
  gsl_matrix_free(gram);
  gsl_matrix_free(root);
  gsl_matrix_free(vectors);
  gsl_vector_free(values);
  gsl_matrix_free(functions);
  gsl_matrix_free(reduced);
  return status;
}

/* Packs the first `count` of each row of `width` to the front. */
static void keep_columns(void *data, size_t rows, size_t width, size_t count, size_t size) {
  unsigned char *bytes = data;
  for (size_t r = 1; r < rows; ++r) {
    memmove(bytes + r * count * size, bytes + r * width * size, count * size);
  }
}

void supine_compression_truncate(supine_compression *compression, size_t rank, size_t count) {
  const size_t width = compression->mode_count;
  if (count < width) {
    keep_columns(compression->coefficients, compression->vertex_count, width, count, sizeof(float));
    keep_columns(compression->mix, rank, width, count, sizeof(double));
    compression->mode_count = count; /* modes are rows: the first ones stand where they should */
  }
}
