/* SPDX-License-Identifier: MIT */
/* Decide by its shape whether a part inside the lungs is compact. */
#include <math.h>

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

bool supine_mesh_is_compact(double volume, const double covariance[3][3]) {
  double value[3];
  if (!(volume >= SUPINE_COMPACT_LEAST_ML && volume <= SUPINE_COMPACT_MOST_ML)) {
    return false;
  }
  supine_eigenvalues(covariance, value);
  /* A solid ellipsoid has the semi-axes sqrt(5) SD. */
  const double sd[3] = {sqrt(value[0]), sqrt(fmax(value[1], 0.0)), sqrt(fmax(value[2], 0.0))};
  const double least = fmin(sd[1], sd[2]);
  const double ellipsoid = 4.1887902047863905e-3 * pow(5.0, 1.5) * sd[0] * sd[1] * sd[2];
  return least >= slender * sd[0] && volume >= filled * ellipsoid;
}

/* What a component encloses: moments of the solid, relative to the first vertex of the mesh, so
 * that products stay small. */
typedef struct solid {
  double sum;             /* signed volume, mm^3; negative if the component is turned inwards */
  double mean[3];         /* integral of the position, mm^4 */
  double square[9];       /* integral of the products of two coordinates, mm^5 */
  double normal[3], area; /* sum of its vectors of area, 0 if it is closed, and area; twice, mm^2 */
  double low[3], high[3]; /* corners of its box, relative to the same vertex, mm */
  uint32_t part;          /* 1 + index of the compact part that it belongs to; 0 if none */
} solid;

static void add_triangle(const supine_mesh *mesh, const uint32_t *triangle, solid *s) {
  double corner[3][3];
  double cross[3];
  double all[3] = {0.0, 0.0, 0.0};
  for (size_t c = 0; c < 3; ++c) {
    supine_subtract(mesh->vertices + 3 * (size_t)triangle[c], mesh->vertices, corner[c]);
    supine_box_add(corner[c], s->low, s->high);
    for (size_t k = 0; k < 3; ++k) {
      all[k] += corner[c][k];
    }
  }
  const double v = supine_triple(corner[0], corner[1], corner[2]) / 6.0;
  supine_normal(corner[0], corner[1], corner[2], cross);
  s->sum += v;
  s->area += supine_length(cross);
  for (size_t k = 0; k < 3; ++k) {
    s->mean[k] += v * all[k] / 4.0;
    s->normal[k] += cross[k];
  }
  for (size_t k = 0; k < 9; ++k) {
    const size_t a = k / 3;
    const size_t b = k % 3;
    s->square[k] += v / 20.0 *
                    (all[a] * all[b] + corner[0][a] * corner[0][b] + corner[1][a] * corner[1][b] +
                     corner[2][a] * corner[2][b]);
  }
}

/* Return whether a component is closed, faces outwards and is compact. Its cavities count as
 * solid. */
static bool is_compact(const solid *s) {
  double covariance[3][3];
  if (!(s->sum > 0.0) || supine_length(s->normal) >= gap_share * s->area) {
    return false;
  }
  for (size_t k = 0; k < 9; ++k) {
    covariance[k / 3][k % 3] =
        s->square[k] / s->sum - s->mean[k / 3] / s->sum * (s->mean[k % 3] / s->sum);
  }
  return supine_mesh_is_compact(1e-3 * s->sum, (const double(*)[3])covariance);
}

/* Return whether the box of `outer` contains that of `inner`. */
static bool contains(const solid *outer, const solid *inner) {
  bool within = true;
  for (size_t k = 0; k < 3; ++k) {
    within = within && outer->low[k] <= inner->low[k] && inner->high[k] <= outer->high[k];
  }
  return within;
}

/* Give each cavity, which faces inwards, the part of the smallest solid whose box contains it. */
static void place_cavities(solid *solids, size_t count) {
  for (solid *cavity = solids; cavity < solids + count; ++cavity) {
    const solid *around = NULL;
    if (cavity->sum >= 0.0) {
      continue;
    }
    for (const solid *s = solids; s < solids + count; ++s) {
      if (s->sum > 0.0 && contains(s, cavity) && (around == NULL || s->sum < around->sum)) {
        around = s;
      }
    }
    cavity->part = around != NULL ? around->part : 0;
  }
}

supine_status supine_mesh_find_compact(const supine_mesh *mesh, uint32_t *part, uint32_t *count) {
  SUPINE_ARENA arena = {0};
  const size_t found =
      supine_mesh_components(mesh->vertex_count, 3, mesh->triangle_count, mesh->triangles, part);
  solid *solids = supine_arena_zeros(&arena, found, sizeof *solids);
  *count = 0;
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t i = 0; i < found; ++i) {
    supine_box_begin(solids[i].low, solids[i].high);
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *triangle = mesh->triangles + 3 * t;
    add_triangle(mesh, triangle, &solids[part[triangle[0]]]);
  }
  for (size_t i = 0; i < found; ++i) {
    solids[i].part = is_compact(&solids[i]) ? ++*count : 0;
  }
  place_cavities(solids, found);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    part[i] = solids[part[i]].part;
  }
  return SUPINE_OK;
}
