/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What the files of this folder share and nobody else sees. */
#ifndef SUPINE_PRECOMPUTE_INTERNAL_H
#define SUPINE_PRECOMPUTE_INTERNAL_H

#include "precompute/physics/equilibrium.h"
#include "sh/base/clones.h"

/* Vertex adjacency in compressed rows: the links of vertex i are row_begin[i] <= s < row_begin[i +
 * 1]. */
struct supine_network {
  size_t vertex_count;
  size_t *row_begin;   /* [N + 1] */
  uint32_t *neighbour; /* [2 E] internal numbers */
  double *distance;    /* [2 E] D(mass, spring): half the edge's length, at least 1 mm; with a
                          reach, what stands in its place */
  uint32_t *order;     /* [N] file's number of internal vertex i */
  uint32_t *rank;      /* [N] internal number of the file's vertex i */
  double *own;         /* [N] weight of a mass to itself, 1 / D(j, j); internal order; NULL: 1 */
  double spring_own;   /* that of a spring: 1, or 0 where springs catch nothing */
  double *lesions;     /* [N] factors on the normalised stiffness, file's order; NULL: 1 */
  double reach;        /* mm; 0: the paper's */
};

/* The stiffness of (III-E) from expandability or as given: scaled to geometric mean 1. */
supine_status supine_physics_stiffness_normalise(size_t count, const double *stiffness,
                                                 double *scaled, supine_error *error);

/* D(mass, spring) of an edge of the given length, mm. */
double supine_physics_link_distance(const double *first, const double *second);

/* Replaces the links' distances and the masses' own weights by those of a spreading length in mm.
 */
supine_status supine_physics_network_set_reach(supine_network *network, const supine_mesh *mesh,
                                               const supine_topology *topology, double reach);

/* Of vectors of three. */
static inline double supine_dot(const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#endif
