/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Choose a few directions of gravity whose weighted forces sum to the force for any direction. */
#include <cblas.h>
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/lapack.h"
#include "base/remedy.h"
#include "base/vec3.h"
#include "precompute/projection/projection.h"

/* The cross approximation (projection.h) examines at most VERTICES vertices in DIRECTIONS
 * directions of gravity. */
enum { VERTICES = 1024, DIRECTIONS = 512 };

/* Largest accepted residual of the interpolated forces (projection.h) on the examined vertices,
 * divided by the largest force, if supine_force_law.soften is not 0. The RMS residual is then 6e-5
 * of the RMS force, a hundredth of the error that compression to 16 modes causes. */
static const double tolerance = 3e-4;
/* The same limit if supine_force_law.soften is 0, where the interpolation is exact. */
static const double rounding = 1e-12;

/* Make the row and the column of entry `at` of force [vertices, DIRECTIONS] zero: subtract the
 * product of this column and this row, divided by that entry, from the matrix. */
static void eliminate(double *force, size_t vertices, size_t at) {
  const double *column = force + at % DIRECTIONS;
  double row[DIRECTIONS];
  memcpy(row, force + at / DIRECTIONS * DIRECTIONS, sizeof row);
  const double pivot = row[at % DIRECTIONS];
  for (size_t i = 0; i < vertices; ++i) {
    const double factor = column[i * DIRECTIONS] / pivot;
    for (size_t d = 0; d < DIRECTIONS; ++d) {
      force[i * DIRECTIONS + d] -= factor * row[d];
    }
  }
}

static size_t largest_of(const double *force, size_t count) {
  size_t at = 0;
  for (size_t k = 1; k < count; ++k) {
    at = fabs(force[k]) > fabs(force[at]) ? k : at;
  }
  return at;
}

static supine_status invert(double *matrix, size_t rank) {
  lapack_int pivots[SUPINE_SPAN_MAX];
  const lapack_int n = (lapack_int)rank;
  const lapack_int info = LAPACKE_dgetrf(LAPACK_COL_MAJOR, n, n, matrix, n, pivots);
  return supine_lapack_status(info != 0 ? info
                                        : LAPACKE_dgetri(LAPACK_COL_MAJOR, n, matrix, n, pivots));
}

/* Choose rows (vertices) and columns (directions of gravity) of force [count, DIRECTIONS] whose
 * cross approximation of the matrix leaves no residual above `share` of the largest force. The
 * residual overwrites `force`. Return false if SUPINE_SPAN_MAX rows and columns do not suffice. */
static bool choose(double *force, size_t count, double share, size_t *rank,
                   size_t rows[SUPINE_SPAN_MAX], size_t columns[SUPINE_SPAN_MAX]) {
  size_t at = largest_of(force, count * DIRECTIONS);
  const double least = share * fabs(force[at]);
  *rank = 0;
  while (fabs(force[at]) > least && *rank < SUPINE_SPAN_MAX) {
    rows[*rank] = at / DIRECTIONS;
    columns[(*rank)++] = at % DIRECTIONS;
    eliminate(force, count, at);
    at = largest_of(force, count * DIRECTIONS);
  }
  return fabs(force[at]) <= least;
}

supine_status supine_projection_span_create(const supine_lungs *lungs, const supine_force_law *law,
                                            supine_span *span, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const size_t count = n < VERTICES ? n : VERTICES;
  const size_t values = count * DIRECTIONS;
  double directions[3 * DIRECTIONS];
  double range[2 * DIRECTIONS];
  size_t vertices[VERTICES];
  size_t columns[SUPINE_SPAN_MAX];
  size_t rows[SUPINE_SPAN_MAX];
  SUPINE_ARENA arena = {0};
  double *force = supine_arena_take(&arena, values, sizeof *force);
  double *residual = supine_arena_take(&arena, values, sizeof *residual);
  for (size_t d = 0; d < DIRECTIONS; ++d) {
    supine_spiral((double)d, DIRECTIONS, 0.0, directions + 3 * d);
  }
  if (arena.failed || supine_physics_height_range(lungs, law->pair, DIRECTIONS, directions, range,
                                                  range + DIRECTIONS) != SUPINE_OK) {
    return supine_error_memory(error, "the forces");
  }
  for (size_t k = 0; k < count; ++k) {
    vertices[k] = k * n / count;
  }
  const supine_gravities gravities = {DIRECTIONS, directions, range, range + DIRECTIONS};
  supine_physics_force(lungs, law, &gravities, count, vertices, force);
  memcpy(residual, force, values * sizeof *residual);
  const bool spanned = choose(residual, count, law->soften == 0.0 ? rounding : tolerance,
                              &span->rank, rows, columns);
  SUPINE_REFUSE_IF(!spanned, error, SUPINE_ERROR_ARGUMENT,
                   "softening by %g is too large for a basis of these lungs: give less", law->soften);
  for (size_t r = 0; r < span->rank; ++r) {
    memcpy(span->directions + 3 * r, directions + 3 * columns[r], 3 * sizeof *directions);
    span->vertices[r] = vertices[rows[r]];
    for (size_t c = 0; c < span->rank; ++c) {
      span->inverse[r * span->rank + c] = force[rows[r] * DIRECTIONS + columns[c]];
    }
  }
  const supine_status status =
      span->rank == 0 ? SUPINE_ERROR_NUMERICAL : invert(span->inverse, span->rank);
  if (status == SUPINE_ERROR_MEMORY) {
    return supine_error_memory(error, "the forces");
  }
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_change("base", ""),
                                                     supine_remedy_change("gain", "")};
  SUPINE_REFUSE_ADVISE(status != SUPINE_OK, error, advice, SUPINE_ERROR_NUMERICAL,
                       "the force is zero everywhere");
  return SUPINE_OK;
}

supine_status supine_projection_span_weights(const supine_lungs *lungs, const supine_force_law *law,
                                             const supine_span *span,
                                             const supine_gravities *gravities, double *weights) {
  const int rank = (int)span->rank;
  const int count = (int)gravities->count;
  SUPINE_ARENA arena = {0};
  double *force = supine_arena_take(&arena, span->rank * gravities->count, sizeof *force);
  SUPINE_TRY(supine_arena_status(&arena));
  supine_physics_force(lungs, law, gravities, span->rank, span->vertices, force);
  cblas_dgemm(CblasRowMajor, CblasTrans, CblasTrans, count, rank, rank, 1.0, force, count,
              span->inverse, rank, 0.0, weights, rank);
  return SUPINE_OK;
}
