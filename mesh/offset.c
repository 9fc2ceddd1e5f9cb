/* SPDX-License-Identifier: MIT */
/* Move a surface along its smoothed normals until it encloses a given volume. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"

#include "mesh/mesh.h"

void supine_mesh_smooth_normals(const supine_mesh *mesh, const supine_topology *topology,
                                double *normals, double *space) {
  enum { ROUNDS = 10 };
  const size_t n = mesh->vertex_count;
  supine_mesh_vertex_normals(mesh, normals);
  for (int round = 0; round < ROUNDS; ++round) {
    memcpy(space, normals, 3 * n * sizeof *space);
    for (size_t e = 0; e < topology->edge_count; ++e) {
      const size_t a = 3 * (size_t)topology->edges[2 * e];
      const size_t b = 3 * (size_t)topology->edges[2 * e + 1];
      for (size_t k = 0; k < 3; ++k) {
        normals[a + k] += space[b + k];
        normals[b + k] += space[a + k];
      }
    }
    supine_mesh_normalise(n, normals);
  }
}

void supine_mesh_volume_along(const supine_mesh *mesh, const double *direction, double change[3]) {
  static const double sixth = 1.0 / 6.0;
  double minimum[3];
  double maximum[3];
  double centre[3];
  supine_mesh_box(mesh, minimum, maximum);
  for (size_t k = 0; k < 3; ++k) {
    centre[k] = 0.5 * (minimum[k] + maximum[k]);
    change[k] = 0.0;
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    double p[3][3];
    const double *d[3];
    for (size_t k = 0; k < 3; ++k) {
      const size_t at = 3 * (size_t)mesh->triangles[3 * t + k];
      supine_subtract(mesh->vertices + at, centre, p[k]);
      d[k] = direction + at;
    }
    for (size_t k = 0; k < 3; ++k) {
      const size_t next = (k + 1) % 3;
      const size_t last = (k + 2) % 3;
      change[0] += sixth * supine_triple(d[k], p[next], p[last]);
      change[1] += sixth * supine_triple(p[k], d[next], d[last]);
    }
    change[2] += sixth * supine_triple(d[0], d[1], d[2]);
  }
}

bool supine_mesh_offset_to(const double change[3], double volume, double *distance) {
  enum { STEPS = 50 };
  static const double converged = 1e-12; /* relative to the volume that is added */
  double h = 0.0;
  double off = volume;
  for (int step = 0; step < STEPS && fabs(off) > converged * fabs(volume); ++step) {
    const double slope = change[0] + h * (2.0 * change[1] + 3.0 * h * change[2]);
    h += off / slope;
    off = volume - h * (change[0] + h * (change[1] + h * change[2]));
  }
  *distance = h;
  return fabs(off) <= 1e-9 * fabs(volume);
}
