/* SPDX-License-Identifier: MIT */
/* Repair small defects of surfaces: duplicate, loose and reversed triangles, touching surfaces,
 * small pieces. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"

#include "mesh/repair.h"

/* A triangle is loose if none of its edges belongs to exactly two triangles. If at most this
 * fraction of the triangles is loose, they are dropped; otherwise they are all kept. */
static const double most_loose = 0.01;

typedef struct triangle_forest {
  uint32_t *parent; /* [triangles] parent in a union-find tree; one tree for each surface */
  uint8_t *turned;  /* [triangles] 1 if the triangle faces the other way than its parent, else 0 */
} triangle_forest;

/* Return the corner of a triangle that is opposite to a side. */
static uint32_t opposite(const supine_mesh *mesh, const supine_mesh_side *s) {
  return mesh->triangles[s->at % 3 == 0 ? s->at + 2 : s->at - 1];
}

/* Mark triangles with the same three corners as an earlier triangle. */
static void mark_duplicates(const supine_mesh *mesh, const supine_mesh_side *sides, uint8_t *drop) {
  const size_t count = 3 * mesh->triangle_count;
  for (size_t i = 0; i < count; i += supine_mesh_sides_of_edge(sides, i, count)) {
    const size_t size = supine_mesh_sides_of_edge(sides, i, count);
    for (size_t b = 1; b < size; ++b) {
      for (size_t a = 0; a < size; ++a) {
        if (sides[i + a].at / 3 < sides[i + b].at / 3 &&
            opposite(mesh, &sides[i + a]) == opposite(mesh, &sides[i + b])) {
          drop[sides[i + b].at / 3] = 1;
        }
      }
    }
  }
}

/* Mark triangles none of whose edges belongs to exactly two triangles. If their fraction exceeds
 * most_loose, mark none. */
static void mark_loose(const supine_mesh *mesh, const supine_mesh_side *sides, uint8_t *drop) {
  const size_t count = 3 * mesh->triangle_count;
  size_t loose = mesh->triangle_count;
  memset(drop, 1, mesh->triangle_count);
  for (size_t i = 0; i < count; i += supine_mesh_sides_of_edge(sides, i, count)) {
    const size_t size = supine_mesh_sides_of_edge(sides, i, count);
    if (size == 2) {
      for (size_t s = 0; s < 2; ++s) {
        loose -= drop[sides[i + s].at / 3];
        drop[sides[i + s].at / 3] = 0;
      }
    }
  }
  if ((double)loose > most_loose * (double)mesh->triangle_count) {
    memset(drop, 0, mesh->triangle_count);
  }
}

static size_t drop_marked(supine_mesh *mesh, const uint8_t *drop) {
  size_t kept = 0;
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    if (drop[t] == 0) {
      memmove(mesh->triangles + 3 * kept++, mesh->triangles + 3 * t, 3 * sizeof(uint32_t));
    }
  }
  const size_t dropped = mesh->triangle_count - kept;
  mesh->triangle_count = kept;
  return dropped;
}

/* Return the root of the tree of triangle t. Set `turned` to 1 if t and the root face opposite
 * ways, otherwise to 0. */
static uint32_t find_root(const triangle_forest *l, uint32_t t, uint8_t *turned) {
  uint8_t sum = 0;
  uint32_t root = t;
  while (l->parent[root] != root) {
    sum ^= l->turned[root];
    root = l->parent[root];
  }
  *turned = sum;
  /* make the root the parent of every triangle on the way to it */
  while (l->parent[t] != root && t != root) {
    const uint32_t next = l->parent[t];
    const uint8_t here = l->turned[t];
    l->parent[t] = root;
    l->turned[t] = sum;
    sum ^= here;
    t = next;
  }
  return root;
}

/* For each edge of exactly two triangles, unite their union-find trees. Return false if a surface
 * is one-sided. Set `closed` to whether every edge belongs to an even number of triangles. */
