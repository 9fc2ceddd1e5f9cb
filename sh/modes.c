/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the best modes of an expansion: singular vectors of the matrix of its harmonic coefficients.
 * Only small Gram matrices are decomposed. */
#include <cblas.h>
#include <math.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "base/lapack.h"
#include "sh/expansion.h"

/* Singular values below this share of the largest are rounding errors, because the Gram matrix
 * gives only their squares. */
static const double rank_tolerance = 1e-7;

/* Compute gram [rank, rank] = columns^T diag(weight) columns for the columns [N, rank] of the
 * expansion. Write only the lower triangle, in column-major order. */
static supine_status gram_matrix(const supine_expansion *expansion, const double *weight,
                                 double *gram) {
  enum { BLOCK = 1024 };
  const size_t rank = expansion->rank;
  SUPINE_ARENA arena = {0};
  double *block = supine_arena_take(&arena, BLOCK * rank, sizeof *block);
  SUPINE_TRY(supine_arena_status(&arena));
  memset(gram, 0, rank * rank * sizeof *gram);
  for (size_t first = 0; first < expansion->row_count; first += BLOCK) {
    const size_t left = expansion->row_count - first;
    const size_t count = left < BLOCK ? left : BLOCK;
    for (size_t i = 0; i < count; ++i) {
      const double root = weight != NULL ? sqrt(weight[first + i]) : 1.0;
      for (size_t r = 0; r < rank; ++r) {
        block[i * rank + r] = root * expansion->columns[(first + i) * rank + r];
      }
    }
    cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, (int)rank, (int)count, 1.0, block,
                (int)rank, 1.0, gram, (int)rank);
  }
  return SUPINE_OK;
}

supine_status supine_sh_leading_eigenpairs(size_t n, double *matrix, size_t count, double *values,
                                           double *vectors) {
  const lapack_int size = (lapack_int)n;
  lapack_int found = 0;
  SUPINE_ARENA arena = {0};
  lapack_int *support = supine_arena_take(&arena, 2 * n, sizeof *support);
  double *rising = supine_arena_take(&arena, n * count, sizeof *rising);
  SUPINE_TRY(supine_arena_status(&arena));
  SUPINE_TRY(supine_lapack_status(LAPACKE_dsyevr(LAPACK_COL_MAJOR, 'V', 'I', 'L', size, matrix,
                                                 size, 0.0, 0.0, size - (lapack_int)count + 1, size,
                                                 0.0, &found, values, rising, size, support)));
  if ((size_t)found != count) {
    return SUPINE_ERROR_NUMERICAL;
  }
  for (size_t k = 0; k < count; ++k) {
    memcpy(vectors + k * n, rising + (count - 1 - k) * n, n * sizeof *vectors);
  }
  for (size_t k = 0; k < count / 2; ++k) {
    const double swap = values[k];
    values[k] = values[count - 1 - k];
    values[count - 1 - k] = swap;
  }
  return SUPINE_OK;
}

/* Find the leading right singular vectors of C = sqrt(W) P Q, where W is the diagonal matrix of the
 * weights of the rows, P = expansion->columns [N, rank], and Q = expansion->functions [rank,
 * terms]. Write the vectors to modes [count, terms], all squared singular values to values [rank],
 * and their sum to `total`. gram [rank, rank] holds P^T W P and is overwritten. Steps:
 *
 * - P^T W P = H^T H, where the rows of H are its eigenvectors times the roots of their eigenvalues.
 * - A = H Q has the singular values sigma_k and right singular vectors of C, as A^T A = C^T C.
 * - A A^T has the eigenvalues sigma_k^2. With its eigenvectors U_k, mode k is A^T U_k / sigma_k. */
static supine_status find_modes(const supine_expansion *expansion, double *gram, size_t count,
                                double *values, double *modes, double *total) {
  const size_t rank = expansion->rank;
  const size_t terms = supine_sh_terms(expansion->band, expansion->order);
  SUPINE_ARENA arena = {0};
  double *vectors = supine_arena_take(&arena, rank * rank, sizeof *vectors);
  double *reduced = supine_arena_take(&arena, rank * terms, sizeof *reduced);
  SUPINE_TRY(supine_arena_status(&arena));
  SUPINE_TRY(supine_sh_leading_eigenpairs(rank, gram, rank, values, vectors));
  for (size_t k = 0; k < rank; ++k) {
    cblas_dscal((int)rank, sqrt(fmax(values[k], 0.0)), vectors + k * rank, 1);
  }
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (int)rank, (int)terms, (int)rank, 1.0,
              vectors, (int)rank, expansion->functions, (int)terms, 0.0, reduced, (int)terms);
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)rank, (int)rank, (int)terms, 1.0,
              reduced, (int)terms, reduced, (int)terms, 0.0, gram, (int)rank);
  *total = 0.0;
  for (size_t r = 0; r < rank; ++r) {
    *total += gram[r * rank + r];
  }
  SUPINE_TRY(supine_sh_leading_eigenpairs(rank, gram, rank, values, vectors));
  for (size_t k = 0; k < count; ++k) {
    const double inverse = values[k] > 0.0 ? 1.0 / sqrt(values[k]) : 0.0;
    cblas_dgemv(CblasRowMajor, CblasTrans, (int)rank, (int)terms, inverse, reduced, (int)terms,
                vectors + k * rank, 1, 0.0, modes + k * terms, 1);
  }
  return SUPINE_OK;
}

supine_status supine_sh_compress_modes(const supine_expansion *expansion, const double *weight,
                                       size_t mode_max, supine_compression *compression,
                                       double *singular, double *total, supine_error *error) {
  const size_t rank = expansion->rank;
  const size_t terms = supine_sh_terms(expansion->band, expansion->order);
  const size_t most = mode_max < rank ? mode_max : rank;
  const size_t kept = most < terms ? most : terms;
  double energy = 0.0;
  SUPINE_REFUSE_IF(mode_max < 1 || mode_max > SUPINE_MODES_MADE_MAX, error, SUPINE_ERROR_ARGUMENT,
                   "%zu modes: give 1 to %d", mode_max, SUPINE_MODES_MADE_MAX);
  SUPINE_ARENA arena = {0};
  double *gram = supine_arena_take(&arena, rank * rank, sizeof *gram);
  double *values = supine_arena_take(&arena, rank, sizeof *values);
  double *modes = supine_arena_take(&arena, kept * terms, sizeof *modes);
  supine_status status = arena.failed ? SUPINE_ERROR_MEMORY : gram_matrix(expansion, weight, gram);
  if (status == SUPINE_OK) {
    status = find_modes(expansion, gram, kept, values, modes, &energy);
  }
  SUPINE_REFUSE_IF(status != SUPINE_OK, error, status, "modes of band %zu: %s", expansion->band,
                   supine_status_string(status));
  size_t count = 0;
  while (count < kept && values[count] > rank_tolerance * rank_tolerance * values[0]) {
    ++count;
  }
  SUPINE_REFUSE_IF(count == 0, error, SUPINE_ERROR_NUMERICAL, "the field is zero everywhere");
  if (supine_sh_compression_create(expansion, count, compression) != SUPINE_OK) {
    return supine_error_memory(error, "%zu modes", count);
  }
  memcpy(compression->modes, modes, count * terms * sizeof *modes);
  supine_sh_compression_mix(expansion, compression);
  if (singular != NULL) {
    for (size_t k = 0; k < mode_max; ++k) {
      singular[k] = k < count ? sqrt(values[k]) : 0.0;
    }
  }
  if (total != NULL) {
    *total = energy;
  }
  return SUPINE_OK;
}
