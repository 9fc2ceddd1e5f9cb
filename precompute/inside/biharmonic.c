/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Biharmonic interpolation: well-spread centres, one dense solve, sums over the centres. */
#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/parallel.h"

#include "precompute/inside/biharmonic.h"

enum { AFFINE = 4, BLOCK = 512 };

static double apart(const double a[3], const double b[3]) {
  const double x = a[0] - b[0];
  const double y = a[1] - b[1];
  const double z = a[2] - b[2];
  return sqrt(x * x + y * y + z * z);
}

/* The box of the points: their middle, and half its diagonal as the unit. */
static void frame(size_t count, const double *points, supine_inside_biharmonic *fit) {
  double square = 0.0;
  for (int k = 0; k < 3; ++k) {
    double low = INFINITY;
    double high = -INFINITY;
    for (size_t i = 0; i < count; ++i) {
      low = fmin(low, points[3 * i + (size_t)k]);
      high = fmax(high, points[3 * i + (size_t)k]);
    }
    fit->middle[k] = 0.5 * (low + high);
    square += 0.25 * (high - low) * (high - low);
  }
  fit->unit = square > 0.0 ? sqrt(square) : 1.0;
}

/* Farthest first: every next centre is the point farthest from all before it. */
static supine_status choose(size_t count, const double *points, size_t centre_max,
                            supine_inside_biharmonic *fit) {
  double *distance = malloc(count * sizeof *distance);
  if (distance == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  size_t farthest = 0;
  for (size_t i = 0; i < count; ++i) {
    distance[i] = apart(points + 3 * i, fit->middle);
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
      distance[i] = fmin(distance[i], apart(points + 3 * i, centre));
    }
    for (size_t i = 0; i < count; ++i) {
      farthest = distance[i] > distance[farthest] ? i : farthest;
    }
    fit->spacing = distance[farthest];
    if (fit->spacing == 0.0) { /* no other point is left */
      break;
    }
  }
  free(distance);
  return SUPINE_OK;
}

/* [ |p_i - p_j|  1 p ; (1 p)^T  0 ] [w; a B] = [values; 0]. */
static supine_status solve(const supine_inside_biharmonic *fit, const double *values) {
  const size_t m = fit->count;
  const size_t size = m + AFFINE;
  double *matrix = calloc(size * size, sizeof *matrix);
  lapack_int *pivots = malloc(size * sizeof *pivots);
  lapack_int failed = -1;
  if (matrix != NULL && pivots != NULL) {
    for (size_t i = 0; i < m; ++i) {
      const double *p = fit->centres + 3 * i;
      for (size_t j = 0; j < i; ++j) {
        matrix[i * size + j] = matrix[j * size + i] = apart(p, fit->centres + 3 * j);
      }
      const double affine[AFFINE] = {1.0, p[0], p[1], p[2]};
      for (size_t a = 0; a < AFFINE; ++a) {
        matrix[i * size + m + a] = matrix[(m + a) * size + i] = affine[a];
      }
      for (size_t r = 0; r < fit->columns; ++r) {
        fit->weights[r * size + i] = values[fit->chosen[i] * fit->columns + r];
      }
    }
    failed = LAPACKE_dgesv(LAPACK_COL_MAJOR, (lapack_int)size, (lapack_int)fit->columns, matrix,
                           (lapack_int)size, pivots, fit->weights, (lapack_int)size);
  }
  free(matrix);
  free(pivots);
  return failed == 0 ? SUPINE_OK : failed > 0 ? SUPINE_ERROR_NUMERICAL : SUPINE_ERROR_MEMORY;
}

supine_status supine_inside_biharmonic_fit(size_t count, const double *points, size_t columns,
                                           const double *values, size_t centre_max,
                                           supine_inside_biharmonic *fit, supine_error *error) {
  supine_inside_biharmonic made = {.columns = columns};
  const size_t most = count < centre_max ? count : centre_max;
  made.chosen = malloc(most * sizeof *made.chosen);
  made.centres = malloc(3 * most * sizeof *made.centres);
  made.weights = calloc((most + AFFINE) * columns, sizeof *made.weights);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (made.chosen != NULL && made.centres != NULL && made.weights != NULL) {
    frame(count, points, &made);
    status = choose(count, points, most, &made);
  }
  if (status == SUPINE_OK) {
    status = solve(&made, values);
  }
  if (status != SUPINE_OK) {
    supine_inside_biharmonic_free(&made);
    return supine_error_set(error, status,
                            status == SUPINE_ERROR_MEMORY
                                ? "no memory to interpolate from %zu points"
                                : "cannot interpolate from %zu points: they lie in one plane",
                            most);
  }
  *fit = made;
  return SUPINE_OK;
}

void supine_inside_biharmonic_free(supine_inside_biharmonic *fit) {
  free(fit->chosen);
  free(fit->centres);
  free(fit->weights);
  *fit = (supine_inside_biharmonic){0};
}

/* Points of a block, and what multiplies the weights at each: distances, then 1, x, y, z. */
typedef struct block {
  const supine_inside_biharmonic *fit;
  const double *points;
  double *rows;
} block;

static void fill_rows(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const block *b = context;
  const supine_inside_biharmonic *fit = b->fit;
  const size_t m = fit->count;
  for (size_t i = begin; i < end; ++i) {
    double *row = b->rows + i * (m + AFFINE);
    double x[3];
    for (int k = 0; k < 3; ++k) {
      x[k] = (b->points[3 * i + (size_t)k] - fit->middle[k]) / fit->unit;
    }
    for (size_t j = 0; j < m; ++j) {
      row[j] = apart(x, fit->centres + 3 * j);
    }
    row[m] = 1.0;
    memcpy(row + m + 1, x, sizeof x);
  }
}

supine_status supine_inside_biharmonic_evaluate(const supine_inside_biharmonic *fit, size_t count,
                                                const double *points, double *values,
                                                supine_error *error) {
  const size_t width = fit->count + AFFINE;
  double *rows = malloc(BLOCK * width * sizeof *rows);
  if (rows == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu centres", fit->count);
  }
  for (size_t first = 0; first < count; first += BLOCK) {
    const size_t here = count - first < BLOCK ? count - first : BLOCK;
    block work = {fit, points + 3 * first, rows};
    supine_parallel_for(here, 64, 0, fill_rows, &work);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)here, (int)fit->columns, (int)width,
                1.0, rows, (int)width, fit->weights, (int)width, 0.0, values + first * fit->columns,
                (int)fit->columns);
  }
  free(rows);
  return SUPINE_OK;
}