static bool link_triangles(const supine_mesh *mesh, const supine_mesh_side *sides,
                           const triangle_forest *l, bool *closed) {
  const size_t count = 3 * mesh->triangle_count;
  bool sound = true;
  *closed = true;
  for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
    l->parent[t] = t;
    l->turned[t] = 0;
  }
  for (size_t i = 0; i < count; i += supine_mesh_sides_of_edge(sides, i, count)) {
    const size_t size = supine_mesh_sides_of_edge(sides, i, count);
    *closed = *closed && size % 2 == 0;
    if (size != 2) {
      continue;
    }
    const supine_mesh_side *s = &sides[i];
    const bool same =
        (mesh->triangles[s[0].at] == s[0].low) == (mesh->triangles[s[1].at] == s[1].low);
    uint8_t turned[2];
    const uint32_t a = find_root(l, s[0].at / 3, &turned[0]);
    const uint32_t b = find_root(l, s[1].at / 3, &turned[1]);
    const uint8_t needed = (uint8_t)(same ? 1 : 0) ^ turned[0] ^ turned[1];
    if (a == b) {
      sound = sound && needed == 0;
    } else {
      l->parent[a > b ? a : b] = a > b ? b : a;
      l->turned[a > b ? a : b] = needed;
    }
  }
  return sound;
}

/* In each surface, reverse the triangles that face the other way than the majority. Return the
 * number of reversed triangles. */
static size_t turn_minority(supine_mesh *mesh, const triangle_forest *l, uint32_t (*count)[2]) {
  size_t reversed = 0;
  uint8_t turned;
  for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t root = find_root(l, t, &turned);
    ++count[root][turned];
  }
  for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *of = count[find_root(l, t, &turned)];
    if (of[turned] < of[1 - turned] || (of[0] == of[1] && turned == 1)) {
      uint32_t *corner = mesh->triangles + 3 * (size_t)t;
      const uint32_t second = corner[1];
      corner[1] = corner[2];
      corner[2] = second;
      ++reversed;
    }
  }
  return reversed;
}

/* Copy vertices that several surfaces share, so that each surface has its own vertices.
 * @param separated  output: number of copies */
static supine_status separate_touching(supine_mesh *mesh, const triangle_forest *l,
                                       size_t *separated) {
  const size_t corners = 3 * mesh->triangle_count;
  size_t count = mesh->vertex_count;
  SUPINE_ARENA arena = {0};
  uint32_t *surface_of = supine_arena_take(&arena, count + corners, sizeof *surface_of);
  uint32_t *next_copy = supine_arena_zeros(&arena, count + corners, sizeof *next_copy);
  SUPINE_TRY(supine_arena_status(&arena));
  /* sets all to UINT32_MAX, which means unknown */
  memset(surface_of, 0xFF, (count + corners) * sizeof *surface_of);
  for (size_t i = 0; i < corners; ++i) {
    uint8_t turned;
    const uint32_t root = find_root(l, (uint32_t)(i / 3), &turned);
    uint32_t v = mesh->triangles[i];
    while (surface_of[v] != UINT32_MAX && surface_of[v] != root) {
      next_copy[v] = next_copy[v] == 0 ? (uint32_t)count++ : next_copy[v];
      v = next_copy[v];
    }
    surface_of[v] = root;
    mesh->triangles[i] = v;
  }
  *separated = count - mesh->vertex_count;
  if (*separated == 0) {
    return SUPINE_OK;
  }
  double *grown = realloc(mesh->vertices, 3 * count * sizeof *grown);
  if (grown == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t v = 0; v < mesh->vertex_count; ++v) {
    for (size_t c = next_copy[v]; c != 0; c = next_copy[c]) {
      memcpy(grown + 3 * c, grown + 3 * v, 3 * sizeof *grown);
    }
  }
  mesh->vertices = grown;
  mesh->vertex_count = count;
  return SUPINE_OK;
}

/* In each surface, reverse the triangles that face the other way than the majority. If every edge
 * belongs to an even number of triangles, also separate surfaces that share vertices. */
static supine_status mend_links(supine_mesh *mesh, const supine_mesh_side *sides,
                                supine_mesh_repair_report *report) {
  const size_t n = mesh->triangle_count;
  SUPINE_ARENA arena = {0};
  const triangle_forest l = {supine_arena_take(&arena, n, sizeof(uint32_t)),
                             supine_arena_take(&arena, n, 1)};
  uint32_t(*count)[2] = supine_arena_zeros(&arena, n, sizeof *count);
  bool closed;
  SUPINE_TRY(supine_arena_status(&arena));
  if (link_triangles(mesh, sides, &l, &closed)) {
    report->reversed = turn_minority(mesh, &l, count);
  }
  return closed ? separate_touching(mesh, &l, &report->separated) : SUPINE_OK;
}

