/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit functions of gravity and volume to runs by least squares, and predict runs that are left out.
 *
 * Let A be the pseudo-inverse of the matrix V of all runs, H = V A, and S a group of runs. Without
 * the runs of S, the pseudo-inverse is
 *
 *     A_S = A - A[:, S] (1 - H_SS)^-1 (1 - H)[S, :]                                          (1) */
#include <cblas.h>
#include <math.h>
#include <string.h>

#include <supine/sh.h>

#include "base/lapack.h"
#include "precompute/fields/regression.h"
#include "sh/expansion.h"

/* The runs determine a fit if the condition number of each part's matrix is at most
 * `condition_max`, and the smallest pivot of 1 - H_SS at least `free_min` for each group S: at 0,
 * the runs of the group would have no residual whatever their displacements. */
static const double condition_max = 100.0;
static const double free_min = 1e-3;

/* Compute the value of each term in each run of a part. */
static supine_status evaluate_terms(const supine_runs *runs, size_t part, size_t band, size_t order,
                                    double *values) {
  const size_t terms = supine_sh_terms(band, order);
  for (size_t run = 0; run < runs->count; ++run) {
    const double t = order == 0 ? 0.0 : runs->volume[part * runs->count + run];
    SUPINE_TRY(
        supine_sh_evaluate_products(band, order, runs->gravity + 3 * run, t, values + run * terms));
  }
  return SUPINE_OK;
}

/* Compute the pseudo-inverse of a matrix [runs, terms] of full column rank, and its condition
 * number. */
static supine_status invert(size_t runs, size_t terms, const double *values, double *pinv,
                            double *condition) {
  const int m = (int)runs;
  const int p = (int)terms;
  SUPINE_ARENA arena = {0};
  double *a = supine_arena_take(&arena, runs * terms, sizeof *a);
  double *u = supine_arena_take(&arena, runs * terms, sizeof *u);
  double *vt = supine_arena_take(&arena, terms * terms, sizeof *vt);
  double *s = supine_arena_zeros(&arena, terms, sizeof *s);
  SUPINE_TRY(supine_arena_status(&arena));
  memcpy(a, values, runs * terms * sizeof *a);
  SUPINE_TRY(
      supine_lapack_status(LAPACKE_dgesdd(LAPACK_ROW_MAJOR, 'S', m, p, a, p, s, u, p, vt, p)));
  *condition = s[terms - 1] > 0.0 ? s[0] / s[terms - 1] : INFINITY;
  for (size_t t = 0; t < terms; ++t) {
    cblas_dscal(p, 1.0 / s[t], vt + t * terms, 1);
  }
  cblas_dgemm(CblasRowMajor, CblasTrans, CblasTrans, p, m, p, 1.0, vt, p, u, p, 0.0, pinv, m);
  return SUPINE_OK;
}

supine_status supine_fields_regression_create(const supine_runs *runs, size_t band, size_t order,
                                              supine_arena *memory, supine_regression *made) {
  const size_t terms = supine_sh_terms(band, order);
  const size_t size = runs->count * terms;
  *made = (supine_regression){.run_count = runs->count,
                              .part_count = runs->part_count,
                              .band = band,
                              .order = order,
                              .terms = terms};
  made->values = supine_arena_take(memory, runs->part_count * size, sizeof(double));
  made->pinv = supine_arena_take(memory, runs->part_count * size, sizeof(double));
  SUPINE_TRY(supine_arena_status(memory));
  for (size_t part = 0; part < runs->part_count; ++part) {
    double condition = 0.0;
    double *values = made->values + part * size;
    SUPINE_TRY(evaluate_terms(runs, part, band, order, values));
    SUPINE_TRY(invert(runs->count, terms, values, made->pinv + part * size, &condition));
    made->condition = fmax(made->condition, condition);
  }
  return SUPINE_OK;
}

/* The runs of a group that is left out of one part. */
typedef struct left_out {
  const supine_regression *r;
  size_t part;
  size_t count;      /* number of runs of the group */
  const size_t *run; /* [count] */
} left_out;

static left_out leave(const supine_regression *r, const supine_run_groups *groups, size_t group,
                      size_t part) {
  const size_t begin = groups->begin[group];
  return (left_out){r, part, groups->begin[group + 1] - begin, groups->run + begin};
}

/* Compute the rows (1 - H)[S, :] of a group S, rows [count, runs], and factorise 1 - H_SS into
 * L L^T, factor [count, count]. Return the smallest diagonal element of L, or 0 if there is no such
 * factorisation. */
