/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find vertices that a simulator displaced unlike their neighbours. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "precompute/fields/nodes.h"

/* A vertex that differs from its neighbours by a smaller part of the RMS displacement is not
 * questioned. */
static const double worth_naming = 0.1;

/* Neighbours of all vertices. */
typedef struct around {
  double *mean;   /* [N, 3] mean displacement of the neighbours, mm */
  double *spread; /* [N] largest distance of a neighbour's displacement from this mean, mm */
  size_t *count;  /* [N] number of neighbours, each counted once for each triangle */
} around;

static void measure_around(const supine_mesh *mesh, const double *u, const around *a) {
  memset(a->mean, 0, 3 * mesh->vertex_count * sizeof *a->mean);
  memset(a->spread, 0, mesh->vertex_count * sizeof *a->spread);
  memset(a->count, 0, mesh->vertex_count * sizeof *a->count);
  for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
    const size_t vertex = mesh->triangles[i];
    for (size_t side = 1; side <= 2; ++side) {
      const size_t other = mesh->triangles[i / 3 * 3 + (i + side) % 3];
      for (size_t k = 0; k < 3; ++k) {
        a->mean[3 * vertex + k] += u[3 * other + k];
      }
      ++a->count[vertex];
    }
  }
  for (size_t i = 0; i < 3 * mesh->vertex_count; ++i) {
    a->mean[i] /= a->count[i / 3] > 0 ? (double)a->count[i / 3] : 1.0;
  }
  for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
    const size_t vertex = mesh->triangles[i];
    for (size_t side = 1; side <= 2; ++side) {
      const size_t other = mesh->triangles[i / 3 * 3 + (i + side) % 3];
      const double apart = supine_distance(u + 3 * other, a->mean + 3 * vertex);
      a->spread[vertex] = fmax(a->spread[vertex], apart);
    }
  }
}

supine_status supine_fields_find_stray(const supine_fields *fields, const supine_lungs *lungs,
                                       double rms_mm, supine_stray *found) {
  const size_t n = fields->vertex_count;
  SUPINE_ARENA arena = {0};
  const around a = {.mean = supine_arena_take(&arena, 3 * n, sizeof(double)),
                    .spread = supine_arena_take(&arena, n, sizeof(double)),
                    .count = supine_arena_take(&arena, n, sizeof(size_t))};
  SUPINE_TRY(supine_arena_status(&arena));
  *found = (supine_stray){.ratio = 0.0};
  for (size_t run = 0; run < fields->run_count; ++run) {
    const double *u = fields->displacement + 3 * n * run;
    measure_around(&lungs->mesh, u, &a);
    for (size_t i = 0; i < n; ++i) {
      const double apart = supine_distance(u + 3 * i, a.mean + 3 * i);
      if (a.count[i] > 0 && apart > worth_naming * rms_mm && apart > found->ratio * a.spread[i]) {
        *found = (supine_stray){run, i, apart, apart / a.spread[i]};
      }
    }
  }
  return SUPINE_OK;
}
