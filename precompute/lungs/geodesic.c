/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make geodesic spheres. */
#include <math.h>

#include "precompute/lungs/geodesic.h"

enum { CORNERS = 12, EDGES = 30, FACES = 20 };

static const unsigned char faces[FACES][3] = {
    {0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
    {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
    {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1},
};

size_t supine_phantom_geodesic_vertex_count(size_t frequency) {
  return 10 * frequency * frequency + 2;
}

size_t supine_phantom_geodesic_triangle_count(size_t frequency) {
  return 20 * frequency * frequency;
}

/* Compute a corner of the icosahedron: corners are cyclic permutations of (+-1, +-golden, 0). */
static void corner(size_t index, double p[3]) {
  const double golden = 0.5 * (1.0 + sqrt(5.0));
  const size_t axis = index / 4; /* of the coordinate +-1; the coordinate before it is 0 */
  const double one = index % 2 == 0 ? -1.0 : 1.0;
  const double far = index % 4 < 2 ? golden : -golden;
  p[axis % 3] = one;
  p[(axis + 1) % 3] = far;
  p[(axis + 2) % 3] = 0.0;
}

/* Find the index of the edge between two corners; edges are numbered in the order of the faces. */
static size_t edge_index(unsigned a, unsigned b) {
  size_t count = 0;
  for (size_t f = 0; f < FACES; ++f) {
    for (size_t k = 0; k < 3; ++k) {
      const unsigned p = faces[f][k];
      const unsigned q = faces[f][(k + 1) % 3];
      if (p < q) {
        if ((p == a && q == b) || (p == b && q == a)) {
          return count;
        }
        ++count;
      }
    }
  }
  return count;
}

/* Find the index of the vertex at steps (f - i - j, i, j) from the corners of a face. */
static size_t number(size_t face, size_t f, size_t i, size_t j) {
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
        const size_t along =
            a < b ? step[next] : step[k]; /* steps from the corner of lower index */
        return CORNERS + edge_index(a, b) * (f - 1) + along - 1;
      }
    }
  }
  const size_t row = (i - 1) * (f - 1) - (i - 1) * i / 2; /* rows hold f - 2, f - 3, ... */
  return CORNERS + EDGES * (f - 1) + face * ((f - 1) * (f - 2) / 2) + row + (j - 1);
}

void supine_phantom_geodesic(size_t frequency, uint32_t base, double *vertices,
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
        double *v = vertices + 3 * number(face, f, i, j);
        double square = 0.0;
        for (size_t k = 0; k < 3; ++k) {
          v[k] = (double)(f - i - j) * p[0][k] + (double)i * p[1][k] + (double)j * p[2][k];
          square += v[k] * v[k];
        }
        for (size_t k = 0; k < 3; ++k) {
          v[k] /= sqrt(square);
        }
        if (i + j < f) {
          *out++ = (uint32_t)(base + number(face, f, i, j));
          *out++ = (uint32_t)(base + number(face, f, i + 1, j));
          *out++ = (uint32_t)(base + number(face, f, i, j + 1));
        }
        if (i + j + 1 < f) {
          *out++ = (uint32_t)(base + number(face, f, i + 1, j));
          *out++ = (uint32_t)(base + number(face, f, i + 1, j + 1));
          *out++ = (uint32_t)(base + number(face, f, i, j + 1));
        }
      }
    }
  }
}
