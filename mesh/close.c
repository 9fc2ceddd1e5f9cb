/* SPDX-License-Identifier: MIT */
/* Join vertices that lie closer together than single precision resolves. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"

#include "mesh/repair.h"

/* Vertices are sorted along a direction in which those of a grid do not coincide. */
static const double direction[3] = {1.0, 0.7548776662, 0.5698402909};

typedef struct place {
  double along;
  uint32_t vertex;
} place;

static int compare(const void *a, const void *b) {
  const place *x = a;
  const place *y = b;
  return x->along != y->along ? (x->along > y->along) - (x->along < y->along)
                              : (x->vertex > y->vertex) - (x->vertex < y->vertex);
}

/* Write to same[v] the lowest vertex that lies within `distance` of v, directly or by others.
 * Return how many vertices have another than themselves. */
static size_t find_same(const supine_mesh *mesh, double distance, place *places, uint32_t *same) {
  const double reach = distance * supine_length(direction);
  const size_t n = mesh->vertex_count;
  size_t joined = 0;
  for (size_t i = 0; i < n; ++i) {
    places[i] = (place){supine_dot(direction, mesh->vertices + 3 * i), (uint32_t)i};
    same[i] = (uint32_t)i;
  }
  qsort(places, n, sizeof *places, compare);
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = i + 1; j < n && places[j].along - places[i].along <= reach; ++j) {
      const uint32_t a = places[i].vertex;
      const uint32_t b = places[j].vertex;
      if (supine_distance(mesh->vertices + 3 * (size_t)a, mesh->vertices + 3 * (size_t)b) <=
          distance) {
        const uint32_t lower = a < b ? a : b;
        const uint32_t higher = a < b ? b : a;
        same[higher] = same[lower];
      }
    }
  }
  for (size_t i = 0; i < n; ++i) { /* a lower vertex is final when a higher one looks at it */
    same[i] = same[same[i]];
    joined += same[i] != i;
  }
  return joined;
}

supine_status supine_mesh_join_close(supine_mesh *mesh, double distance, size_t *joined) {
  SUPINE_ARENA arena = {0};
  place *places = supine_arena_take(&arena, mesh->vertex_count, sizeof *places);
  uint32_t *same = supine_arena_take(&arena, mesh->vertex_count, sizeof *same);
  SUPINE_TRY(supine_arena_status(&arena));
  *joined = find_same(mesh, distance, places, same);
  if (*joined == 0) {
    return SUPINE_OK;
  }
  (void)supine_mesh_remap(mesh, same);
  (void)supine_mesh_drop_unreferenced(mesh, same);
  return SUPINE_OK;
}
