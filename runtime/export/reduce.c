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

#include <gsl/gsl_blas.h>
#include <gsl/gsl_eigen.h>

#include "sh/base/vec3.h"

#include "runtime/export/targets.h"

/* U^T U. */
static void gram(const export_source *source, gsl_matrix *sum) {
  const size_t k = source->info->mode_count;
  double u[SUPINE_MODES_MAX][3];
  gsl_matrix_set_zero(sum);
  for (size_t i = 0; i < source->info->vertex_count; ++i) {
    for (size_t a = 0; a < k; ++a) {
      supine_export_field(source, i, a, u[a]);
    }
    for (size_t a = 0; a < k; ++a) {
      for (size_t b = 0; b <= a; ++b) {
        *gsl_matrix_ptr(sum, a, b) += supine_dot(u[a], u[b]);
      }
    }
  }
  for (size_t a = 0; a < k; ++a) {
    for (size_t b = a + 1; b < k; ++b) {
      gsl_matrix_set(sum, a, b, gsl_matrix_get(sum, b, a));
    }
  }
}

/* Eigenvalues, descending, and vectors of `symmetric`, which is destroyed. */
static bool eigen(gsl_matrix *symmetric, gsl_vector *values, gsl_matrix *vectors) {
  gsl_eigen_symmv_workspace *workspace = gsl_eigen_symmv_alloc(values->size);
  const bool good = workspace != NULL &&
                    gsl_eigen_symmv(symmetric, values, vectors, workspace) == GSL_SUCCESS &&
                    gsl_eigen_symmv_sort(values, vectors, GSL_EIGEN_SORT_VAL_DESC) == GSL_SUCCESS;
  gsl_eigen_symmv_free(workspace);
  return good;
}

/* root = V diag(value^power) V^T, with values that are 0 to rounding left at 0. */
static void power(const gsl_vector *values, const gsl_matrix *vectors, double exponent,
                  gsl_matrix *root) {
  const double least = 1e-12 * gsl_vector_get(values, 0);
  gsl_matrix_set_zero(root);
  for (size_t i = 0; i < values->size; ++i) {
    const double value = gsl_vector_get(values, i);
    if (value > least) {
      const gsl_vector_const_view v = gsl_matrix_const_column(vectors, i);
      (void)gsl_blas_dger(pow(value, exponent), &v.vector, &v.vector, root);
    }
  }
}

enum { GRAM, SQUARE, HALF, INVERSE, VECTORS, WORK, MATRICES };

static bool reduce(const export_source *source, gsl_matrix **m, gsl_vector *values,
                   export_targets *targets) {
  const size_t k = source->info->mode_count;
  const size_t count = targets->count;
  const gsl_matrix_const_view modes = gsl_matrix_const_view_array(source->modes, k, source->terms);
  gram(source, m[GRAM]);
  (void)gsl_blas_dgemm(CblasNoTrans, CblasTrans, 1, &modes.matrix, &modes.matrix, 0, m[SQUARE]);
  if (!eigen(m[SQUARE], values, m[VECTORS])) {
    return false;
  }
  power(values, m[VECTORS], 0.5, m[HALF]);
  power(values, m[VECTORS], -0.5, m[INVERSE]);
  (void)gsl_blas_dgemm(CblasNoTrans, CblasNoTrans, 1, m[GRAM], m[HALF], 0, m[WORK]);
  (void)gsl_blas_dgemm(CblasNoTrans, CblasNoTrans, 1, m[HALF], m[WORK], 0, m[SQUARE]);
  if (!eigen(m[SQUARE], values, m[VECTORS])) {
    return false;
  }
  double all = 0;
  double lost = 0;
  for (size_t i = 0; i < k; ++i) {
    const double value = fmax(gsl_vector_get(values, i), 0);
    all += value;
    lost += i < count ? 0 : value;
  }
  targets->loss_percent = all > 0 ? 100 * sqrt(lost / all) : 0;
  gsl_matrix_view mix = gsl_matrix_view_array(targets->mix, k, count);
  gsl_matrix_view made = gsl_matrix_view_array(targets->modes, count, source->terms);
  const gsl_matrix_const_view best = gsl_matrix_const_submatrix(m[VECTORS], 0, 0, k, count);
  gsl_matrix_view turned = gsl_matrix_submatrix(m[WORK], 0, 0, k, count);
  (void)gsl_blas_dgemm(CblasNoTrans, CblasNoTrans, 1, m[HALF], &best.matrix, 0, &mix.matrix);
  (void)gsl_blas_dgemm(CblasNoTrans, CblasNoTrans, 1, m[INVERSE], &best.matrix, 0, &turned.matrix);
  (void)gsl_blas_dgemm(CblasTrans, CblasNoTrans, 1, &turned.matrix, &modes.matrix, 0, &made.matrix);
  return true;
}

supine_status supine_export_targets_reduce(const export_source *source, size_t limit,
                                           export_targets *targets, supine_error *error) {
  const size_t k = source->info->mode_count;
  gsl_matrix *m[MATRICES] = {NULL};
  supine_status status = SUPINE_ERROR_MEMORY;
  targets->count = limit < k ? limit : k;
  targets->mixed = true;
  gsl_vector *values = gsl_vector_alloc(k);
  bool there = values != NULL;
  for (size_t i = 0; i < MATRICES; ++i) {
    m[i] = gsl_matrix_alloc(k, k);
    there = there && m[i] != NULL;
  }
  if (!there) {
    (void)supine_error_set(error, status, "out of memory");
    goto cleanup;
  }
  status = reduce(source, m, values, targets)
               ? SUPINE_OK
               : supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                  "the best %zu targets were not found: take profile raw", limit);
cleanup:
  for (size_t i = 0; i < MATRICES; ++i) {
    gsl_matrix_free(m[i]);
  }
  gsl_vector_free(values);
  return status;
}
