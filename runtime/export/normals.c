/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Normals of the resting surface: the sum of the triangles' at each vertex, by area. */
#include <math.h>
#include <stdlib.h>

#include "runtime/export/glb.h"

static void add_triangle(const export_source *source, const uint32_t *corner, double *sum) {
  double a[3];
  double b[3];
  for (size_t axis = 0; axis < 3; ++axis) {
    const double origin = (double)source->vertices[3 * (size_t)corner[0] + axis];
    a[axis] = (double)source->vertices[3 * (size_t)corner[1] + axis] - origin;
    b[axis] = (double)source->vertices[3 * (size_t)corner[2] + axis] - origin;
  }
  const double cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                           a[0] * b[1] - a[1] * b[0]};
  for (size_t v = 0; v < 3; ++v) {
    for (size_t axis = 0; axis < 3; ++axis) {
      sum[3 * (size_t)corner[v] + axis] += cross[axis];
    }
  }
}

supine_status supine_export_glb_normals(const export_source *source, float *normals,
                                        supine_error *error) {
  const size_t n = source->info->vertex_count;
  double *sum = calloc(3 * n, sizeof *sum);
  if (sum == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  for (size_t t = 0; t < source->info->triangle_count; ++t) {
    add_triangle(source, source->triangles + 3 * t, sum);
  }
  for (size_t i = 0; i < n; ++i) {
    const double *v = sum + 3 * i;
    const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (size_t axis = 0; axis < 3; ++axis) {
      normals[3 * i + axis] = (float)(length > 0 ? v[axis] / length : (axis == 2 ? 1.0 : 0.0));
    }
  }
  free(sum);
  return SUPINE_OK;
}
