/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make a synthetic pair of lungs: each coordinate of the surface, mm, is a sum of real spherical
 * harmonics up to band 4, a smooth map from the sphere.
 *
 * The sums were fitted, to 3.4 mm RMS, to the surfaces of one adult's lungs in deep inspiration,
 * derived from the lung test data of Chaste (BSD-3-Clause, (c) University of Oxford and Chaste
 * authors). The fit penalises curvature, and spreads the vertices evenly. */
#include <math.h>

#include <supine/sh.h>

#include "base/arena.h"

#include "precompute/lungs/phantom.h"

enum { CORNERS = 12, EDGES = 30, FACES = 20 };

static const unsigned char faces[FACES][3] = {
    {0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
    {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
    {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1},
};

/* The two corners of each edge, lower first, in the order in which `faces` has them. */
static const unsigned char edges[EDGES][2] = {
    {0, 11}, {0, 5}, {0, 1},  {1, 7},  {0, 7}, {7, 10}, {0, 10}, {10, 11}, {1, 5}, {5, 9},
    {5, 11}, {4, 5}, {2, 11}, {6, 10}, {1, 8}, {3, 9},  {3, 4},  {2, 3},   {2, 6}, {3, 6},
    {6, 8},  {3, 8}, {8, 9},  {4, 9},  {2, 4}, {4, 11}, {2, 10}, {6, 7},   {7, 8}, {1, 9},
};

size_t supine_lungs_phantom_geodesic_vertex_count(size_t frequency) {
  return 10 * frequency * frequency + 2;
}

size_t supine_lungs_phantom_geodesic_triangle_count(size_t frequency) {
  return 20 * frequency * frequency;
}

/* Compute a corner of the icosahedron: corners are cyclic permutations of (+-1, +-golden, 0). */
static void corner(size_t index, double p[3]) {
  const double golden = 0.5 * (1.0 + sqrt(5.0));
  const size_t axis = index / 4; /* index of the coordinate that is +-1; the next one is +-golden */
  const double one = index % 2 == 0 ? -1.0 : 1.0;
  const double far = index % 4 < 2 ? golden : -golden;
  p[axis % 3] = one;
  p[(axis + 1) % 3] = far;
  p[(axis + 2) % 3] = 0.0;
}

/* Return the index of a vertex of the geodesic sphere. It lies at the barycentric coordinates (f -
 * i - j, i, j) / f on a face of the icosahedron, whose edges are cut into f parts. */
static size_t vertex_index(size_t face, size_t f, size_t i, size_t j) {
  const size_t step[3] = {f - i - j, i, j};
  size_t inside = 0;
  for (size_t k = 0; k < 3; ++k) {
    if (step[k] == f) {
      return faces[face][k];
    }
    inside += step[k] > 0 ? 1 : 0;
  }
  if (inside == 2) {
    for (size_t k = 0; k < 3; ++k) {
      const size_t next = (k + 1) % 3;
      if (step[k] > 0 && step[next] > 0) {
        const unsigned a = faces[face][k];
        const unsigned b = faces[face][next];
        /* vertices are numbered along the edge from its corner with the lower index */
        const size_t along = a < b ? step[next] : step[k];
        size_t edge = 0;
        while (edges[edge][0] != (a < b ? a : b) || edges[edge][1] != (a < b ? b : a)) {
          ++edge;
        }
        return CORNERS + edge * (f - 1) + along - 1;
      }
    }
  }
  const size_t row = (i - 1) * (f - 1) - (i - 1) * i / 2;
  return CORNERS + EDGES * (f - 1) + face * ((f - 1) * (f - 2) / 2) + row + (j - 1);
}

void supine_lungs_phantom_geodesic(size_t frequency, uint32_t base, double *vertices,
                                   uint32_t *triangles) {
  const size_t f = frequency;
  uint32_t *out = triangles;
  for (size_t face = 0; face < FACES; ++face) {
    double p[3][3];
    for (size_t k = 0; k < 3; ++k) {
      corner(faces[face][k], p[k]);
    }
    for (size_t i = 0; i <= f; ++i) {
      for (size_t j = 0; i + j <= f; ++j) {
        double *v = vertices + 3 * vertex_index(face, f, i, j);
        double square = 0.0;
        for (size_t k = 0; k < 3; ++k) {
          v[k] = (double)(f - i - j) * p[0][k] + (double)i * p[1][k] + (double)j * p[2][k];
          square += v[k] * v[k];
        }
        for (size_t k = 0; k < 3; ++k) {
          v[k] /= sqrt(square);
        }
        if (i + j < f) {
          *out++ = (uint32_t)(base + vertex_index(face, f, i, j));
          *out++ = (uint32_t)(base + vertex_index(face, f, i + 1, j));
          *out++ = (uint32_t)(base + vertex_index(face, f, i, j + 1));
        }
        if (i + j + 1 < f) {
          *out++ = (uint32_t)(base + vertex_index(face, f, i + 1, j));
          *out++ = (uint32_t)(base + vertex_index(face, f, i + 1, j + 1));
          *out++ = (uint32_t)(base + vertex_index(face, f, i, j + 1));
        }
      }
    }
  }
}

enum { BAND = 4, TERMS = (BAND + 1) * (BAND + 1) };

/* Coefficients of the spherical harmonics of x, y and z, mm, LPS, of the left and the right lung;
 * that of Y(l, m) has the index l * l + l + m. */
static const double shapes[2][3][TERMS] = {
    {{246.78, -21.47, -40.99, 139.17, 23.77, 28.81, -15.88, -6.60, 38.27, -8.50, -0.91, -7.47, 8.73,
      19.14,  11.68,  -3.07,  -2.35,  -7.79, 4.95,  -4.23,  -2.80, 6.03,  0.52,  -7.42, -2.64},
     {-583.62, 213.08, -21.15, -15.35, 32.70, 19.57, 12.34, -18.46, 0.11,
      -14.98,  -3.16,  10.70,  4.34,   12.30, 13.72, 4.86,  3.80,   -5.43,
      1.28,    -4.66,  5.14,   -1.63,  -4.69, 5.54,  0.06},
     {-567.38, -18.23, 218.18, -28.55, 7.56,  33.87, 50.61, 2.56,  9.24,  0.91, -0.20, 3.70, -7.91,
      11.55,   -4.78,  -4.97,  -4.58,  -5.50, -4.18, -5.79, 14.92, -6.97, 0.32, 3.52,  -0.64}},
    {{-254.50, -14.27, 32.22, 164.79, 12.55, -16.58, -0.74,  -9.26, -51.10,
      20.10,   -3.17,  9.08,  -6.33,  15.24, -10.42, -19.18, 9.38,  4.24,
      2.87,    2.17,   -1.42, 8.16,   -0.50, -7.40,  -1.09},
     {-647.08, 222.71, -19.12, -5.26,  -37.43, 4.94,  24.14, 12.06, 3.96,
      -20.50,  6.25,   7.00,   -11.52, -5.88,  4.59,  7.54,  -3.22, -1.84,
      -6.66,   1.05,   4.70,   -0.39,  -4.49,  -0.54, 6.95},
     {-575.56, -20.13, 220.17, 29.75, -9.21, 36.45, 55.96, -6.55, 5.27, -0.07, 3.09,  -4.67, -12.40,
      -9.73,   -9.32,  0.87,   -4.61, 0.87,  2.98,  6.92,  6.53,  7.51, -3.66, -0.78, -3.53}},
};

/* Move the vertices of a unit sphere to one lung's surface. */
static void shape(size_t lung, size_t count, double *vertices) {
  double y[TERMS];
  for (size_t i = 0; i < count; ++i) {
    (void)supine_sh_evaluate(BAND, vertices + 3 * i, y);
    for (size_t k = 0; k < 3; ++k) {
      vertices[3 * i + k] = 0.0;
      for (size_t t = 0; t < TERMS; ++t) {
        vertices[3 * i + k] += shapes[lung][k][t] * y[t];
      }
    }
  }
}

supine_status supine_lungs_phantom_create(size_t vertices, double millilitres, supine_mesh *mesh,
                                          supine_error *error) {
  SUPINE_REFUSE_IF(vertices < SUPINE_PHANTOM_VERTICES_MIN || vertices > SUPINE_PHANTOM_VERTICES_MAX,
                   error, SUPINE_ERROR_ARGUMENT, "vertex count %zu: give %d to %d", vertices,
                   SUPINE_PHANTOM_VERTICES_MIN, SUPINE_PHANTOM_VERTICES_MAX);
  SUPINE_REFUSE_IF(!(millilitres > 0.0) || !isfinite(millilitres), error, SUPINE_ERROR_ARGUMENT,
                   "a volume of %g mL: give a positive volume", millilitres);
  const double exact = sqrt(((double)vertices / 2.0 - 2.0) / 10.0);
  const size_t frequency = (size_t)fmax(2.0, floor(exact + 0.5));
  const size_t count = supine_lungs_phantom_geodesic_vertex_count(frequency);
  const size_t triangles = supine_lungs_phantom_geodesic_triangle_count(frequency);
  if (supine_mesh_allocate(2 * count, 2 * triangles, mesh) != SUPINE_OK) {
    return supine_error_memory(error, "%zu vertices", 2 * count);
  }
  for (size_t lung = 0; lung < 2; ++lung) {
    double *part = mesh->vertices + 3 * lung * count;
    supine_lungs_phantom_geodesic(frequency, (uint32_t)(lung * count), part,
                                  mesh->triangles + 3 * lung * triangles);
    shape(lung, count, part);
  }
  const double factor = cbrt(1e3 * millilitres / supine_mesh_volume(mesh));
  for (size_t i = 0; i < 3 * mesh->vertex_count; ++i) {
    mesh->vertices[i] *= factor;
  }
  return SUPINE_OK;
}
