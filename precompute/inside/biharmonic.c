/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit and evaluate the biharmonic interpolation: choose centres far apart, factorise one dense
 * matrix, sum over the centres. */
#include <cblas.h>
#include <lapacke.h>
#include <math.h>

#include "base/clones.h"
#include "base/parallel.h"
#include "base/vec3.h"

#include "precompute/inside/biharmonic.h"

/* AFFINE: number of affine terms (1, x, y, z). POINTS, CENTRES: numbers of points and centres
 * evaluated together. */
enum { AFFINE = 4, POINTS = 32, CENTRES = 64 };

/* Set fit->middle to the centre of the points' bounding box, and fit->unit to half its diagonal. */
static void frame(size_t count, const double *points, supine_inside_biharmonic *fit) {
  double low[3];
  double high[3];
  supine_box_begin(low, high);
  for (size_t i = 0; i < count; ++i) {
    supine_box_add(points + 3 * i, low, high);
  }
  for (int k = 0; k < 3; ++k) {
    fit->middle[k] = 0.5 * (low[k] + high[k]);
  }
  const double half = 0.5 * supine_distance(low, high);
  fit->unit = half > 0.0 ? half : 1.0;
}

/* Choose the centres: first the point farthest from fit->middle, then repeatedly the point whose
 * distance from its nearest centre is largest. */
SUPINE_CLONES static supine_status choose(size_t count, const double *points, size_t centre_max,
                                          supine_inside_biharmonic *fit) {
  SUPINE_ARENA arena = {0};
  double *distance = supine_arena_take(&arena, count, sizeof *distance);
  SUPINE_TRY(supine_arena_status(&arena));
  size_t farthest = 0;
  for (size_t i = 0; i < count; ++i) {
    distance[i] = supine_distance(points + 3 * i, fit->middle);
    farthest = distance[i] > distance[farthest] ? i : farthest;
  }
  for (size_t i = 0; i < count; ++i) {
    distance[i] = INFINITY;
  }
  while (fit->count < centre_max) {
    const double *centre = points + 3 * farthest;
    fit->chosen[fit->count] = farthest;
    for (int k = 0; k < 3; ++k) {
      fit->centres[3 * fit->count + (size_t)k] = (centre[k] - fit->middle[k]) / fit->unit;
    }
    ++fit->count;
    for (size_t i = 0; i < count; ++i) {
      const double d = supine_distance(points + 3 * i, centre);
      distance[i] = d < distance[i] ? d : distance[i];
    }
    for (size_t i = 0; i < count; ++i) {
      farthest = distance[i] > distance[farthest] ? i : farthest;
    }
    fit->spacing = distance[farthest];
    if (fit->spacing == 0.0) { /* all other points coincide with centres */
      break;
    }
  }
  return SUPINE_OK;
}

/* Fill the lower triangle of the interpolation matrix K [n, n] of the centres p_i, column by
 * column. It is positive definite because |p_i| <= 1:
 *
 *     K_ij = alpha - |p_i - p_j|,    alpha > 2
 *
 * It may replace the matrix of -|p_i - p_j|, because alpha cancels for weights whose sum is 0. */
SUPINE_CLONES static void fill(size_t n, const double *c, double *matrix) {
  static const double alpha = 3.0;
  for (size_t j = 0; j < n; ++j) {
    for (size_t i = j; i < n; ++i) {
      matrix[j * n + i] = alpha - supine_distance(c + 3 * i, c + 3 * j);
    }
  }
}

/* Find the vectors w and b of the function u(x) = -sum over j of w_j |x - p_j| + (1, x) b. Let K be
 * the interpolation matrix, f the values at the centres p_j, and P the matrix with rows (1, p_j).
 * The conditions are K w + P b = f and P^T w = 0. They are solved in three steps:
 *
 *     K y = f and K Z = P,    (P^T Z) b = P^T y,    w = y - Z b
 *
 * fit->weights receives -w, then b.
 * K or P^T Z is singular if all centres lie in one plane.
 * @param matrix  K; overwritten
 * @param p  in: P, then f, column by column, with one number for each centre; out: Z, then y */
static supine_status find_weights(supine_inside_biharmonic *fit, double *matrix, double *p) {
  static const double flat = 1e-5;
  const int n = (int)fit->count;
  const int columns = (int)fit->columns;
  const double *centre = fit->centres;
  double affine[AFFINE * AFFINE] = {0.0};
  if (LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', n, matrix, n) != 0 ||
      LAPACKE_dpotrs(LAPACK_COL_MAJOR, 'L', n, AFFINE + columns, matrix, n, p, n) != 0) {
    return SUPINE_ERROR_NUMERICAL;
  }
  for (int r = 0; r < AFFINE + columns; ++r) {
    double *to = r < AFFINE
                     ? affine + AFFINE * r
                     : fit->weights + (size_t)(r - AFFINE) * (fit->count + AFFINE) + fit->count;
    for (size_t i = 0; i < fit->count; ++i) {
      const double z = p[(size_t)r * fit->count + i];
      to[0] += z;
      for (size_t axis = 0; axis < 3; ++axis) {
        to[1 + axis] += centre[3 * i + axis] * z;
      }
    }
  }
  if (LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', AFFINE, affine, AFFINE) != 0 ||
      !(affine[5] > flat * affine[0] && affine[10] > flat * affine[0] &&
        affine[15] > flat * affine[0])) {
    return SUPINE_ERROR_NUMERICAL;
  }
  (void)LAPACKE_dpotrs(LAPACK_COL_MAJOR, 'L', AFFINE, columns, affine, AFFINE, fit->weights + n,
                       n + AFFINE);
  for (size_t r = 0; r < fit->columns; ++r) {
    double *w = fit->weights + r * (fit->count + AFFINE);
    cblas_dgemv(CblasColMajor, CblasNoTrans, n, AFFINE, 1.0, p, n, w + n, 1, 0.0, w, 1);
    cblas_daxpy(n, -1.0, p + (AFFINE + r) * fit->count, 1, w, 1);
  }
  return SUPINE_OK;
}

