/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit the affine subspace of a cluster. */
#include <cblas.h>
#include <string.h>

#include "base/arena.h"
#include "base/lapack.h"
#include "precompute/clusters/subspace.h"

enum { BLOCK = 32, TERMS = 4 };

/* Part of the mean squared distance from the centre that is added to the regression's matrix, so
 * that a flat cluster, whose slope across it is not determined, gets none there. */
static const double ridge = 1e-6;

static void position_terms(const supine_clustered *surface, const double centre[3], size_t vertex,
                           double terms[TERMS]) {
  terms[0] = 1.0;
  for (size_t axis = 0; axis < 3; ++axis) {
    terms[1 + axis] = (double)surface->vertices[3 * vertex + axis] - centre[axis];
  }
}

static void find_centre(const supine_clustered *surface, const uint32_t *members, size_t count,
                        double centre[3]) {
  for (size_t axis = 0; axis < 3; ++axis) {
    centre[axis] = 0.0;
    for (size_t i = 0; i < count; ++i) {
      centre[axis] += (double)surface->vertices[3 * (size_t)members[i] + axis];
    }
    centre[axis] /= (double)count;
  }
}

/* Sums over the members of a cluster, with x the terms of the position and c the row. */
typedef struct sums {
  double xx[TERMS * TERMS]; /* x x' */
  double *xc;               /* [TERMS, width] x c' */
  double *cc;               /* [width, width] c c', lower triangle */
} sums;

static void add_members(const supine_clustered *surface, const double centre[3],
                        const uint32_t *members, size_t count, sums *s) {
  const size_t width = 3 * surface->mode_count;
  double x[BLOCK * TERMS];
  double c[BLOCK * SUPINE_CLUSTER_ROW_MAX];
  for (size_t begin = 0; begin < count; begin += BLOCK) {
    const size_t n = count - begin < BLOCK ? count - begin : BLOCK;
    for (size_t i = 0; i < n; ++i) {
      const size_t vertex = members[begin + i];
      position_terms(surface, centre, vertex, x + TERMS * i);
      for (size_t k = 0; k < width; ++k) {
        c[i * width + k] = (double)surface->coefficients[vertex * width + k];
      }
    }
    cblas_dgemm(CblasRowMajor, CblasTrans, CblasNoTrans, TERMS, TERMS, (int)n, 1.0, x, TERMS, x,
                TERMS, 1.0, s->xx, TERMS);
    cblas_dgemm(CblasRowMajor, CblasTrans, CblasNoTrans, TERMS, (int)width, (int)n, 1.0, x, TERMS,
                c, (int)width, 1.0, s->xc, (int)width);
    cblas_dsyrk(CblasRowMajor, CblasLower, CblasTrans, (int)width, (int)n, 1.0, c, (int)width, 1.0,
                s->cc, (int)width);
  }
}

/* Solve for the linear part, and replace s->cc by the covariance of what it leaves:
 * cc - xc' (linear part). */
static supine_status regress(size_t width, sums *s, double *linear) {
  const double scale = (s->xx[5] + s->xx[10] + s->xx[15]) / 3.0;
  for (size_t axis = 1; axis < TERMS; ++axis) {
    s->xx[axis * TERMS + axis] += ridge * (scale > 0.0 ? scale : 1.0);
  }
  memcpy(linear, s->xc, TERMS * width * sizeof *linear);
  SUPINE_TRY(supine_lapack_status(LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', TERMS, (lapack_int)width,
                                                s->xx, TERMS, linear, (lapack_int)width)));
  cblas_dgemm(CblasRowMajor, CblasTrans, CblasNoTrans, (int)width, (int)width, TERMS, -1.0, s->xc,
              (int)width, linear, (int)width, 1.0, s->cc, (int)width);
  return SUPINE_OK;
}

supine_status supine_clusters_subspace_fit(const supine_clustered *surface, const uint32_t *members,
                                           size_t count, supine_subspace *subspace) {
  const size_t width = 3 * surface->mode_count;
  const lapack_int n = (lapack_int)width;
  lapack_int found = 0;
  SUPINE_ARENA arena = {0};
  sums s = {.xx = {0}};
  s.xc = supine_arena_zeros(&arena, TERMS * width, sizeof *s.xc);
  s.cc = supine_arena_zeros(&arena, width * width, sizeof *s.cc);
  double *linear = supine_arena_take(&arena, TERMS * width, sizeof *linear);
  double *values = supine_arena_take(&arena, width, sizeof *values);
  double *vectors = supine_arena_take(&arena, width * SUPINE_CLUSTER_SCALARS, sizeof *vectors);
  lapack_int *support = supine_arena_take(&arena, 2 * width, sizeof *support);
  SUPINE_TRY(supine_arena_status(&arena));
  find_centre(surface, members, count, subspace->centre);
  add_members(surface, subspace->centre, members, count, &s);
  SUPINE_TRY(regress(width, &s, linear));
  SUPINE_TRY(supine_lapack_status(LAPACKE_dsyevr(
      LAPACK_ROW_MAJOR, 'V', 'I', 'L', n, s.cc, n, 0.0, 0.0, n - SUPINE_CLUSTER_SCALARS + 1, n, 0.0,
      &found, values, vectors, SUPINE_CLUSTER_SCALARS, support)));
  for (size_t k = 0; k < width; ++k) {
    for (size_t term = 0; term < TERMS; ++term) {
      subspace->linear[term][k] = (float)linear[term * width + k];
    }
    for (size_t p = 0; p < SUPINE_CLUSTER_SCALARS; ++p) { /* LAPACK's eigenvalues rise */
      subspace->pattern[p][k] =
          (float)vectors[k * SUPINE_CLUSTER_SCALARS + SUPINE_CLUSTER_SCALARS - 1 - p];
    }
  }
  return SUPINE_OK;
}

double supine_clusters_subspace_leave(const supine_clustered *surface,
                                      const supine_subspace *subspace, size_t vertex,
                                      double scalars[SUPINE_CLUSTER_SCALARS], float *left) {
  const size_t width = 3 * surface->mode_count;
  const float *row = surface->coefficients + vertex * width;
  double terms[TERMS];
  position_terms(surface, subspace->centre, vertex, terms);
  const float x = (float)terms[1];
  const float y = (float)terms[2];
  const float z = (float)terms[3];
  float first = 0;
  float second = 0;
  for (size_t k = 0; k < width; ++k) {
    left[k] = row[k] - subspace->linear[0][k] - x * subspace->linear[1][k] -
              y * subspace->linear[2][k] - z * subspace->linear[3][k];
    first += left[k] * subspace->pattern[0][k];
    second += left[k] * subspace->pattern[1][k];
  }
  float square = 0;
  for (size_t k = 0; k < width; ++k) {
    left[k] -= first * subspace->pattern[0][k] + second * subspace->pattern[1][k];
    square += left[k] * left[k];
  }
  scalars[0] = (double)first;
  scalars[1] = (double)second;
  return (double)square;
}
