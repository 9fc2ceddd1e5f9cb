/* SPDX-License-Identifier: MIT */
/* Find edges by sorting the sides of the triangles, and components by union-find over the edges. */
#include <stdlib.h>

#include "mesh/repair.h"

/* largest number of triangle sides for which insertion sort is faster than qsort */
enum { FEW = 24 };

static int compare_sides(const void *left, const void *right) {
  const supine_mesh_side *a = left;
  const supine_mesh_side *b = right;
  return a->high != b->high ? (a->high > b->high) - (a->high < b->high)
                            : (a->at > b->at) - (a->at < b->at);
}

/* Sort triangle sides with the same smaller vertex index by their larger vertex index. Sides on the
 * same edge keep the order of their triangles. */
static void sort_sides(supine_mesh_side *sides, size_t count) {
  if (count > FEW) {
    qsort(sides, count, sizeof *sides, compare_sides);
    return;
  }
  for (size_t i = 1; i < count; ++i) { /* a stable insertion sort */
    const supine_mesh_side side = sides[i];
    size_t j = i;
    for (; j > 0 && sides[j - 1].high > side.high; --j) {
      sides[j] = sides[j - 1];
    }
    sides[j] = side;
  }
}

supine_mesh_side *supine_mesh_sides_sort(const supine_mesh *mesh, supine_arena *arena) {
  const size_t count = 3 * mesh->triangle_count;
  SUPINE_ARENA temporary = {0};
  uint32_t *next = supine_arena_zeros(&temporary, mesh->vertex_count + 2, sizeof *next);
  supine_mesh_side *sides = supine_arena_take(arena, count, sizeof *sides);
  if (next == NULL || sides == NULL) {
    return NULL;
  }
  /* bucket sort by the smaller vertex index of each side: pass 0 counts, pass 1 stores */
  for (int pass = 0; pass < 2; ++pass) {
    for (size_t i = 0; i < count; ++i) {
      const uint32_t a = mesh->triangles[i];
      const uint32_t b = mesh->triangles[i % 3 == 2 ? i - 2 : i + 1];
      const uint32_t low = a < b ? a : b;
      if (pass == 0) {
        ++next[low + 1];
      } else {
        sides[next[low]++] = (supine_mesh_side){low, a < b ? b : a, (uint32_t)i};
      }
    }
    if (pass == 0) {
      for (size_t v = 0; v < mesh->vertex_count; ++v) {
        next[v + 1] += next[v];
      }
    }
  }
  size_t begin = 0;
  for (size_t v = 0; v < mesh->vertex_count; ++v) {
    sort_sides(sides + begin, next[v] - begin);
    begin = next[v];
  }
  return sides;
}

size_t supine_mesh_sides_of_edge(const supine_mesh_side *sides, size_t i, size_t count) {
  size_t size = 1;
  while (i + size < count && sides[i + size].low == sides[i].low &&
         sides[i + size].high == sides[i].high) {
    ++size;
  }
  return size;
}

static void edges_count(const supine_mesh *mesh, const supine_mesh_side *sides,
                        supine_topology *topology) {
  const size_t count = 3 * mesh->triangle_count;
  for (size_t i = 0, size = 0; i < count; i += size) {
    const supine_mesh_side *s = &sides[i];
    size = supine_mesh_sides_of_edge(sides, i, count);
    ++topology->edge_count;
    topology->boundary_edges += size == 1;
    topology->non_manifold_edges += size > 2;
    topology->inconsistent_edges +=
        size == 2 && mesh->triangles[s[0].at] == mesh->triangles[s[1].at];
  }
}

/* Find the root of i's tree, the lowest index in it, with path compression. */
static uint32_t tree_root(uint32_t *parent, uint32_t i) {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

size_t supine_mesh_components(size_t vertex_count, size_t corners, size_t count,
                              const uint32_t *faces, uint32_t *component) {
  uint32_t *parent = component;
  size_t found = 0;
  for (size_t i = 0; i < vertex_count; ++i) {
    parent[i] = (uint32_t)i;
  }
  for (size_t i = 0; i < corners * count; ++i) {
    const uint32_t a = tree_root(parent, faces[i]);
    const uint32_t b = tree_root(parent, faces[i / corners * corners]);
    parent[a > b ? a : b] = a < b ? a : b;
  }
  /* Number the components. Each vertex takes the number of its parent, whose index is lower. */
  for (size_t i = 0; i < vertex_count; ++i) {
    parent[i] = parent[i] == i ? (uint32_t)found++ : parent[parent[i]];
  }
  return found;
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
  SUPINE_ARENA arena = {0};
  SUPINE_FREED_BY(supine_mesh_topology_free) supine_topology result = {0};
  const supine_mesh_side *sides = supine_mesh_sides_sort(mesh, &arena);
  if (sides == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  edges_count(mesh, sides, &result);
  result.edges = malloc((2 * result.edge_count + 1) * sizeof *result.edges);
  result.component = malloc((vertices + 1) * sizeof *result.component);
  if (result.edges == NULL || result.component == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  const size_t count = 3 * mesh->triangle_count;
  uint32_t *edge = result.edges;
  for (size_t i = 0; i < count; i += supine_mesh_sides_of_edge(sides, i, count)) {
    *edge++ = sides[i].low;
    *edge++ = sides[i].high;
  }
  result.component_count =
      supine_mesh_components(vertices, 2, result.edge_count, result.edges, result.component);

  result.euler_characteristic =
      (long)vertices - (long)result.edge_count + (long)mesh->triangle_count;
  result.closed = mesh->triangle_count > 0 && result.boundary_edges == 0 &&
                  result.non_manifold_edges == 0 && result.inconsistent_edges == 0;
  const long holes = 2 * (long)result.component_count - result.euler_characteristic;
  result.genus = result.closed && holes >= 0 && holes % 2 == 0 ? holes / 2 : -1;
  *topology = result;
  result = (supine_topology){0};
  return SUPINE_OK;
}

void supine_mesh_topology_free(supine_topology *topology) {
  free(topology->edges);
  free(topology->component);
  *topology = (supine_topology){0};
}
