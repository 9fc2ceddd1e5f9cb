/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Run the Pitcher/Catcher iteration as published: equations (5)-(14) of [Santhanam2008]. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "precompute/physics/network.h"
#include "precompute/physics/stiffness.h"

/* Most steps for each vertex. A uniform stiffness needs about 20 for a tolerance of 1e-6. */
enum { STEPS_EACH = 100000 };

/* State of the iteration. Node i < N is vertex i of a mesh of N vertices; node N + e is edge e. */
typedef struct iteration {
  size_t node_count;
  size_t *neighbours_begin; /* [nodes + 2] index in `neighbours` of each node's first neighbour */
  size_t *neighbours;       /* neighbours of every node, node by node */
  double *passed_share;     /* share of a node's force that each element of `neighbours` gets */
  double *kept_share;       /* [nodes] share of the force on a node that the node keeps */
  double *pitcher; /* [nodes] force that each node has yet to distribute; may be negative */
  double *catcher; /* [nodes] total force that each node has kept in the steps so far */
  /* [2 nodes] tournament tree to find the node with the largest |pitcher|. Element nodes + j is the
   * leaf of node j. Element k < nodes is the winner of the elements 2 k and 2 k + 1. */
  size_t *largest;
} iteration;

/* Update the tree it->largest after it->pitcher[node] has changed. */
static void update(iteration *it, size_t node) {
  for (size_t k = (it->node_count + node) / 2; k > 0; k /= 2) {
    const size_t a = it->largest[2 * k];
    const size_t b = it->largest[2 * k + 1];
    it->largest[k] = fabs(it->pitcher[a]) >= fabs(it->pitcher[b]) ? a : b;
  }
}

static iteration allocate(supine_arena *arena, size_t nodes, size_t edges) {
  iteration it = {.node_count = nodes};
  it.neighbours_begin = supine_arena_zeros(arena, nodes + 2, sizeof *it.neighbours_begin);
  it.neighbours = supine_arena_take(arena, 4 * edges, sizeof *it.neighbours);
  it.passed_share = supine_arena_take(arena, 4 * edges, sizeof *it.passed_share);
  it.kept_share = supine_arena_take(arena, nodes, sizeof *it.kept_share);
  it.pitcher = supine_arena_zeros(arena, nodes, sizeof *it.pitcher);
  it.catcher = supine_arena_zeros(arena, nodes, sizeof *it.catcher);
  it.largest = supine_arena_zeros(arena, 2 * nodes, sizeof *it.largest);
  return it;
}

/* Find the neighbours of every node, and the shares of force that nodes pass to them by equation
 * (8) of [Santhanam2008]. */
static void connect(const supine_mesh *mesh, const supine_topology *topology,
                    const double *stiffness, iteration *it) {
  const size_t n = mesh->vertex_count;
  const size_t nodes = it->node_count;
  size_t *begin = it->neighbours_begin + 1;
  for (size_t e = 0; e < topology->edge_count; ++e) {
    ++begin[topology->edges[2 * e] + 1];
    ++begin[topology->edges[2 * e + 1] + 1];
    begin[n + e + 1] += 2;
  }
  for (size_t j = 1; j <= nodes; ++j) {
    begin[j] += begin[j - 1];
  }
  for (size_t e = 0; e < topology->edge_count; ++e) {
    const uint32_t *edge = topology->edges + 2 * e;
    const double d = supine_physics_link_distance(mesh->vertices + 3 * (size_t)edge[0],
                                                  mesh->vertices + 3 * (size_t)edge[1]);
    const double spring = 0.5 * (stiffness[edge[0]] + stiffness[edge[1]]);
    for (size_t k = 0; k < 2; ++k) {
      it->neighbours[begin[edge[k]]] = n + e;
      it->passed_share[begin[edge[k]]++] = spring / d;
      it->neighbours[begin[n + e]] = edge[k];
      it->passed_share[begin[n + e]++] = 1.0 / stiffness[edge[k]] / d;
    }
  }
  for (size_t j = 0; j < nodes; ++j) {
    const uint32_t *edge = j < n ? NULL : topology->edges + 2 * (j - n);
    const double s = j < n ? 1.0 / stiffness[j] : 0.5 * (stiffness[edge[0]] + stiffness[edge[1]]);
    double z = s;
    for (size_t c = it->neighbours_begin[j]; c < it->neighbours_begin[j + 1]; ++c) {
      z += it->passed_share[c];
    }
    for (size_t c = it->neighbours_begin[j]; c < it->neighbours_begin[j + 1]; ++c) {
      it->passed_share[c] /= z;
    }
    it->kept_share[j] = s / z;
  }
}

/* Spread the force it->pitcher[j] over node j and its neighbours: [Santhanam2008] (5)-(7). */
static void distribute(iteration *it, size_t j) {
  const double held = it->pitcher[j];
  it->catcher[j] += it->kept_share[j] * held;
  it->pitcher[j] = 0.0;
  update(it, j);
  for (size_t c = it->neighbours_begin[j]; c < it->neighbours_begin[j + 1]; ++c) {
    const size_t i = it->neighbours[c];
    it->pitcher[i] += it->passed_share[c] * held;
    update(it, i);
  }
}

/* All nine parameters are inputs and outputs of the published algorithm. */
supine_status
supine_physics_pitcher_catcher(const supine_mesh *mesh, const supine_topology *topology,
                               const double *stiffness, const double *force, double tolerance,
                               double *masses,
                               void (*progress)(void *context, size_t steps, double remaining),
                               void *context, supine_error *error) {
  const size_t n = mesh->vertex_count;
  const size_t nodes = n + topology->edge_count;
  SUPINE_ARENA arena = {0};
  iteration it = allocate(&arena, nodes, topology->edge_count);
  double *scaled = supine_arena_take(&arena, n, sizeof *scaled);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu nodes", nodes));
  SUPINE_TRY(supine_physics_stiffness_normalise(n, stiffness, scaled, error));
  connect(mesh, topology, scaled, &it);
  double largest = 0.0;
  double sum = 0.0;
  for (size_t i = 0; i < n; ++i) {
    it.pitcher[i] = force[i];
    largest = fmax(largest, fabs(force[i]));
    sum += fabs(force[i]);
  }
  for (size_t j = 0; j < it.node_count; ++j) {
    it.largest[it.node_count + j] = j;
  }
  for (size_t j = 0; j < it.node_count; ++j) {
    update(&it, j);
  }
  for (size_t steps = 0; fabs(it.pitcher[it.largest[1]]) > tolerance * largest; ++steps) {
    SUPINE_REFUSE_IF(steps / STEPS_EACH >= n, error, SUPINE_ERROR_NUMERICAL,
                     "the iteration has not converged after %d steps for each vertex: solve "
                     "directly, or give a stiffness that varies less",
                     (int)STEPS_EACH);
    if (progress != NULL && steps % n == 0) {
      double remaining = 0.0;
      for (size_t j = 0; j < it.node_count; ++j) {
        remaining += fabs(it.pitcher[j]);
      }
      progress(context, steps, remaining / sum);
    }
    distribute(&it, it.largest[1]);
  }
  memcpy(masses, it.catcher, n * sizeof *masses);
  return SUPINE_OK;
}
