/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Biharmonic interpolation: spread centres, one dense factorisation, sums over the centres. */
#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/clones.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"

#include "precompute/inside/biharmonic.h"

/* Columns of the matrix eliminated together; points and centres in a tile of sums. */
enum { AFFINE = 4, COLUMNS = 128, POINTS = 32, CENTRES = 64 };

static inline double apart(const double a[3], const double b[3]) {
  const double x = a[0] - b[0];
  const double y = a[1] - b[1];
  const double z = a[2] - b[2];
  return sqrt(x * x + y * y + z * z);
}

/* Set the middle of the points' box, and half its diagonal as the unit. */
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

/* Choose each next centre as the point farthest from all earlier ones. */
SUPINE_CLONES static supine_status choose(size_t count, const double *points, size_t centre_max,
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
      const double d = apart(points + 3 * i, centre);
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
  free(distance);
  return SUPINE_OK;
}

/* The centres' distance matrix reduced by its affine part. With l(p) the barycentric coordinates
 * in the tetrahedron of the first four centres q, a(p) the distances to p and G those among
 * them,
 *
 *     N_ij = l_i.b_j + b_i.l_j - |p_i - p_j|,    b = a - G l / 2
 *
 * is positive definite over the other centres. */
typedef struct reduced {
  size_t size;        /* of N */
  double slope[3][3]; /* of l_1, l_2, l_3 */
  double *l, *b;      /* [4 + size, 4] */
  double *matrix;     /* [size, size], the lower triangle column by column */
  size_t done;        /* columns eliminated */
} reduced;

/* Move centres far from a line and from a plane to the third and fourth place; false if all
 * points lie in one plane. */
static bool find_tetrahedron(supine_inside_biharmonic *fit, double slope[3][3]) {
  static const double flat = 1e-9;
  double edge[3][3] = {{0.0}};
  double across[3] = {0.0, 0.0, 0.0};
  double most = 0.0;
  double *c = fit->centres;
  for (size_t corner = 1; corner < AFFINE && corner < fit->count; ++corner) {
    size_t best = corner;
    most = 0.0;
    for (size_t i = corner; i < fit->count && corner > 1; ++i) {
      const double to[3] = {c[3 * i] - c[0], c[3 * i + 1] - c[1], c[3 * i + 2] - c[2]};
      double turned[3];
      supine_cross(edge[0], to, turned);
      const double size = corner == 2 ? supine_length(turned) : fabs(supine_dot(across, to));
      best = size > most ? i : best;
      most = size > most ? size : most;
    }
    const size_t which = fit->chosen[best];
    fit->chosen[best] = fit->chosen[corner];
    fit->chosen[corner] = which;
    for (size_t k = 0; k < 3; ++k) {
      const double at = c[3 * best + k];
      c[3 * best + k] = c[3 * corner + k];
      c[3 * corner + k] = at;
      edge[corner - 1][k] = at - c[k];
    }
    supine_cross(edge[0], edge[1], across);
  }
  const double volume = supine_triple(edge[0], edge[1], edge[2]);
  for (size_t k = 0; k < 3; ++k) {
    supine_cross(edge[(k + 1) % 3], edge[(k + 2) % 3], slope[k]);
    for (size_t axis = 0; axis < 3; ++axis) {
      slope[k][axis] /= volume;
    }
  }
  return fit->count >= AFFINE && most > flat;
}

static void find_coordinates(const double *c, reduced *r) {
  for (size_t i = 0; i < AFFINE + r->size; ++i) {
    double *l = r->l + AFFINE * i;
    const double to[3] = {c[3 * i] - c[0], c[3 * i + 1] - c[1], c[3 * i + 2] - c[2]};
    l[0] = 1.0;
    for (size_t k = 1; k < AFFINE; ++k) {
      l[k] = supine_dot(r->slope[k - 1], to);
      l[0] -= l[k];
    }
    for (size_t k = 0; k < AFFINE; ++k) {
      double *b = r->b + AFFINE * i + k;
      *b = apart(c + 3 * i, c + 3 * k);
      for (size_t j = 0; j < AFFINE; ++j) {
        *b -= 0.5 * apart(c + 3 * k, c + 3 * j) * l[j];
      }
    }
  }
}

SUPINE_CLONES static void fill(const double *centres, const reduced *r) {
  const double *c = centres + 3 * AFFINE;
  const double *l = r->l + AFFINE * AFFINE;
  const double *b = r->b + AFFINE * AFFINE;
  for (size_t j = 0; j < r->size; ++j) {
    for (size_t i = j; i < r->size; ++i) {
      double sum = -apart(c + 3 * i, c + 3 * j);
      for (size_t k = 0; k < AFFINE; ++k) {
        sum += l[AFFINE * i + k] * b[AFFINE * j + k] + b[AFFINE * i + k] * l[AFFINE * j + k];
      }
      r->matrix[j * r->size + i] = sum;
    }
  }
}

/* Subtract the last eliminated columns from those behind, alternating long and short blocks. */
static void update_blocks(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const reduced *r = context;
  const size_t n = r->size;
  const size_t blocks = (n - r->done + COLUMNS - 1) / COLUMNS;
  const double *last = r->matrix + (r->done - COLUMNS) * n;
  for (size_t i = begin; i < end; ++i) {
    const size_t j = r->done + COLUMNS * (i % 2 == 0 ? i / 2 : blocks - 1 - i / 2);
    const size_t width = n - j < COLUMNS ? n - j : COLUMNS;
    cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, (int)(n - j), (int)width, COLUMNS, -1.0,
                last + j, (int)n, last + j, (int)n, 1.0, r->matrix + j * n + j, (int)n);
  }
}

