/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Smooth a force by the linear finite elements of smoothing.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "precompute/physics/factorisation.h"
#include "precompute/physics/smoothing.h"

/* Smallest (twice the area) / (half the sum of the squared sides) of a triangle in the weights. */
static const double flattest = 2e-3;

struct supine_smoothing {
  supine_arena memory; /* of the arrays */
  size_t vertex_count;
  const supine_topology *topology;
  supine_factorisation *factorisation;
  size_t *edge_begin; /* [vertices] index of the first edge from each vertex to a later one */
  double *area;       /* [vertices] vertex area / mean vertex area */
  double *diagonal;   /* [vertices] elements of the matrix */
  double *coupling;   /* [edges] w_ij / 2, elements of the matrix times -1 */
};

void supine_physics_smoothing_destroy(supine_smoothing *smoothing) {
  if (smoothing != NULL) {
    supine_physics_factorisation_destroy(smoothing->factorisation);
    supine_arena_free(&smoothing->memory);
    free(smoothing);
  }
}

/* Find the first edge of each vertex. Edges are sorted by their first vertex. */
static void index_edges(supine_smoothing *s) {
  size_t e = 0;
  for (size_t i = 0; i < s->vertex_count; ++i) {
    s->edge_begin[i] = e;
    while (e < s->topology->edge_count && s->topology->edges[2 * e] == i) {
      ++e;
    }
  }
}

/* Return the index of the edge between two vertices. */
static size_t find_edge(const supine_smoothing *s, uint32_t a, uint32_t b) {
  size_t e = s->edge_begin[a < b ? a : b];
  while (s->topology->edges[2 * e + 1] != (a < b ? b : a)) {
    ++e;
  }
  return e;
}

/* Compute s->area, and s->coupling = w_ij / 2 for a smoothing length R = reach, in mm. All
 * weights of a triangle have one divisor, so that its terms stay positive semidefinite if its area
 * is less than the lower limit. */
static void set_weights(supine_smoothing *s, const supine_mesh *mesh, double reach) {
  const size_t n = s->vertex_count;
  const double *p = mesh->vertices;
  double mean = 0.0;
  supine_mesh_vertex_area(mesh, s->area);
  for (size_t i = 0; i < n; ++i) {
    mean += s->area[i] / (double)n;
  }
  /* Lower limit of areas, mm^2, against zero weights and divisions by zero. */
  const double least = 1e-6 * mean;
  for (size_t i = 0; i < n; ++i) {
    s->area[i] = fmax(s->area[i], least) / mean;
  }
  memset(s->coupling, 0, s->topology->edge_count * sizeof *s->coupling);
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    double normal[3]; /* the length of this vector is twice the area of the triangle */
    supine_normal(p + 3 * (size_t)corner[0], p + 3 * (size_t)corner[1], p + 3 * (size_t)corner[2],
                  normal);
    double dot[3]; /* of the sides at each corner; their sum is half that of the squared sides */
    for (size_t k = 0; k < 3; ++k) {
      double sides[2][3];
      supine_subtract(p + 3 * (size_t)corner[(k + 1) % 3], p + 3 * (size_t)corner[k], sides[0]);
      supine_subtract(p + 3 * (size_t)corner[(k + 2) % 3], p + 3 * (size_t)corner[k], sides[1]);
      dot[k] = supine_dot(sides[0], sides[1]);
    }
    const double divisor =
        fmax(fmax(supine_length(normal), least), flattest * (dot[0] + dot[1] + dot[2]));
    for (size_t k = 0; k < 3; ++k) {
      s->coupling[find_edge(s, corner[(k + 1) % 3], corner[(k + 2) % 3])] +=
          0.5 * reach * reach / mean * dot[k] / divisor;
    }
  }
}

void supine_physics_smoothing_set_shape(supine_smoothing *s, const supine_mesh *mesh,
                                        double reach) {
  set_weights(s, mesh, reach);
  memcpy(s->diagonal, s->area, s->vertex_count * sizeof *s->diagonal);
  for (size_t e = 0; e < s->topology->edge_count; ++e) {
    s->diagonal[s->topology->edges[2 * e]] += s->coupling[e];
    s->diagonal[s->topology->edges[2 * e + 1]] += s->coupling[e];
  }
  supine_physics_factorisation_set(s->factorisation, s->diagonal, s->coupling);
}

supine_status supine_physics_smoothing_create(const supine_mesh *mesh,
                                              const supine_topology *topology, double reach,
                                              supine_smoothing **smoothing, supine_error *error) {
  const size_t n = mesh->vertex_count;
  supine_smoothing *made = *smoothing = calloc(1, sizeof *made);
  if (made == NULL) {
    return supine_error_memory(error, "the equilibrium");
  }
  made->vertex_count = n;
  made->topology = topology;
  made->edge_begin = supine_arena_take(&made->memory, n, sizeof *made->edge_begin);
  made->area = supine_arena_take(&made->memory, n, sizeof *made->area);
  made->diagonal = supine_arena_take(&made->memory, n, sizeof *made->diagonal);
  made->coupling = supine_arena_take(&made->memory, topology->edge_count, sizeof *made->coupling);
  SUPINE_TRY(supine_arena_check(&made->memory, error, "the equilibrium of %zu vertices", n));
  SUPINE_TRY(supine_physics_factorisation_create(topology, n, &made->factorisation, error));
  index_edges(made);
  supine_physics_smoothing_set_shape(made, mesh, reach);
  return SUPINE_OK;
}

supine_status supine_physics_smoothing_solve(supine_smoothing *smoothing, size_t count,
                                             const double *force, double *smoothed,
                                             supine_error *error) {
  for (size_t i = 0; i < smoothing->vertex_count; ++i) {
    for (size_t c = 0; c < count; ++c) {
      smoothed[i * count + c] = smoothing->area[i] * force[i * count + c];
    }
  }
  return supine_physics_factorisation_solve(smoothing->factorisation, count, smoothed, smoothed,
                                            error);
}

void supine_physics_smoothing_force(supine_smoothing *smoothing, const double *smoothed,
                                    double *force) {
  supine_physics_factorisation_multiply(smoothing->factorisation, smoothed, force);
  for (size_t i = 0; i < smoothing->vertex_count; ++i) {
    force[i] /= smoothing->area[i];
  }
}
