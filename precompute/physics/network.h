/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The nodes and their links. */
#ifndef SUPINE_NETWORK_H
#define SUPINE_NETWORK_H

#include "precompute/physics/coarse.h"
#include "precompute/physics/equilibrium.h"
#include "sh/base/clones.h"

/* Vertex adjacency: the links of vertex i are links.begin[i] <= s < links.begin[i + 1], and lead to
 * links.column[s]. */
struct supine_network {
  size_t vertex_count;
  supine_rows
      links;        /* [N], 2 E in all, internal numbers; values: conductance, where there is one */
  double *distance; /* [2 E] D(mass, spring): half the edge's length, at least 1 mm */
  uint32_t *order;  /* [N] file's number of internal vertex i */
  uint32_t *rank;   /* [N] internal number of the file's vertex i */
  double *lesions;  /* [N] factors on the normalised stiffness, file's order; NULL: 1 */
  /* With a reach; NULL without. */
  double *area;        /* [N] area of a vertex over the mean; NULL: springs, 1; internal order */
  double *conductance; /* [2 E] half of w, what passes per difference of t */
  supine_hierarchy *coarse;
};

/* The stiffness of (III-E) from expandability or as given: scaled to geometric mean 1. */
supine_status supine_physics_stiffness_normalise(size_t count, const double *stiffness,
                                                 double *scaled, supine_error *error);

/* D(mass, spring) of an edge of the given length, mm. */
double supine_physics_link_distance(const double *first, const double *second);

#endif
