/* SPDX-License-Identifier: MIT */
/* Compute the vertex normals of a deformed surface from its triangles. */
#include <math.h>
#include <string.h>

#include "runtime/internal.h"

void supine_triangle_normal(const float a[3], const float b[3], const float c[3], float n[3]) {
  const float u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const float v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  n[0] = u[1] * v[2] - u[2] * v[1];
  n[1] = u[2] * v[0] - u[0] * v[2];
  n[2] = u[0] * v[1] - u[1] * v[0];
}

void supine_normals_normalise(size_t count, float *normals) {
  for (size_t i = 0; i < count; ++i) {
    float *n = normals + 3 * i;
    const float length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    const bool has_direction = length > 0 && length < INFINITY; /* false for NaN */
    for (size_t j = 0; j < 3; ++j) {
      n[j] = has_direction ? n[j] * (1 / length) : 0;
    }
  }
}

void supine_normals(const supine_basis *basis, const float *xyz, float *normals) {
  memset(normals, 0, 3 * basis->info.vertex_count * sizeof *normals);
  for (size_t t = 0; t < basis->info.triangle_count; ++t) {
    const uint32_t *corner = basis->info.triangles + 3 * t;
    float n[3];
    supine_triangle_normal(xyz + 3 * (size_t)corner[0], xyz + 3 * (size_t)corner[1],
                           xyz + 3 * (size_t)corner[2], n);
    for (size_t j = 0; j < 3; ++j) {
      float *sum = normals + 3 * (size_t)corner[j];
      sum[0] += n[0];
      sum[1] += n[1];
      sum[2] += n[2];
    }
  }
  supine_normals_normalise(basis->info.vertex_count, normals);
}
