/* SPDX-License-Identifier: MIT */
/* Compute volume, bounding box, areas and normals of a surface. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"

#include "mesh/mesh.h"

supine_status supine_mesh_allocate(size_t vertices, size_t triangles, supine_mesh *mesh) {
  *mesh = (supine_mesh){vertices, malloc((3 * vertices + 1) * sizeof(double)), triangles,
                        malloc((3 * triangles + 1) * sizeof(uint32_t))};
  if (mesh->vertices == NULL || mesh->triangles == NULL) {
    supine_mesh_free(mesh);
    return SUPINE_ERROR_MEMORY;
  }
  return SUPINE_OK;
}

void supine_mesh_free(supine_mesh *mesh) {
  free(mesh->vertices);
  free(mesh->triangles);
  *mesh = (supine_mesh){0};
}

double supine_mesh_volume(const supine_mesh *mesh) {
  double minimum[3];
  double maximum[3];
  supine_mesh_box(mesh, minimum, maximum);
  const double centre[3] = {0.5 * (minimum[0] + maximum[0]), 0.5 * (minimum[1] + maximum[1]),
                            0.5 * (minimum[2] + maximum[2])};
  double sum = 0.0;
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    double p[3][3]; /* corners relative to the centre of the bounding box, to avoid cancellation */
    for (size_t k = 0; k < 3; ++k) {
      supine_subtract(mesh->vertices + 3 * (size_t)mesh->triangles[3 * t + k], centre, p[k]);
    }
    sum += supine_triple(p[0], p[1], p[2]);
  }
  return sum / 6.0;
}

double supine_mesh_spread(const supine_mesh *mesh, size_t begin, size_t end, double spread[3]) {
  double first[3] = {
      0.0}; /* integrals of x and x^2, from the tetrahedra to the centre of the box */
  double second[3] = {0.0};
  double volume = 0.0;
  double low[3];
  double high[3];
  (void)supine_mesh_box(mesh, low, high);
  const double centre[3] = {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]),
                            0.5 * (low[2] + high[2])};
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    double p[3][3];
    if (corner[0] < begin || corner[0] >= end) {
      continue;
    }
    for (size_t k = 0; k < 3; ++k) {
      supine_subtract(mesh->vertices + 3 * (size_t)corner[k], centre, p[k]);
    }
    const double tetrahedron = supine_triple(p[0], p[1], p[2]) / 6.0;
    volume += tetrahedron;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double sum = p[0][axis] + p[1][axis] + p[2][axis];
      first[axis] += tetrahedron * sum / 4.0;
      second[axis] +=
          tetrahedron / 20.0 *
          (p[0][axis] * p[0][axis] + p[1][axis] * p[1][axis] + p[2][axis] * p[2][axis] + sum * sum);
    }
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    const double mean = first[axis] / volume;
    spread[axis] = volume > 0.0 ? sqrt(fmax(second[axis] / volume - mean * mean, 0.0)) : 0.0;
  }
  return volume;
}

double supine_mesh_box(const supine_mesh *mesh, double minimum[3], double maximum[3]) {
  double side = 0.0;
  supine_box_begin(minimum, maximum);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    supine_box_add(mesh->vertices + 3 * i, minimum, maximum);
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (mesh->vertex_count == 0) {
      minimum[axis] = maximum[axis] = 0.0;
    }
    side = fmax(side, maximum[axis] - minimum[axis]);
  }
  return side;
}

void supine_mesh_reverse(const supine_mesh *mesh) {
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t second = mesh->triangles[3 * t + 1];
    mesh->triangles[3 * t + 1] = mesh->triangles[3 * t + 2];
    mesh->triangles[3 * t + 2] = second;
  }
}

/* Compute the normal of a triangle, with twice the triangle's area as length. */
static void triangle_normal(const double *vertices, const uint32_t *corner, double normal[3]) {
  supine_normal(vertices + 3 * (size_t)corner[0], vertices + 3 * (size_t)corner[1],
                vertices + 3 * (size_t)corner[2], normal);
}

void supine_mesh_vertex_area(const supine_mesh *mesh, double *area) {
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    area[i] = 0.0;
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    double normal[3];
    triangle_normal(mesh->vertices, corner, normal);
    const double third = supine_length(normal) / 6.0;
    for (int k = 0; k < 3; ++k) {
      area[corner[k]] += third;
    }
  }
}

double supine_mesh_turned_over(const supine_mesh *mesh, const double *vertices) {
  size_t turned = 0;
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    double normal[2][3];
    triangle_normal(mesh->vertices, corner, normal[0]);
    triangle_normal(vertices, corner, normal[1]);
    turned += supine_dot(normal[0], normal[1]) < 0.0;
  }
  return mesh->triangle_count == 0 ? 0.0 : (double)turned / (double)mesh->triangle_count;
}

void supine_mesh_normalise(size_t count, double *vectors) {
  for (size_t i = 0; i < count; ++i) {
    double *v = vectors + 3 * i;
    const double length = supine_length(v);
    if (length > 0.0) {
      for (size_t k = 0; k < 3; ++k) {
        v[k] /= length;
      }
    }
  }
}

void supine_mesh_vertex_normals(const supine_mesh *mesh, double *normals) {
  memset(normals, 0, 3 * mesh->vertex_count * sizeof *normals);
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    double normal[3];
    triangle_normal(mesh->vertices, corner, normal);
    for (size_t k = 0; k < 9; ++k) {
      normals[3 * (size_t)corner[k / 3] + k % 3] += normal[k % 3];
    }
  }
  supine_mesh_normalise(mesh->vertex_count, normals);
}