static double factorise(const left_out *s, double *rows, double *factor) {
  const supine_regression *r = s->r;
  const size_t m = r->run_count;
  const double *values = r->values + s->part * m * r->terms;
  const double *pinv = r->pinv + s->part * m * r->terms;
  for (size_t i = 0; i < s->count; ++i) {
    cblas_dgemv(CblasRowMajor, CblasTrans, (int)r->terms, (int)m, -1.0, pinv, (int)m,
                values + s->run[i] * r->terms, 1, 0.0, rows + i * m, 1);
    rows[i * m + s->run[i]] += 1.0;
  }
  for (size_t i = 0; i < s->count; ++i) {
    for (size_t j = 0; j < s->count; ++j) {
      factor[i * s->count + j] = rows[i * m + s->run[j]];
    }
  }
  /* The upper factor of columns is the lower one of rows. For columns, LAPACKE needs no memory. */
  if (LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'U', (lapack_int)s->count, factor, (lapack_int)s->count) !=
      0) {
    return 0.0;
  }
  double least = INFINITY;
  for (size_t i = 0; i < s->count; ++i) {
    least = fmin(least, factor[i * s->count + i]);
  }
  return least;
}

bool supine_fields_regression_is_determined(const supine_regression *regression,
                                            const supine_run_groups *groups) {
  const size_t m = regression->run_count;
  if (regression->condition > condition_max) {
    return false;
  }
  SUPINE_ARENA arena = {0};
  double *rows = supine_arena_take(&arena, m * m, sizeof *rows);
  double *factor = supine_arena_take(&arena, m * m, sizeof *factor);
  if (arena.failed) {
    return false;
  }
  for (size_t part = 0; part < regression->part_count; ++part) {
    for (size_t group = 0; group < groups->count; ++group) {
      const left_out s = leave(regression, groups, group, part);
      const double least = factorise(&s, rows, factor);
      if (least * least < free_min) {
        return false;
      }
    }
  }
  return true;
}

/* Subtract the product of values [runs, terms] and other [terms, runs] from a matrix [runs,
 * runs]. */
static void subtract_product(size_t runs, size_t terms, const double *values, const double *other,
                             double *matrix) {
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (int)runs, (int)runs, (int)terms, -1.0,
              values, (int)terms, other, (int)runs, 1.0, matrix, (int)runs);
}

supine_status supine_fields_regression_leave_each(const supine_regression *regression,
                                                  const double *gram, double *square) {
  const supine_regression *r = regression;
  const size_t m = r->run_count;
  SUPINE_ARENA arena = {0};
  double *rest = supine_arena_take(&arena, m * m, sizeof *rest);       /* 1 - H */
  double *product = supine_arena_take(&arena, m * m, sizeof *product); /* (1 - H) gram */
  double *inner = supine_arena_take(&arena, r->terms * m, sizeof *inner);
  SUPINE_TRY(supine_arena_status(&arena));
  memset(square, 0, m * sizeof *square);
  for (size_t part = 0; part < r->part_count; ++part) {
    const double *values = r->values + part * m * r->terms;
    const double *pinv = r->pinv + part * m * r->terms;
    memset(rest, 0, m * m * sizeof *rest);
    memcpy(product, gram + part * m * m, m * m * sizeof *product);
    for (size_t i = 0; i < m; ++i) {
      rest[i * m + i] = 1.0;
    }
    subtract_product(m, r->terms, values, pinv, rest);
    cblas_dsymm(CblasRowMajor, CblasRight, CblasUpper, (int)r->terms, (int)m, 1.0,
                gram + part * m * m, (int)m, pinv, (int)m, 0.0, inner, (int)m);
    subtract_product(m, r->terms, values, inner, product);
    for (size_t i = 0; i < m; ++i) { /* (1) for a group of one run */
      const double free = rest[i * m + i];
      if (free < free_min) {
        return SUPINE_ERROR_NUMERICAL;
      }
      const double sum = cblas_ddot((int)m, product + i * m, 1, rest + i * m, 1);
      square[i] += fmax(sum, 0.0) / (free * free);
    }
  }
  return SUPINE_OK;
}

/* Compute the pseudo-inverse without the runs of a group, pinv [terms, runs], by (1). */
static supine_status invert_without(const left_out *s, double *pinv) {
  const supine_regression *r = s->r;
  const size_t m = r->run_count;
  const size_t terms = r->terms;
  const double *whole = r->pinv + s->part * m * terms;
  SUPINE_ARENA arena = {0};
  double *rows = supine_arena_take(&arena, s->count * m, sizeof *rows);
  double *factor = supine_arena_take(&arena, s->count * s->count, sizeof *factor);
  double *columns = supine_arena_take(&arena, terms * s->count, sizeof *columns);
  SUPINE_TRY(supine_arena_status(&arena));
  if (factorise(s, rows, factor) == 0.0) {
    return SUPINE_ERROR_NUMERICAL;
  }
  SUPINE_TRY(supine_lapack_status(LAPACKE_dpotrs(LAPACK_ROW_MAJOR, 'L', (lapack_int)s->count,
                                                 (lapack_int)m, factor, (lapack_int)s->count, rows,
                                                 (lapack_int)m)));
  for (size_t t = 0; t < terms; ++t) {
    for (size_t j = 0; j < s->count; ++j) {
      columns[t * s->count + j] = whole[t * m + s->run[j]];
    }
  }
  memcpy(pinv, whole, terms * m * sizeof *pinv);
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (int)terms, (int)m, (int)s->count, -1.0,
              columns, (int)s->count, rows, (int)m, 1.0, pinv, (int)m);
  return SUPINE_OK;
}

