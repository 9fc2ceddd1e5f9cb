/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The geometry of the nodes: links in compressed rows, renumbered where the file's order is poor.
 */
#include <math.h>
#include <stdlib.h>

#include "precompute/physics/network.h"

double supine_physics_link_distance(const double *first, const double *second) {
  const double x = first[0] - second[0];
  const double y = first[1] - second[1];
  const double z = first[2] - second[2];
  return fmax(1.0, 0.5 * sqrt(x * x + y * y + z * z));
}

/* Rows of the graph in the file's numbers: where each begins, and who is in it. */
static void fill_rows(size_t vertices, const supine_topology *topology, size_t *row_begin,
                      uint32_t *neighbour) {
  for (size_t i = 0; i <= vertices; ++i) {
    row_begin[i] = 0;
  }
  for (size_t e = 0; e < 2 * topology->edge_count; ++e) {
    ++row_begin[topology->edges[e]];
  }
  size_t sum = 0;
  for (size_t i = 0; i <= vertices; ++i) { /* ends of the rows, walked back to their beginnings */
    sum += row_begin[i];
    row_begin[i] = sum;
  }
  for (size_t e = topology->edge_count; e-- > 0;) {
    const uint32_t *edge = topology->edges + 2 * e;
    neighbour[--row_begin[edge[0]]] = edge[1];
    neighbour[--row_begin[edge[1]]] = edge[0];
  }
}

/* Whether links span so much of the file that a solve would miss the caches: a good order of a
 * surface spans about the square root of its vertices. */
static bool order_is_poor(size_t vertices, const supine_topology *topology) {
  double span = 0.0;
  for (size_t e = 0; e < topology->edge_count; ++e) {
    span += (double)(topology->edges[2 * e + 1] - topology->edges[2 * e]);
  }
  return span > 4.0 * sqrt((double)vertices) * (double)topology->edge_count;
}

/* Breadth-first order of every component (Cuthill and McKee 1969, without the sort by degree). */
static void breadth_first(size_t vertices, const size_t *row_begin, const uint32_t *neighbour,
                          uint32_t *order, uint32_t *rank) {
  for (size_t i = 0; i < vertices; ++i) {
    rank[i] = UINT32_MAX;
  }
  size_t found = 0;
  for (size_t seed = 0; seed < vertices; ++seed) {
    if (rank[seed] != UINT32_MAX) {
      continue;
    }
    size_t next = found;
    rank[seed] = (uint32_t)found;
    order[found++] = (uint32_t)seed;
    for (; next < found; ++next) {
      const uint32_t i = order[next];
      for (size_t s = row_begin[i]; s < row_begin[i + 1]; ++s) {
        if (rank[neighbour[s]] == UINT32_MAX) {
          rank[neighbour[s]] = (uint32_t)found;
          order[found++] = neighbour[s];
        }
      }
    }
  }
}

supine_status supine_physics_network_create(const supine_mesh *mesh,
                                            const supine_topology *topology,
                                            supine_network **network) {
  const size_t n = mesh->vertex_count;
  const size_t links = 2 * topology->edge_count;
  supine_network *made = calloc(1, sizeof *made);
  size_t *row_begin = malloc((n + 1) * sizeof *row_begin);
  uint32_t *neighbour = malloc((links + 1) * sizeof *neighbour);
  *network = NULL;
  if (made == NULL || row_begin == NULL || neighbour == NULL) {
    goto fail;
  }
  made->vertex_count = n;
  made->links.count = n;
  made->links.begin = malloc((n + 1) * sizeof *made->links.begin);
  made->links.column = malloc((links + 1) * sizeof *made->links.column);
  made->distance = malloc((links + 1) * sizeof *made->distance);
  made->order = malloc((n + 1) * sizeof *made->order);
  made->rank = malloc((n + 1) * sizeof *made->rank);
  if (made->links.begin == NULL || made->links.column == NULL || made->distance == NULL ||
      made->order == NULL || made->rank == NULL) {
    goto fail;
  }
  fill_rows(n, topology, row_begin, neighbour);
  if (order_is_poor(n, topology)) {
    breadth_first(n, row_begin, neighbour, made->order, made->rank);
  } else {
    for (size_t i = 0; i < n; ++i) {
      made->order[i] = made->rank[i] = (uint32_t)i;
    }
  }
  size_t slot = 0;
  for (size_t i = 0; i < n; ++i) {
    const uint32_t v = made->order[i];
    made->links.begin[i] = slot;
    for (size_t s = row_begin[v]; s < row_begin[v + 1]; ++s, ++slot) {
      made->links.column[slot] = made->rank[neighbour[s]];
      made->distance[slot] = supine_physics_link_distance(
          mesh->vertices + 3 * (size_t)v, mesh->vertices + 3 * (size_t)neighbour[s]);
    }
  }
  made->links.begin[n] = slot;
  free(row_begin);
  free(neighbour);
  *network = made;
  return SUPINE_OK;
fail:
  free(row_begin);
  free(neighbour);
  supine_physics_network_destroy(made);
  return SUPINE_ERROR_MEMORY;
}

void supine_physics_network_destroy(supine_network *network) {
  if (network != NULL) {
    supine_physics_hierarchy_destroy(network->coarse);
    supine_physics_rows_free(&network->links);
    free(network->distance);
    free(network->order);
    free(network->rank);
    free(network->area);
    free(network->conductance);
    free(network->lesions);
    free(network);
  }
}