supine_status supine_mesh_repair(supine_mesh *mesh, supine_mesh_repair_report *report) {
  typedef void marker(const supine_mesh *mesh, const supine_mesh_side *sides, uint8_t *drop);
  static marker *const markers[] = {mark_duplicates, mark_loose};
  size_t *const counts[] = {&report->duplicates, &report->loose};
  SUPINE_ARENA arena = {0};
  SUPINE_ARENA of_sides = {0};
  uint8_t *drop = supine_arena_zeros(&arena, mesh->triangle_count, 1);
  const supine_mesh_side *sides = supine_mesh_sides_sort(mesh, &of_sides);
  *report = (supine_mesh_repair_report){0};
  if (drop == NULL || sides == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t m = 0; m < 2; ++m) {
    markers[m](mesh, sides, drop);
    *counts[m] = drop_marked(mesh, drop);
    if (*counts[m] > 0) {
      supine_arena_free(&of_sides);
      sides = supine_mesh_sides_sort(mesh, &of_sides);
      if (sides == NULL) {
        return SUPINE_ERROR_MEMORY;
      }
    }
  }
  return mend_links(mesh, sides, report);
}

size_t supine_mesh_remap(supine_mesh *mesh, const uint32_t *remap) {
  size_t kept = 0;
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *old = mesh->triangles + 3 * t;
    const uint32_t corner[3] = {remap[old[0]], remap[old[1]], remap[old[2]]};
    if (corner[0] != corner[1] && corner[1] != corner[2] && corner[2] != corner[0]) {
      memcpy(mesh->triangles + 3 * kept++, corner, sizeof corner);
    }
  }
  const size_t dropped = mesh->triangle_count - kept;
  mesh->triangle_count = kept;
  return dropped;
}

size_t supine_mesh_drop_unreferenced(supine_mesh *mesh, uint32_t *space) {
  const size_t corners = 3 * mesh->triangle_count;
  size_t kept = 0;
  memset(space, 0, mesh->vertex_count * sizeof *space);
  for (size_t c = 0; c < corners; ++c) {
    space[mesh->triangles[c]] = 1;
  }
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    if (space[i] != 0) {
      memmove(mesh->vertices + 3 * kept, mesh->vertices + 3 * i, 3 * sizeof *mesh->vertices);
      space[i] = (uint32_t)kept++;
    }
  }
  for (size_t c = 0; c < corners; ++c) {
    mesh->triangles[c] = space[mesh->triangles[c]];
  }
  const size_t dropped = mesh->vertex_count - kept;
  mesh->vertex_count = kept;
  return dropped;
}

typedef struct piece {
  double volume; /* mm^3; negative if the component faces inwards */
  uint32_t first_vertex;
} piece;

static void find_volumes(const supine_mesh *mesh, const supine_topology *topology, piece *pieces) {
  for (size_t i = mesh->vertex_count; i-- > 0;) {
    pieces[topology->component[i]].first_vertex = (uint32_t)i;
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    piece *of = &pieces[topology->component[mesh->triangles[3 * t]]];
    const double *origin = mesh->vertices + 3 * (size_t)of->first_vertex;
    double corner[3][3];
    for (size_t k = 0; k < 3; ++k) {
      supine_subtract(mesh->vertices + 3 * (size_t)mesh->triangles[3 * t + k], origin, corner[k]);
    }
    of->volume += supine_triple(corner[0], corner[1], corner[2]) / 6.0;
  }
}

supine_status supine_mesh_drop_specks(supine_mesh *mesh, double share, size_t *pieces,
                                      size_t *specks) {
  SUPINE_ARENA arena = {0};
  SUPINE_FREED_BY(supine_mesh_topology_free) supine_topology topology = {0};
  SUPINE_TRY(supine_mesh_topology_create(mesh, &topology));
  const size_t count = topology.component_count;
  piece *found = supine_arena_zeros(&arena, count, sizeof *found);
  uint8_t *drop = supine_arena_take(&arena, mesh->triangle_count, 1);
  double whole = 0.0;
  SUPINE_TRY(supine_arena_status(&arena));
  find_volumes(mesh, &topology, found);
  for (size_t p = 0; p < count; ++p) {
    whole += fabs(found[p].volume);
  }
  *specks = 0;
  for (size_t p = 0; p < count; ++p) {
    *specks += fabs(found[p].volume) < share * whole;
  }
  *pieces = count - *specks;
  if (*specks > 0) {
    for (size_t t = 0; t < mesh->triangle_count; ++t) {
      const piece *of = &found[topology.component[mesh->triangles[3 * t]]];
      drop[t] = fabs(of->volume) < share * whole;
    }
    (void)drop_marked(mesh, drop);
    (void)supine_mesh_drop_unreferenced(mesh, topology.component);
  }
  return SUPINE_OK;
}
