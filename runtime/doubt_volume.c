/* SPDX-License-Identifier: MIT */
/* Volumes of lungs at given positions of a basis's vertices, and their gradients: inside the closed
 * surface or, for a grid in the lungs, of its cells. A cell of the grid consists of six tetrahedra
 * and counts by the share of it that lies in the lungs. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "runtime/doubt_volume.h"
#include "runtime/internal.h"
#include "runtime/lung.h"

/* Return the number of nodes of the grid, or 0 if the basis is none. */
static size_t count_nodes(const supine_basis *basis, size_t size[3]) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const char *content = supine_basis_metadata(basis, "content");
  const supine_tensor *grid = supine_basis_tensor(basis, "grid_size");
  const supine_tensor *part = supine_basis_tensor(basis, "part");
  const supine_tensor *depth = supine_basis_tensor(basis, "depth");
  if (content == NULL || strcmp(content, "grid") != 0 || grid == NULL || part == NULL ||
      depth == NULL || grid->dtype != SUPINE_U32 || grid->rank != 1 || grid->shape[0] != 3 ||
      part->dtype != SUPINE_U32 || part->rank != 1 || part->shape[0] != n ||
      depth->dtype != SUPINE_F32 || depth->rank != 1 || depth->shape[0] != n) {
    return 0;
  }
  double count = 1;
  for (size_t k = 0; k < 3; ++k) {
    size[k] = ((const uint32_t *)grid->data)[k];
    count *= (double)size[k];
  }
  return count < 0x1p31 ? (size_t)count : 0;
}

size_t supine_doubt_shape_space(const supine_basis *basis) {
  size_t size[3];
  return (count_nodes(basis, size) + 1) / 2;
}

bool supine_doubt_shape_prepare(const supine_basis *basis, double *space,
                                supine_doubt_shape *shape) {
  *shape = (supine_doubt_shape){.basis = basis, .vertex = (uint32_t *)space};
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const size_t nodes = count_nodes(basis, shape->size);
  if (nodes == 0) {
    return supine_basis_metadata(basis, "content") == NULL;
  }
  const uint32_t *part = supine_basis_tensor(basis, "part")->data;
  shape->depth = supine_basis_tensor(basis, "depth")->data;
  memset(shape->vertex, 0, nodes * sizeof *shape->vertex);
  for (size_t i = 0; i < n; ++i) {
    if (part[i] < nodes) {
      shape->vertex[part[i]] = (uint32_t)i + 1;
    }
  }
  return true;
}

void supine_doubt_area(const float *xyz, const uint32_t *triangle, double area[3]) {
  double side[2][3];
  for (size_t k = 0; k < 6; ++k) {
    side[k / 3][k % 3] =
        (double)xyz[3 * triangle[1 + k / 3] + k % 3] - (double)xyz[3 * triangle[0] + k % 3];
  }
  supine_cross(side[0], side[1], area);
}

/* Add the volume inside the surface, and its gradient unless NULL. */
static void add_surface(const supine_basis *basis, const float *xyz, double *volume,
                        float *gradient) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const uint32_t *triangle = supine_basis_triangles(basis);
  for (size_t t = 0; t < info->triangle_count; ++t, triangle += 3) {
    const float *corner = xyz + 3 * (size_t)triangle[0];
    double area[3];
    supine_doubt_area(xyz, triangle, area);
    const size_t lung = supine_basis_lung_of(info, triangle[0]);
    for (size_t k = 0; k < 3; ++k) { /* relative to the first vertex of the lung, for precision */
      const double from = (double)xyz[3 * info->lung_begin[lung] + k];
      volume[lung] += area[k] * ((double)corner[k] - from) / 6;
    }
    if (gradient != NULL) {
      for (size_t e = 0; e < 9; ++e) {
        gradient[3 * (size_t)triangle[e / 3] + e % 3] += (float)(area[e % 3] / 6);
      }
    }
  }
}

/* Add `factor` times the volume of a tetrahedron, and its gradient unless NULL. */
static void add_tetrahedron(const float *xyz, const size_t corner[4], double factor, double *volume,
                            float *gradient) {
  double edge[3][3];
  for (size_t e = 0; e < 9; ++e) {
    edge[e / 3][e % 3] =
        (double)xyz[3 * corner[1 + e / 3] + e % 3] - (double)xyz[3 * corner[0] + e % 3];
  }
  *volume += factor / 6 * supine_triple(edge[0], edge[1], edge[2]);
  if (gradient == NULL) {
    return;
  }
  for (size_t v = 0; v < 3; ++v) {
    double area[3];
    supine_cross(edge[(v + 1) % 3], edge[(v + 2) % 3], area);
    for (size_t k = 0; k < 3; ++k) {
      const float change = (float)(factor / 6 * area[k]);
      gradient[3 * corner[1 + v] + k] += change;
      gradient[3 * corner[0] + k] -= change;
    }
  }
}

