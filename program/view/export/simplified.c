/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measure how far a simplified surface is from the whole one, and what its page must know of
 * that. */
#include <math.h>
#include <string.h>

#include "precompute/lungs/surface.h"
#include "program/view/export/packed.h"

/* Compute the distances of a lung's vertices [count] from its triangles in the file. `places` [N,
 * 3] has the vertices of the basis, mm; `corners` is workspace for all corners. */
static supine_status find_distances(const supine_basis_info *info, const export_order *order,
                                    size_t lung, const double *places, uint32_t *corners,
                                    double *distance, supine_error *error) {
  SUPINE_FREED_BY(supine_lungs_surface_drop) supine_lungs_surface *surface = NULL;
  const size_t begin = order->corner_begin[lung];
  const size_t count = order->corner_begin[lung + 1] - begin;
  for (size_t i = 0; i < count; ++i) {
    corners[i] = order->vertex[order->corners[begin + i]];
  }
  SUPINE_TRY(supine_lungs_surface_create(places, count / 3, corners, false, &surface, error));
  supine_lungs_surface_distances(surface, info->lung_begin[lung + 1] - info->lung_begin[lung],
                                 places + 3 * info->lung_begin[lung], distance, NULL);
  return SUPINE_OK;
}

supine_status supine_export_order_error(const supine_basis_info *info, const export_order *order,
                                        double *rms, double *largest, supine_error *error) {
  SUPINE_ARENA arena = {0};
  const size_t n = info->vertex_count;
  double *places = supine_arena_take(&arena, n, 3 * sizeof *places);
  double *distance = supine_arena_zeros(&arena, n, sizeof *distance);
  uint32_t *corners = supine_arena_take(&arena, info->triangle_count, 3 * sizeof *corners);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  for (size_t i = 0; i < 3 * n; ++i) {
    places[i] = (double)info->vertices[i];
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    SUPINE_TRY(find_distances(info, order, lung, places, corners, distance + info->lung_begin[lung],
                              error));
  }
  double sum = 0.0;
  *largest = 0.0;
  for (size_t i = 0; i < n; ++i) {
    sum += distance[i] * distance[i];
    *largest = fmax(*largest, fabs(distance[i]));
  }
  *rms = sqrt(sum / (double)n);
  return SUPINE_OK;
}

/* Compute the displacement of a vertex by each mode at weight and gain 1, [3, modes] mm. */
static void find_rows(const supine_basis *basis, size_t vertex, double *rows) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t k = info->mode_count;
  if (info->vector) {
    float vectors[3 * SUPINE_MODES_MAX];
    (void)supine_basis_coefficients(basis, vertex, vertex + 1, vectors); /* takes every vertex */
    for (size_t i = 0; i < 3 * k; ++i) {
      rows[i] = (double)vectors[i];
    }
    return;
  }
  for (size_t i = 0; i < 3 * k; ++i) {
    rows[i] = (double)info->coefficients[vertex * k + i % k] *
              (double)info->direction[3 * vertex + i / k];
  }
}

void supine_export_squares(const supine_basis *basis, double *squares) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t k = info->mode_count;
  double rows[3 * SUPINE_MODES_MAX];
  memset(squares, 0, info->lung_count * 3 * k * k * sizeof *squares);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    for (size_t v = info->lung_begin[lung]; v < info->lung_begin[lung + 1]; ++v) {
      find_rows(basis, v, rows);
      for (size_t axis = 0; axis < 3; ++axis) {
        const double *row = rows + axis * k;
        double *sums = squares + (3 * lung + axis) * k * k;
        for (size_t i = 0; i < k * k; ++i) {
          sums[i] += row[i / k] * row[i % k] / (double)info->vertex_count;
        }
      }
    }
  }
}
