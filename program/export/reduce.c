/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The best few targets.
 *
 * With U the displacements [3N, K] and M the modes, the field is U M Y. Y is orthonormal, so its
 * mean square is that of U M; with M M^T = S = H H, H symmetric, U M = (U H) (H^-1 M) and H^-1 M
 * has orthonormal rows. So the eigenvectors V of H (U^T U) H by descending eigenvalue give
 *
 *     mix = H V        modes = V^T H^-1 M        lost: the eigenvalues left out */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "sh/base/vec3.h"

#include "program/export/targets.h"

/* U^T U [K, K]. */
static void gram(const export_source *source, double *sum) {
  const size_t k = source->info->mode_count;
  double u[SUPINE_MODES_MAX][3];
  memset(sum, 0, k * k * sizeof *sum);
  for (size_t i = 0; i < source->info->vertex_count; ++i) {
    for (size_t a = 0; a < k; ++a) {
      supine_export_field(source, i, a, u[a]);
    }
    for (size_t a = 0; a < k; ++a) {
      for (size_t b = 0; b < k; ++b) {
        sum[a * k + b] += supine_dot(u[a], u[b]);
      }
    }
  }
}

/* Replaces a symmetric matrix by its eigenvectors, one a row, by ascending eigenvalue. */
static bool eigen(size_t k, double *symmetric, double *values) {
  return LAPACKE_dsyevd(LAPACK_COL_MAJOR, 'V', 'L', (lapack_int)k, symmetric, (lapack_int)k,
                        values) == 0;
}

/* root = sum of value^exponent v v^T, where values that are 0 to rounding count as 0. */
static void power(size_t k, const double *values, const double *vectors, double exponent,
                  double *root) {
  memset(root, 0, k * k * sizeof *root);
  for (size_t i = 0; i < k; ++i) {
    if (values[i] > 1e-12 * values[k - 1]) {
      const double *v = vectors + i * k;
      cblas_dger(CblasRowMajor, (int)k, (int)k, pow(values[i], exponent), v, 1, v, 1, root, (int)k);
    }
  }
}

/* The square matrices of the reduction, and the eigenvalues. */
typedef struct matrices {
  double gram[SUPINE_MODES_MAX * SUPINE_MODES_MAX];
  double square[SUPINE_MODES_MAX * SUPINE_MODES_MAX]; /* then eigenvectors */
  double half[SUPINE_MODES_MAX * SUPINE_MODES_MAX];
  double inverse[SUPINE_MODES_MAX * SUPINE_MODES_MAX];
  double product[SUPINE_MODES_MAX * SUPINE_MODES_MAX];
  double values[SUPINE_MODES_MAX];
} matrices;

static bool reduce(const export_source *source, matrices *m, export_targets *targets) {
  const size_t modes = source->info->mode_count;
  const int k = (int)modes;
  const int count = (int)targets->mixes;
  const int terms = (int)source->terms;
  gram(source, m->gram);
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, k, k, terms, 1, source->modes, terms,
              source->modes, terms, 0, m->square, k);
  if (!eigen(modes, m->square, m->values)) {
    return false;
  }
  power(modes, m->values, m->square, 0.5, m->half);
  power(modes, m->values, m->square, -0.5, m->inverse);
  cblas_dsymm(CblasRowMajor, CblasRight, CblasLower, k, k, 1, m->half, k, m->gram, k, 0, m->product,
              k);
  cblas_dsymm(CblasRowMajor, CblasLeft, CblasLower, k, k, 1, m->half, k, m->product, k, 0,
              m->square, k);
  if (!eigen(modes, m->square, m->values)) {
    return false;
  }
  double all = 0;
  double lost = 0;
  for (int i = 0; i < k; ++i) {
    all += fmax(m->values[i], 0);
    lost += i < k - count ? fmax(m->values[i], 0) : 0;
  }
  targets->loss_percent = all > 0 ? 100 * sqrt(lost / all) : 0;
  for (int j = 0; j < count; ++j) {
    const double *v = m->square + (k - 1 - j) * k;
    cblas_dsymv(CblasRowMajor, CblasLower, k, 1, m->half, k, v, 1, 0, targets->mix + j, count);
    cblas_dsymv(CblasRowMajor, CblasLower, k, 1, m->inverse, k, v, 1, 0, m->product, 1);
    cblas_dgemv(CblasRowMajor, CblasTrans, k, terms, 1, source->modes, terms, m->product, 1, 0,
                targets->modes + j * terms, 1);
  }
  return true;
}

supine_status supine_export_targets_reduce(const export_source *source, size_t limit,
                                           export_targets *targets, supine_error *error) {
  const size_t k = source->info->mode_count;
  matrices *m = malloc(sizeof *m);
  if (m == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  targets->mixes = limit < k ? limit : k;
  targets->mixed = true;
  const bool found = reduce(source, m, targets);
  free(m);
  return found ? SUPINE_OK
               : supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                  "the best %zu targets were not found: take profile raw", limit);
}