/* Find the vertices at the corners of a cell of the grid, corner c up by one node on axis a if bit
 * a of c is set. Return the share of the cell that lies in the lungs, 0 if a corner is no vertex.
 */
static double find_corners(const supine_doubt_shape *s, size_t cell, size_t corners[8]) {
  const size_t stride[3] = {1, s->size[0], s->size[0] * s->size[1]};
  double deepest = -INFINITY;
  double highest = INFINITY;
  double sum = 0;
  for (size_t c = 0; c < 8; ++c) {
    size_t node = cell;
    for (size_t a = 0; a < 3; ++a) {
      if (cell / stride[a] % s->size[a] + 1 == s->size[a]) {
        return 0; /* the last node of a row begins no cell */
      }
      node += (c >> a & 1) * stride[a];
    }
    if (s->vertex[node] == 0) {
      return 0;
    }
    corners[c] = s->vertex[node] - 1;
    const double depth = (double)s->depth[corners[c]];
    deepest = fmax(deepest, depth);
    highest = fmin(highest, depth);
    sum += depth / 8;
  }
  if (highest >= 0 || deepest <= 0) {
    return highest >= 0 ? 1 : 0;
  }
  return fmax(0, fmin(1, 0.5 + sum / (deepest - highest)));
}

/* The corners of the six tetrahedra of a cell between corner 0 and corner 7. */
static const unsigned char paths[6][2] = {{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}};

/* Return whether a tetrahedron of a cell is turned over that the prediction does not turn over. */
static bool is_turned(const float *predicted, const float *xyz, const size_t corners[8]) {
  for (size_t t = 0; t < 6; ++t) {
    const size_t corner[4] = {corners[0], corners[paths[t][0]], corners[paths[t][1]], corners[7]};
    double before = 0;
    double now = 0;
    add_tetrahedron(predicted, corner, 1, &before, NULL);
    add_tetrahedron(xyz, corner, 1, &now, NULL);
    if (!(before * now > 0)) {
      return true;
    }
  }
  return false;
}

bool supine_doubt_shape_unfold(const supine_doubt_shape *s, const float *predicted, float *xyz) {
  const size_t cells = s->depth == NULL ? 0 : s->size[0] * s->size[1] * s->size[2];
  bool turned = false;
  for (size_t cell = 0; cell < cells; ++cell) {
    size_t corners[8];
    if (!(find_corners(s, cell, corners) > 0) || !is_turned(predicted, xyz, corners)) {
      continue;
    }
    turned = true;
    for (size_t k = 0; k < 3; ++k) {
      float mean = 0;
      for (size_t c = 0; c < 8; ++c) {
        mean += (xyz[3 * corners[c] + k] - predicted[3 * corners[c] + k]) / 8;
      }
      for (size_t c = 0; c < 8; ++c) {
        xyz[3 * corners[c] + k] = predicted[3 * corners[c] + k] + mean;
      }
    }
  }
  return turned;
}

/* Add the volumes of the grid's cells, and their gradients unless NULL. */
static void add_grid(const supine_doubt_shape *s, const float *xyz, double *volume,
                     float *gradient) {
  const supine_basis_info *info = supine_basis_get_info(s->basis);
  const size_t cells = s->size[0] * s->size[1] * s->size[2];
  for (size_t cell = 0; cell < cells; ++cell) {
    size_t corners[8];
    const double share = find_corners(s, cell, corners);
    if (!(share > 0)) {
      continue;
    }
    const size_t lung = supine_basis_lung_of(info, corners[0]);
    for (size_t t = 0; t < 6; ++t) { /* all have the diagonal from corner 0 to corner 7 */
      const size_t corner[4] = {corners[0], corners[paths[t][0]], corners[paths[t][1]], corners[7]};
      add_tetrahedron(xyz, corner, share, &volume[lung], gradient);
    }
  }
}

void supine_doubt_shape_volumes(const supine_doubt_shape *shape, const float *xyz, double *volume,
                                float *gradient) {
  const supine_basis_info *info = supine_basis_get_info(shape->basis);
  memset(volume, 0, info->lung_count * sizeof *volume);
  if (gradient != NULL) {
    memset(gradient, 0, 3 * info->vertex_count * sizeof *gradient);
  }
  if (shape->depth == NULL) {
    add_surface(shape->basis, xyz, volume, gradient);
  } else {
    add_grid(shape, xyz, volume, gradient);
  }
}
