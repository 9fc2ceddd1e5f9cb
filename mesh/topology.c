/* SPDX-License-Identifier: MIT */
/* Find edges by sorting the triangles' sides, and components by joining their ends. */
#include <stdlib.h>
#include <string.h>

#include "mesh/mesh.h"

enum { FEW = 24 }; /* most sides that insertion sort sorts faster than qsort */

/* The triangles' sides, sorted: those with lower end a are at first[a] <= s < first[a + 1], each
 * as 2 * (higher end) + (1 if the triangle runs from the higher end to the lower). */
typedef struct side_table {
  uint32_t *first; /* [vertex_count + 2] */
  uint32_t *sides; /* [3 * triangle_count] */
} side_table;

static int compare_sides(const void *left, const void *right) {
  const uint32_t a = *(const uint32_t *)left;
  const uint32_t b = *(const uint32_t *)right;
  return (a > b) - (a < b);
}

static void sort_sides(uint32_t *sides, size_t count) {
  if (count > FEW) {
    qsort(sides, count, sizeof *sides, compare_sides);
    return;
  }
  for (size_t i = 1; i < count; ++i) {
    const uint32_t side = sides[i];
    size_t j = i;
    for (; j > 0 && sides[j - 1] > side; --j) {
      sides[j] = sides[j - 1];
    }
    sides[j] = side;
  }
}

/* Sort by the lower end with a counting sort, then each vertex's sides by the higher. */
static void sides_fill(const supine_mesh *mesh, const side_table *table) {
  const size_t triangles = mesh->triangle_count;
  uint32_t *next = table->first + 1; /* next[a] moves from the beginning of a's sides to their
                                      * end */
  for (size_t t = 0; t < triangles; ++t) {
    const uint32_t *v = mesh->triangles + 3 * t;
    for (int k = 0; k < 3; ++k) {
      const uint32_t a = v[k];
      const uint32_t b = v[(k + 1) % 3];
      ++next[(size_t)(a < b ? a : b) + 1];
    }
  }
  for (size_t i = 1; i <= mesh->vertex_count; ++i) {
    next[i] += next[i - 1];
  }
  for (size_t t = 0; t < triangles; ++t) {
    const uint32_t *v = mesh->triangles + 3 * t;
    for (int k = 0; k < 3; ++k) {
      const uint32_t a = v[k];
      const uint32_t b = v[(k + 1) % 3];
      if (a < b) {
        table->sides[next[a]++] = 2 * b;
      } else {
        table->sides[next[b]++] = 2 * a + 1;
      }
    }
  }
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    sort_sides(table->sides + table->first[i], table->first[i + 1] - table->first[i]);
  }
}

/* Count the sides from s on that belong to one edge. */
static size_t edge_sides(const side_table *table, size_t s, size_t stop) {
  size_t count = 1;
  while (s + count < stop && table->sides[s + count] / 2 == table->sides[s] / 2) {
    ++count;
  }
  return count;
}

static void edges_count(const supine_mesh *mesh, const side_table *table,
                        supine_topology *topology) {
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    const size_t stop = table->first[i + 1];
    for (size_t s = table->first[i]; s < stop;) {
      const size_t sides = edge_sides(table, s, stop);
      ++topology->edge_count;
      topology->boundary_edges += sides == 1;
      topology->non_manifold_edges += sides > 2;
      topology->inconsistent_edges += sides == 2 && table->sides[s] == table->sides[s + 1];
      s += sides;
    }
  }
}

static void edges_fill(const supine_mesh *mesh, const side_table *table, uint32_t *edges) {
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    const size_t stop = table->first[i + 1];
    for (size_t s = table->first[i]; s < stop; s += edge_sides(table, s, stop)) {
      *edges++ = (uint32_t)i;
      *edges++ = table->sides[s] / 2;
    }
  }
}

/* Find the first vertex of i's tree, with path compression. */
static uint32_t tree_root(uint32_t *parent, uint32_t i) {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

static void components_find(size_t vertex_count, supine_topology *topology) {
  uint32_t *parent = topology->component;
  for (size_t i = 0; i < vertex_count; ++i) {
    parent[i] = (uint32_t)i;
  }
  for (size_t e = 0; e < topology->edge_count; ++e) {
    const uint32_t a = tree_root(parent, topology->edges[2 * e]);
    const uint32_t b = tree_root(parent, topology->edges[2 * e + 1]);
    parent[a > b ? a : b] = a < b ? a : b;
  }
  /* Number the components in one pass: a vertex takes the number of its parent, whose index is
   * lower. */
  for (size_t i = 0; i < vertex_count; ++i) {
    parent[i] = parent[i] == i ? (uint32_t)topology->component_count++ : parent[parent[i]];
  }
}

static bool triangles_legal(const supine_mesh *mesh) {
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *v = mesh->triangles + 3 * t;
    if (v[0] >= mesh->vertex_count || v[1] >= mesh->vertex_count || v[2] >= mesh->vertex_count ||
        v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) {
      return false;
    }
  }
  return true;
}

supine_status supine_mesh_topology_create(const supine_mesh *mesh, supine_topology *topology) {
  const size_t vertices = mesh->vertex_count;
  if (vertices > INT32_MAX || mesh->triangle_count > UINT32_MAX / 3 || !triangles_legal(mesh)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  supine_status status = SUPINE_ERROR_MEMORY;
  supine_topology result = {0};
  side_table table = {.first = calloc(vertices + 2, sizeof *table.first),
                      .sides = malloc((3 * mesh->triangle_count + 1) * sizeof *table.sides)};
  if (table.first == NULL || table.sides == NULL) {
    goto cleanup;
  }
  sides_fill(mesh, &table);
  edges_count(mesh, &table, &result);
  result.edges = malloc((2 * result.edge_count + 1) * sizeof *result.edges);
  result.component = malloc((vertices + 1) * sizeof *result.component);
  if (result.edges == NULL || result.component == NULL) {
    goto cleanup;
  }
  edges_fill(mesh, &table, result.edges);
  components_find(vertices, &result);

  result.euler_characteristic =
      (long)vertices - (long)result.edge_count + (long)mesh->triangle_count;
  result.closed = mesh->triangle_count > 0 && result.boundary_edges == 0 &&
                  result.non_manifold_edges == 0 && result.inconsistent_edges == 0;
  const long holes = 2 * (long)result.component_count - result.euler_characteristic;
  result.genus = result.closed && holes >= 0 && holes % 2 == 0 ? holes / 2 : -1;
  *topology = result;
  result = (supine_topology){0};
  status = SUPINE_OK;

cleanup:
  supine_mesh_topology_free(&result);
  free(table.sides);
  free(table.first);
  return status;
}

void supine_mesh_topology_free(supine_topology *topology) {
  free(topology->edges);
  free(topology->component);
  *topology = (supine_topology){0};
}
