/* SPDX-License-Identifier: MIT */
/* Decide by its shape whether a part inside the lungs is compact. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "mesh/compact.h"

/* Least ratio of the smallest and the largest SD along the principal axes, and the least share of
 * the ellipsoid of these SDs that a part fills. In trials with synthetic trees of vessels, these
 * filled 0.15 to 0.55; a solid ellipsoid fills 1. */
static const double slender = 1.0 / 3.0;
static const double filled = 0.7;
/* Least sum of the vectors of area of an open surface, as a share of its area. */
static const double gap_share = 1e-3;

/* Compute the eigenvalues of a symmetric matrix [Smith 1961, Commun ACM 4(4), 168], largest first.
 */
static void eigenvalues(const double m[3][3], double value[3]) {
  const double mean = (m[0][0] + m[1][1] + m[2][2]) / 3.0;
  double square = 0.0;
  double rest[3][3];
  for (size_t k = 0; k < 9; ++k) {
    rest[k / 3][k % 3] = m[k / 3][k % 3] - (k / 3 == k % 3 ? mean : 0.0);
    square += rest[k / 3][k % 3] * rest[k / 3][k % 3];
  }
  const double p = sqrt(square / 6.0);
  double cosine = 1.0;
  if (p > 0.0) {
    cosine = 0.5 * supine_triple(rest[0], rest[1], rest[2]) / (p * p * p);
  }
  const double angle = acos(fmin(fmax(cosine, -1.0), 1.0)) / 3.0;
  for (size_t k = 0; k < 3; ++k) {
    value[k] = mean + 2.0 * p * cos(angle - 2.0943951023931953 * (double)k); /* 2 pi / 3 */
  }
}

bool supine_mesh_is_compact(double volume, const double covariance[3][3]) {
  double value[3];
  if (!(volume >= SUPINE_COMPACT_LEAST_ML && volume <= SUPINE_COMPACT_MOST_ML)) {
    return false;
  }
  eigenvalues(covariance, value);
  /* A solid ellipsoid has the semi-axes sqrt(5) SD. */
  const double sd[3] = {sqrt(value[0]), sqrt(fmax(value[1], 0.0)), sqrt(fmax(value[2], 0.0))};
  const double least = fmin(sd[1], sd[2]);
  const double ellipsoid = 4.1887902047863905e-3 * pow(5.0, 1.5) * sd[0] * sd[1] * sd[2];
  return least >= slender * sd[0] && volume >= filled * ellipsoid;
}

static uint32_t root_of(uint32_t *parent, uint32_t i) {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

/* Return six times the signed volume of the tetrahedron of a triangle and `origin`, and its corners
 * relative to `origin`. */
static double take_corners(const supine_mesh *mesh, size_t triangle, const double origin[3],
                           double corner[3][3]) {
  for (size_t c = 0; c < 3; ++c) {
    const double *p = mesh->vertices + 3 * (size_t)mesh->triangles[3 * triangle + c];
    supine_subtract(p, origin, corner[c]);
  }
  return supine_triple(corner[0], corner[1], corner[2]);
}

supine_status supine_mesh_solid(const supine_mesh *mesh, double *volume, double covariance[3][3]) {
  const double *origin = mesh->vertices; /* the first vertex, so that products stay small */
  SUPINE_ARENA arena = {0};
  uint32_t *parent = supine_arena_take(&arena, mesh->vertex_count, sizeof *parent);
  double *sixfold = supine_arena_zeros(&arena, mesh->vertex_count, sizeof *sixfold);
  double corner[3][3];
  double sum = 0.0;
  double mean[3] = {0.0, 0.0, 0.0};
  double normal[3] = {0.0, 0.0, 0.0}; /* sum of the vectors of area, 0 for a closed surface */
  double area = 0.0;
  SUPINE_TRY(supine_arena_status(&arena));
  memset(covariance, 0, 9 * sizeof covariance[0][0]);
  for (uint32_t i = 0; i < mesh->vertex_count; ++i) {
    parent[i] = i;
  }
  for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
    const uint32_t next = mesh->triangles[i % 3 < 2 ? i + 1 : i - 2];
    parent[root_of(parent, mesh->triangles[i])] = root_of(parent, next);
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    double cross[3];
    sixfold[root_of(parent, mesh->triangles[3 * t])] += take_corners(mesh, t, origin, corner);
    supine_subtract(corner[1], corner[0], corner[1]);
    supine_subtract(corner[2], corner[0], corner[2]);
    supine_cross(corner[1], corner[2], cross);
    area += supine_length(cross);
    for (size_t k = 0; k < 3; ++k) {
      normal[k] += cross[k];
    }
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const double v = take_corners(mesh, t, origin, corner) / 6.0;
    if (sixfold[root_of(parent, mesh->triangles[3 * t])] <= 0.0) {
      continue;
    }
    sum += v;
    for (size_t k = 0; k < 9; ++k) {
      const size_t a = k / 3;
      const size_t b = k % 3;
      const double all[2] = {corner[0][a] + corner[1][a] + corner[2][a],
                             corner[0][b] + corner[1][b] + corner[2][b]};
      mean[a] += b == 0 ? v * all[0] / 4.0 : 0.0;
      covariance[a][b] += v / 20.0 *
                          (all[0] * all[1] + corner[0][a] * corner[0][b] +
                           corner[1][a] * corner[1][b] + corner[2][a] * corner[2][b]);
    }
  }
  if (sum > 0.0) {
    for (size_t k = 0; k < 9; ++k) {
      covariance[k / 3][k % 3] =
          covariance[k / 3][k % 3] / sum - mean[k / 3] / sum * (mean[k % 3] / sum);
    }
  }
  *volume = supine_length(normal) < gap_share * area ? 1e-3 * sum : 0.0;
  return SUPINE_OK;
}
