/* SPDX-License-Identifier: MIT */
/* Repair small defects of surfaces: duplicate, loose and reversed triangles, touching surfaces. */
#include <stdlib.h>
#include <string.h>

#include "sh/base/vec3.h"

#include "mesh/repair.h"

/* Largest share of loose triangles that is dropped. */
static const double few = 0.01;

/* One side of a triangle. */
typedef struct side {
  uint32_t low, high;
  uint32_t at; /* 3 * triangle + first corner */
} side;

typedef struct links {
  uint32_t *parent; /* [triangles] */
  uint8_t *turned;  /* faces against its parent */
} links;

static int compare_sides(const void *left, const void *right) {
  const side *a = left;
  const side *b = right;
  return a->low != b->low ? (a->low > b->low) - (a->low < b->low)
                          : (a->high > b->high) - (a->high < b->high);
}

/* Sort the sides by edge; NULL if out of memory. */
static side *sort_sides(const supine_mesh *mesh) {
  const size_t count = 3 * mesh->triangle_count;
  uint32_t *first = calloc(mesh->vertex_count + 2, sizeof *first);
  side *sides = malloc((count + 1) * sizeof *sides);
  if (first == NULL || sides == NULL) {
    free(first);
    free(sides);
    return NULL;
  }
  for (int pass = 0; pass < 2; ++pass) { /* count, then place */
    for (size_t i = 0; i < count; ++i) {
      const uint32_t a = mesh->triangles[i];
      const uint32_t b = mesh->triangles[i % 3 == 2 ? i - 2 : i + 1];
      const uint32_t low = a < b ? a : b;
      if (pass == 0) {
        ++first[low + 1];
      } else {
        sides[first[low]++] = (side){low, a < b ? b : a, (uint32_t)i};
      }
    }
    for (size_t v = 0; pass == 0 && v < mesh->vertex_count; ++v) {
      first[v + 1] += first[v];
    }
  }
  for (size_t i = 0; i < count;) { /* sort each vertex's sides by the other end */
    size_t end = i + 1;
    while (end < count && sides[end].low == sides[i].low) {
      ++end;
    }
    qsort(sides + i, end - i, sizeof *sides, compare_sides);
    i = end;
  }
  free(first);
  return sides;
}

/* Count the sides of the edge that begins at i. */
static size_t edge_size(const side *sides, size_t i, size_t count) {
  size_t size = 1;
  while (i + size < count && compare_sides(&sides[i], &sides[i + size]) == 0) {
    ++size;
  }
  return size;
}

static uint32_t opposite(const supine_mesh *mesh, const side *s) {
  return mesh->triangles[s->at % 3 == 0 ? s->at + 2 : s->at - 1];
}