/* Cholesky factorisation with a result that does not depend on the number of threads. */
static lapack_int factorise(reduced *r) {
  const size_t n = r->size;
  lapack_int failed = 0;
  for (size_t j = 0; j < n && failed == 0; j += COLUMNS) {
    double *corner = r->matrix + j * n + j;
    const size_t width = n - j < COLUMNS ? n - j : COLUMNS;
    const size_t below = n - j - width;
    failed = LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', (lapack_int)width, corner, (lapack_int)n);
    if (below > 0 && failed == 0) {
      cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, (int)below,
                  (int)width, 1.0, corner, (int)n, corner + width, (int)n);
      r->done = j + width;
      supine_parallel_for((below + COLUMNS - 1) / COLUMNS, 2, 0, update_blocks, r);
    }
  }
  return failed;
}

/* Find the weights of one column from N z = l.f(q) - f, solved in `z`: the weights of q cancel
 * the affine part of the others, and the affine function fits f(q). */
static void finish_column(const supine_inside_biharmonic *fit, const reduced *r, const double *z,
                          const double f[AFFINE], double *weights) {
  const double *c = fit->centres;
  const size_t m = fit->count;
  double left[AFFINE];
  memcpy(weights + AFFINE, z, r->size * sizeof *z);
  for (size_t k = 0; k < AFFINE; ++k) {
    weights[k] = 0.0;
    for (size_t i = AFFINE; i < m; ++i) {
      weights[k] -= r->l[AFFINE * i + k] * weights[i];
    }
  }
  for (size_t k = 0; k < AFFINE; ++k) {
    left[k] = f[k];
    for (size_t i = 0; i < m; ++i) {
      left[k] -= apart(c + 3 * k, c + 3 * i) * weights[i];
    }
  }
  weights[m] = left[0];
  for (size_t axis = 0; axis < 3; ++axis) {
    double *slope = weights + m + 1 + axis;
    *slope = 0.0;
    for (size_t k = 1; k < AFFINE; ++k) {
      *slope += (left[k] - left[0]) * r->slope[k - 1][axis];
    }
    weights[m] -= *slope * c[axis];
  }
}

/* Solve [ |p_i - p_j|  1 p ; (1 p)^T  0 ] [w; a B] = [values; 0] by N. */
static supine_status solve(supine_inside_biharmonic *fit, const double *values) {
  reduced r = {0};
  if (!find_tetrahedron(fit, r.slope)) {
    return SUPINE_ERROR_NUMERICAL;
  }
  const size_t m = fit->count;
  const size_t columns = fit->columns;
  r.size = m - AFFINE;
  r.l = malloc(AFFINE * m * sizeof *r.l);
  r.b = malloc(AFFINE * m * sizeof *r.b);
  r.matrix = malloc((r.size * r.size + 1) * sizeof *r.matrix);
  double *z = malloc((r.size * columns + 1) * sizeof *z);
  lapack_int failed = -1;
  if (r.l != NULL && r.b != NULL && r.matrix != NULL && z != NULL) {
    find_coordinates(fit->centres, &r);
    fill(fit->centres, &r);
    for (size_t i = 0; i < r.size; ++i) {
      for (size_t c = 0; c < columns; ++c) {
        double *to = &z[c * r.size + i];
        *to = -values[fit->chosen[AFFINE + i] * columns + c];
        for (size_t k = 0; k < AFFINE; ++k) {
          *to += r.l[AFFINE * (AFFINE + i) + k] * values[fit->chosen[k] * columns + c];
        }
      }
    }
    failed = factorise(&r);
  }
  if (failed == 0 && r.size > 0) {
    failed = LAPACKE_dpotrs(LAPACK_COL_MAJOR, 'L', (lapack_int)r.size, (lapack_int)columns,
                            r.matrix, (lapack_int)r.size, z, (lapack_int)r.size);
  }
  for (size_t c = 0; c < columns && failed == 0; ++c) {
    double f[AFFINE];
    for (size_t k = 0; k < AFFINE; ++k) {
      f[k] = values[fit->chosen[k] * columns + c];
    }
    finish_column(fit, &r, z + c * r.size, f, fit->weights + c * (m + AFFINE));
  }
  free(r.l);
  free(r.b);
  free(r.matrix);
  free(z);
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
    return supine_error_set(
        error, status,
        status == SUPINE_ERROR_MEMORY
            ? "no memory to interpolate from %zu points"
            : "cannot interpolate from %zu points in one plane: give closed lungs",
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

typedef struct evaluation {
  const supine_inside_biharmonic *fit;
  const double *points;
  double *values;
  size_t count;
} evaluation;

/* Add the sum over centres [first, last) to the values of the `here` points x. */
SUPINE_CLONES static void add_centres(const supine_inside_biharmonic *fit, size_t first,
                                      size_t last, const double (*x)[POINTS], size_t here,
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
    for (size_t i = 0; i < here; ++i) {
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
    const size_t here = e->count - at < POINTS ? e->count - at : POINTS;
    double *values = e->values + at * fit->columns;
    double x[3][POINTS] = {{0.0}};
    for (size_t i = 0; i < here; ++i) {
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
                  here, values);
    }
  }
}

void supine_inside_biharmonic_evaluate(const supine_inside_biharmonic *fit, size_t count,
                                       const double *points, double *values) {
  evaluation e = {fit, points, values, count};
  supine_parallel_for((count + POINTS - 1) / POINTS, 4, 0, evaluate_tiles, &e);
}