/* Find the principal modes of the coefficients of all parts, vectors [modes, terms]: leading
 * eigenvectors of the sum over parts of pinv gram pinv^T. */
static supine_status find_modes(const supine_regression *r, const double *pinv, const double *gram,
                                size_t modes, double *vectors) {
  const int m = (int)r->run_count;
  const int p = (int)r->terms;
  const size_t size = r->run_count * r->terms;
  SUPINE_ARENA arena = {0};
  double *product = supine_arena_take(&arena, size, sizeof *product);
  double *sum = supine_arena_zeros(&arena, r->terms * r->terms, sizeof *sum);
  double *values = supine_arena_take(&arena, r->terms, sizeof *values);
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t part = 0; part < r->part_count; ++part) {
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, p, m, m, 1.0, pinv + part * size, m,
                gram + part * r->run_count * r->run_count, m, 0.0, product, m);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, p, p, m, 1.0, product, m,
                pinv + part * size, m, 1.0, sum, p);
  }
  return supine_sh_leading_eigenpairs(r->terms, sum, modes, values, vectors);
}

/* Principal modes to which a fit is compressed, and work space of a row of terms. */
typedef struct principal {
  size_t count;    /* 0 for none */
  double *vectors; /* [count, terms] */
  double *target;  /* [terms] work space */
} principal;

/* Compute the error of run `run` as a sum of the displacements of all runs: 1 for itself, minus
 * its terms, on the modes if there are any, times the pseudo-inverse of its part. */
static void find_residual(const supine_regression *r, size_t part, size_t run, const double *pinv,
                          const principal *modes, double *residual) {
  const int m = (int)r->run_count;
  const int p = (int)r->terms;
  const double *y = r->values + (part * r->run_count + run) * r->terms;
  if (modes->count > 0) {
    memset(modes->target, 0, r->terms * sizeof *modes->target);
  } else {
    memcpy(modes->target, y, r->terms * sizeof *modes->target);
  }
  for (size_t k = 0; k < modes->count; ++k) {
    const double *mode = modes->vectors + k * r->terms;
    cblas_daxpy(p, cblas_ddot(p, mode, 1, y, 1), mode, 1, modes->target, 1);
  }
  cblas_dgemv(CblasRowMajor, CblasTrans, p, m, -1.0, pinv, m, modes->target, 1, 0.0, residual, 1);
  residual[run] += 1.0;
}

supine_status supine_fields_regression_predict(const supine_regression *regression,
                                               const supine_run_groups *groups, size_t group,
                                               const double *gram, size_t modes, double *residual,
                                               double *square) {
  const supine_regression *r = regression;
  const size_t m = r->run_count;
  const size_t size = m * r->terms;
  SUPINE_ARENA arena = {0};
  double *pinv = supine_arena_take(&arena, r->part_count * size, sizeof *pinv);
  principal kept = {.count = modes < r->terms ? modes : r->terms};
  kept.vectors = supine_arena_take(&arena, kept.count * r->terms, sizeof *kept.vectors);
  kept.target = supine_arena_take(&arena, r->terms, sizeof *kept.target);
  double *product = supine_arena_take(&arena, m, sizeof *product);
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t part = 0; part < r->part_count; ++part) {
    const left_out s = leave(r, groups, group, part);
    SUPINE_TRY(invert_without(&s, pinv + part * size));
  }
  if (kept.count > 0) {
    SUPINE_TRY(find_modes(r, pinv, gram, kept.count, kept.vectors));
  }
  const left_out s = leave(r, groups, group, 0);
  memset(square, 0, s.count * sizeof *square);
  for (size_t part = 0; part < r->part_count; ++part) {
    for (size_t i = 0; i < s.count; ++i) {
      double *row = residual + (part * s.count + i) * m;
      find_residual(r, part, s.run[i], pinv + part * size, &kept, row);
      cblas_dsymv(CblasRowMajor, CblasUpper, (int)m, 1.0, gram + part * m * m, (int)m, row, 1, 0.0,
                  product, 1);
      square[i] += fmax(cblas_ddot((int)m, product, 1, row, 1), 0.0);
    }
  }
  return SUPINE_OK;
}