static supine_status solve(supine_inside_biharmonic *fit, const double *values) {
  const size_t n = fit->count;
  SUPINE_ARENA arena = {0};
  double *matrix = supine_arena_take(&arena, n * n, sizeof *matrix);
  double *p = supine_arena_take(&arena, n * (AFFINE + fit->columns), sizeof *p);
  SUPINE_TRY(supine_arena_status(&arena));
  fill(n, fit->centres, matrix);
  for (size_t i = 0; i < n; ++i) {
    p[i] = 1.0;
    for (size_t axis = 0; axis < 3; ++axis) {
      p[(1 + axis) * n + i] = fit->centres[3 * i + axis];
    }
    for (size_t c = 0; c < fit->columns; ++c) {
      p[(AFFINE + c) * n + i] = values[fit->chosen[i] * fit->columns + c];
    }
  }
  return find_weights(fit, matrix, p);
}

supine_status supine_inside_biharmonic_fit(size_t count, const double *points, size_t columns,
                                           const double *values, size_t centre_max,
                                           supine_inside_biharmonic *fit, supine_error *error) {
  const size_t most = count < centre_max ? count : centre_max;
  supine_arena arena = {0};
  *fit = (supine_inside_biharmonic){
      .columns = columns,
      .chosen = supine_arena_take(&arena, most, sizeof *fit->chosen),
      .centres = supine_arena_take(&arena, 3 * most, sizeof *fit->centres),
      .weights = supine_arena_zeros(&arena, (most + AFFINE) * columns, sizeof *fit->weights)};
  fit->arena = arena;
  frame(count, points, fit);
  supine_status status = arena.failed ? SUPINE_ERROR_MEMORY : choose(count, points, most, fit);
  status = status == SUPINE_OK ? solve(fit, values) : status;
  if (status == SUPINE_ERROR_MEMORY) {
    return supine_error_memory(error, "interpolation from %zu points", most);
  }
  SUPINE_REFUSE_IF(status != SUPINE_OK, error, status,
                   "cannot interpolate from %zu points in one plane: give closed lungs", most);
  return SUPINE_OK;
}

void supine_inside_biharmonic_free(supine_inside_biharmonic *fit) {
  supine_arena_free(&fit->arena);
  *fit = (supine_inside_biharmonic){0};
}

typedef struct evaluation {
  const supine_inside_biharmonic *fit;
  const double *points;
  double *values;
  size_t count;
} evaluation;

/* Add the terms w_j |x - p_j| of the centres first <= j < last to the values at the points x. */
SUPINE_CLONES static void add_centres(const supine_inside_biharmonic *fit, size_t first,
                                      size_t last, const double (*x)[POINTS], size_t point_count,
                                      double *values) {
  double distance[CENTRES][POINTS];
  for (size_t j = first; j < last; ++j) {
    const double *c = fit->centres + 3 * j;
    for (size_t i = 0; i < POINTS; ++i) {
      const double d[3] = {x[0][i] - c[0], x[1][i] - c[1], x[2][i] - c[2]};
      distance[j - first][i] = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    }
  }
  for (size_t r = 0; r < fit->columns; ++r) {
    const double *weights = fit->weights + r * (fit->count + AFFINE);
    double sum[POINTS] = {0.0};
    for (size_t j = first; j < last; ++j) {
      for (size_t i = 0; i < POINTS; ++i) {
        sum[i] += weights[j] * distance[j - first][i];
      }
    }
    for (size_t i = 0; i < point_count; ++i) {
      values[i * fit->columns + r] += sum[i];
    }
  }
}

static void evaluate_tiles(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const evaluation *e = context;
  const supine_inside_biharmonic *fit = e->fit;
  const size_t m = fit->count;
  for (size_t tile = begin; tile < end; ++tile) {
    const size_t at = tile * POINTS;
    const size_t point_count = e->count - at < POINTS ? e->count - at : POINTS;
    double *values = e->values + at * fit->columns;
    double x[3][POINTS] = {{0.0}};
    for (size_t i = 0; i < point_count; ++i) {
      for (size_t k = 0; k < 3; ++k) {
        x[k][i] = (e->points[3 * (at + i) + k] - fit->middle[k]) / fit->unit;
      }
      for (size_t r = 0; r < fit->columns; ++r) {
        const double *affine = fit->weights + r * (m + AFFINE) + m;
        values[i * fit->columns + r] =
            affine[0] + affine[1] * x[0][i] + affine[2] * x[1][i] + affine[3] * x[2][i];
      }
    }
    for (size_t first = 0; first < m; first += CENTRES) {
      add_centres(fit, first, first + CENTRES < m ? first + CENTRES : m, (const double(*)[POINTS])x,
                  point_count, values);
    }
  }
}

void supine_inside_biharmonic_evaluate(const supine_inside_biharmonic *fit, size_t count,
                                       const double *points, double *values) {
  evaluation e = {fit, points, values, count};
  supine_parallel_for((count + POINTS - 1) / POINTS, 4, 0, evaluate_tiles, &e);
}