/* Mark triangles with the same three corners as an earlier one. */
static void mark_duplicates(const supine_mesh *mesh, const side *sides, uint8_t *drop) {
  const size_t count = 3 * mesh->triangle_count;
  for (size_t i = 0; i < count; i += edge_size(sides, i, count)) {
    const size_t size = edge_size(sides, i, count);
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

/* Mark faces that share no edge with exactly one other face. */
static void mark_loose(const supine_mesh *mesh, const side *sides, uint8_t *drop) {
  const size_t count = 3 * mesh->triangle_count;
  size_t loose = mesh->triangle_count;
  memset(drop, 1, mesh->triangle_count);
  for (size_t i = 0; i < count; i += edge_size(sides, i, count)) {
    const size_t size = edge_size(sides, i, count);
    for (size_t s = 0; size == 2 && s < size; ++s) {
      loose -= drop[sides[i + s].at / 3];
      drop[sides[i + s].at / 3] = 0;
    }
  }
  if ((double)loose >
      few * (double)mesh->triangle_count) { /* unconnected triangles are no defect of a surface */
    memset(drop, 0, mesh->triangle_count);
  }
}

/* Drop marked triangles; return how many. */
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

/* Find the first triangle of t's surface; `turned` says whether t faces against it. */
static uint32_t find_root(const links *l, uint32_t t, uint8_t *turned) {
  uint8_t sum = 0;
  uint32_t root = t;
  while (l->parent[root] != root) {
    sum ^= l->turned[root];
    root = l->parent[root];
  }
  *turned = sum;
  while (l->parent[t] != root && t != root) { /* path compression */
    const uint32_t next = l->parent[t];
    const uint8_t here = l->turned[t];
    l->parent[t] = root;
    l->turned[t] = sum;
    sum ^= here;
    t = next;
  }
  return root;
}

/* Link triangles over edges of two; false if they form a one-sided surface. */
static bool link_triangles(const supine_mesh *mesh, const side *sides, const links *l,
                           bool *closed) {
  const size_t count = 3 * mesh->triangle_count;
  bool sound = true;
  *closed = true;
  for (uint32_t t = 0; t < mesh->triangle_count; ++t) {
    l->parent[t] = t;
    l->turned[t] = 0;
  }
  for (size_t i = 0; i < count; i += edge_size(sides, i, count)) {
    const size_t size = edge_size(sides, i, count);
    *closed = *closed && size % 2 == 0;
    if (size != 2) {
      continue;
    }
    const side *s = &sides[i];
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

/* Reverse the minority of each surface's triangles.
 * @param count  [triangles, 2] zeros, used as work space */
static size_t turn_minority(supine_mesh *mesh, const links *l, uint32_t (*count)[2]) {
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

/* Give each surface its own vertices where several meet in one. */
static supine_status part_touching(supine_mesh *mesh, const links *l, size_t *parted) {
  const size_t corners = 3 * mesh->triangle_count;
  uint32_t *owner = malloc((mesh->vertex_count + 1) * sizeof *owner);
  struct {
    uint32_t vertex, root;
  } *copies = NULL;
  size_t copy_count = 0;
  size_t room = 0;
  supine_status status = owner == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  for (size_t v = 0; status == SUPINE_OK && v < mesh->vertex_count; ++v) {
    owner[v] = UINT32_MAX;
  }
  for (size_t i = 0; status == SUPINE_OK && i < corners; ++i) {
    const uint32_t v = mesh->triangles[i];
    uint8_t turned;
    const uint32_t root = find_root(l, (uint32_t)(i / 3), &turned);
    owner[v] = owner[v] == UINT32_MAX ? root : owner[v];
    if (owner[v] == root) {
      continue;
    }
    size_t c = 0; /* few vertices are shared */
    while (c < copy_count && (copies[c].vertex != v || copies[c].root != root)) {
      ++c;
    }
    if (c == room) {
      room = 2 * room + 16;
      void *grown = realloc(copies, room * sizeof *copies);
      if (grown == NULL) {
        status = SUPINE_ERROR_MEMORY;
        break;
      }
      copies = grown;
    }
    if (c == copy_count) {
      copies[copy_count].vertex = v;
      copies[copy_count++].root = root;
    }
    mesh->triangles[i] = (uint32_t)(mesh->vertex_count + c);
  }
  if (status == SUPINE_OK && copy_count > 0) {
    double *grown = realloc(mesh->vertices, 3 * (mesh->vertex_count + copy_count) * sizeof *grown);
    status = grown == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
    for (size_t c = 0; grown != NULL && c < copy_count; ++c) {
      mesh->vertices = grown;
      memcpy(grown + 3 * (mesh->vertex_count + c), grown + 3 * (size_t)copies[c].vertex,
             3 * sizeof *grown);
    }
    mesh->vertex_count += status == SUPINE_OK ? copy_count : 0;
  }
  *parted = status == SUPINE_OK ? copy_count : 0;
  free(owner);
  free(copies);
  return status;
}

/* Reverse and separate linked triangles. */
static supine_status mend_links(supine_mesh *mesh, const side *sides,
                                supine_mesh_repair_report *report) {
  const size_t n = mesh->triangle_count;
  links l = {malloc((n + 1) * sizeof(uint32_t)), malloc(n + 1)};
  uint32_t(*count)[2] = calloc(n + 1, sizeof *count);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (l.parent != NULL && l.turned != NULL && count != NULL) {
    bool closed;
    status = SUPINE_OK;
    if (link_triangles(mesh, sides, &l, &closed)) {
      report->reversed = turn_minority(mesh, &l, count);
    }
    if (closed) {
      status = part_touching(mesh, &l, &report->parted);
    }
  }
  free(l.parent);
  free(l.turned);
  free(count);
  return status;
}

supine_status supine_mesh_repair(supine_mesh *mesh, supine_mesh_repair_report *report) {
  typedef void marker(const supine_mesh *mesh, const side *sides, uint8_t *drop);
  static marker *const markers[] = {mark_duplicates, mark_loose};
  size_t *const counts[] = {&report->duplicates, &report->loose};
  uint8_t *drop = calloc(mesh->triangle_count + 1, 1);
  side *sides = sort_sides(mesh);
  *report = (supine_mesh_repair_report){0};
  supine_status status = drop == NULL || sides == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  for (size_t m = 0; m < 2 && status == SUPINE_OK; ++m) {
    markers[m](mesh, sides, drop);
    *counts[m] = drop_marked(mesh, drop);
    if (*counts[m] > 0) {
      free(sides);
      sides = sort_sides(mesh);
      status = sides == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
    }
  }
  if (status == SUPINE_OK) {
    status = mend_links(mesh, sides, report);
  }
  free(sides);
  free(drop);
  return status;
}

/* Find the absolute volume of each piece, mm^3, about its own first vertex. */
static double *piece_volumes(const supine_mesh *mesh, const supine_topology *topology) {
  const size_t pieces = topology->component_count;
  double *volume = calloc(pieces + 1, sizeof *volume);
  uint32_t *first = malloc((pieces + 1) * sizeof *first);
  for (size_t i = mesh->vertex_count; volume != NULL && first != NULL && i-- > 0;) {
    first[topology->component[i]] = (uint32_t)i;
  }
  for (size_t t = 0; volume != NULL && first != NULL && t < mesh->triangle_count; ++t) {
    const uint32_t piece = topology->component[mesh->triangles[3 * t]];
    const double *origin = mesh->vertices + 3 * (size_t)first[piece];
    double corner[3][3];
    for (size_t k = 0; k < 9; ++k) {
      corner[k / 3][k % 3] =
          mesh->vertices[3 * (size_t)mesh->triangles[3 * t + k / 3] + k % 3] - origin[k % 3];
    }
    volume[piece] += supine_triple(corner[0], corner[1], corner[2]) / 6.0;
  }
  if (first == NULL) {
    free(volume);
    volume = NULL;
  }
  for (size_t p = 0; volume != NULL && p < pieces; ++p) {
    volume[p] = fabs(volume[p]);
  }
  free(first);
  return volume;
}

/* Keep the vertices and triangles of the pieces in `kept`, in order. */
static supine_status keep_pieces(supine_mesh *mesh, const supine_topology *topology,
                                 const bool *kept) {
  uint32_t *place = malloc((mesh->vertex_count + 1) * sizeof *place);
  size_t count = 0;
  if (place == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    if (kept[topology->component[i]]) {
      memmove(mesh->vertices + 3 * count, mesh->vertices + 3 * i, 3 * sizeof(double));
      place[i] = (uint32_t)count++;
    }
  }
  size_t triangles = 0;
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    if (kept[topology->component[corner[0]]]) {
      for (size_t k = 0; k < 3; ++k) {
        mesh->triangles[3 * triangles + k] = place[corner[k]];
      }
      ++triangles;
    }
  }
  mesh->vertex_count = count;
  mesh->triangle_count = triangles;
  free(place);
  return SUPINE_OK;
}

supine_status supine_mesh_drop_specks(supine_mesh *mesh, double share, size_t *pieces,
                                      size_t *specks) {
  supine_topology topology = {0};
  supine_status status = supine_mesh_topology_create(mesh, &topology);
  *pieces = topology.component_count;
  *specks = 0;
  if (status != SUPINE_OK || topology.component_count < 2) {
    supine_mesh_topology_free(&topology);
    return status;
  }
  double *volume = piece_volumes(mesh, &topology);
  bool *kept = calloc(topology.component_count, sizeof *kept);
  double whole = 0.0;
  status = volume == NULL || kept == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  for (size_t p = 0; status == SUPINE_OK && p < topology.component_count; ++p) {
    whole += volume[p];
  }
  for (size_t p = 0; status == SUPINE_OK && p < topology.component_count; ++p) {
    kept[p] = volume[p] >= share * whole;
    *specks += !kept[p];
  }
  if (status == SUPINE_OK && *specks > 0) {
    *pieces -= *specks;
    status = keep_pieces(mesh, &topology, kept);
  }
  free(kept);
  free(volume);
  supine_mesh_topology_free(&topology);
  return status;
}
