/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make a synthetic pair of lungs: the distance of the surface from a centre inside, mm, is a sum of
 * real spherical harmonics up to band 12.
 *
 * The sums were fitted, to 5 mm RMS, to the surfaces of one adult's lungs in deep inspiration,
 * derived from the lung test data of Chaste (BSD-3-Clause, (c) University of Oxford and Chaste
 * authors). */
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

size_t supine_phantom_geodesic_vertex_count(size_t frequency) {
  return 10 * frequency * frequency + 2;
}

size_t supine_phantom_geodesic_triangle_count(size_t frequency) {
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

/* Find the index of the edge between two corners of the icosahedron. Edges are numbered in the
 * order in which `faces` names them with the lower corner first. */
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
        return CORNERS + edge_index(a, b) * (f - 1) + along - 1;
      }
    }
  }
  const size_t row = (i - 1) * (f - 1) - (i - 1) * i / 2;
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

enum { BAND = 12, TERMS = (BAND + 1) * (BAND + 1) };

/* Centres of the left and the right lung, mm, LPS. */
static const double centre[2][3] = {{97.4, -135.2, -98.5}, {-114.3, -153.7, -85.5}};

/* Coefficients of the spherical harmonics of the radius, mm, for the left and the right lung;
 * that of Y(l, m) has the index l * l + l + m. */
static const double radii[2][TERMS] = {
    {
        261.2139, -51.4562, -67.2911, -92.7709, -6.8369,  2.0246,  34.6912,  -9.3122,  -20.3808,
        28.3786,  19.9016,  2.9410,   -21.9659, -12.2484, 23.5341, 16.9058,  -14.8275, -12.7045,
        -13.3134, -7.3816,  3.7360,   0.9389,   5.4082,   -2.5912, 2.7432,   0.0124,   -0.5069,
        1.4651,   7.6887,   4.2741,   1.3259,   1.9570,   -2.2379, -10.4667, -4.5869,  -7.6500,
        4.9322,   4.1837,   7.4530,   4.3181,   -2.5125,  -5.2570, -7.5335,  -3.4994,  2.5456,
        3.3463,   3.1193,   1.7466,   3.4055,   -3.4800,  -2.6339, -4.3391,  -4.9630,  -3.8490,
        0.2541,   4.6776,   8.6971,   5.1037,   -1.5787,  -1.5689, 2.6758,   3.3196,   0.9080,
        0.4438,   1.5247,   1.2527,   -0.2834,  -0.3733,  2.1597,  3.0384,   1.0037,   -4.8964,
        -7.6581,  -5.0632,  0.7580,   -1.0785,  -3.4518,  -3.0604, -2.0582,  -1.6927,  -1.4580,
        -0.1328,  -0.0516,  0.2455,   1.9076,   1.6173,   -0.1918, -0.5752,  -1.8129,  3.7176,
        5.5661,   4.2369,   -1.1085,  2.3308,   2.7281,   2.9027,  0.4410,   -0.5869,  1.3388,
        1.3392,   -0.4424,  -0.4369,  0.8277,   -1.2671,  -0.8658, -1.1157,  -2.4920,  0.2185,
        2.8094,   -1.8425,  -2.9303,  -2.7983,  0.1152,   -2.4996, -0.4720,  -0.4920,  0.1079,
        1.1531,   1.8641,   0.0191,   -0.5652,  -0.3569,  -0.7685, -2.0487,  -0.0041,  -0.6679,
        -0.7708,  0.5350,   3.4414,   -0.2220,  -3.7043,  0.0660,  1.2095,   1.4369,   -0.2183,
        2.4321,   -0.1626,  -1.7794,  -1.1086,  0.2697,   -1.7018, -1.8504,  -0.5251,  -0.3211,
        1.1250,   1.3397,   3.1765,   1.2605,   0.4031,   1.4765,  1.7327,   -0.8802,  -2.5198,
        0.2469,   3.1558,   1.3391,   0.4695,   -0.9129,  -0.4055, -1.2166,  -0.0099,  1.7728,
        0.7436,   -0.7154,  -0.6234,  1.1069,   0.8509,   -0.0274, 0.0409,
    },
    {
        256.8843, -42.6271, -92.1666, 119.0445, -9.3773, 14.5604, 36.3011,  -15.6822, -7.2816,
        13.4895,  -2.3371,  5.7974,   -21.6360, 11.3033, 26.0338, -24.7209, 13.4094,  -9.9106,
        12.2853,  -10.6779, 4.9257,   -0.0009,  -5.8850, 15.3988, -7.2562,  6.8869,   -6.8520,
        6.3267,   -9.9845,  8.7634,   -0.2160,  -6.8430, 3.9716,  1.8773,   0.6225,   5.8564,
        2.0872,   -4.8686,  -1.5210,  -0.2435,  6.7898,  -8.3379, -4.2723,  7.9090,   -1.4314,
        -4.7873,  6.5737,   -4.8447,  8.2073,   0.5786,  -3.9294, -1.8433,  4.4632,   -2.2010,
        -5.2707,  6.8547,   5.5121,   -8.4021,  -1.1235, 4.8769,  -5.2246,  4.8573,   -5.1456,
        5.8160,   -0.4496,  -1.9963,  -0.4559,  1.9271,  -4.5523, 4.3460,   3.8162,   -4.1501,
        -5.8827,  7.3079,   1.8268,   -4.9938,  1.9106,  -2.8509, 3.5080,   -4.4329,  3.8009,
        -1.7432,  0.4361,   -1.2448,  -0.2919,  -0.7584, 5.0198,  -3.1188,  -1.6910,  1.2105,
        5.2546,   -4.8289,  -0.9638,  3.7718,   0.8920,  -1.0969, -1.6231,  2.5551,   -3.0762,
        2.3676,   -2.1478,  1.5122,   -1.9343,  0.0357,  1.0661,  0.8336,   -2.0895,  1.7348,
        -1.0830,  0.0839,   -4.7756,  2.5281,   0.6029,  -0.8566, -1.2371,  2.5018,   -0.6513,
        -1.4072,  1.0774,   -1.3215,  0.3443,   -0.8607, 0.9198,  -0.6924,  0.5364,   0.2738,
        -0.4392,  1.1816,   -0.2255,  -1.4042,  2.0354,  -1.1550, 3.7666,   -1.1143,  -0.8478,
        -1.2212,  2.2767,   -0.8827,  0.6913,   0.6986,  -0.7730, 0.4017,   0.1774,   -1.1684,
        0.7585,   -0.1981,  0.4842,   -0.2941,  -0.5472, 0.4825,  0.5848,   -1.7167,  1.5424,
        0.4587,   -2.5559,  1.9968,   -2.5028,  -0.4182, 0.9687,  1.9456,   -2.8929,  0.2916,
        0.9562,   -1.0919,  1.2866,   -0.7646,  0.7568,  0.5630,  -1.5432,
    },
};

/* Move the vertices of a unit sphere to one lung's surface. */
static void shape(size_t lung, size_t count, double *vertices) {
  double y[TERMS];
  for (size_t i = 0; i < count; ++i) {
    double *p = vertices + 3 * i;
    double radius = 0.0;
    (void)supine_sh_evaluate(BAND, p, y);
    for (size_t t = 0; t < TERMS; ++t) {
      radius += radii[lung][t] * y[t];
    }
    for (size_t k = 0; k < 3; ++k) {
      p[k] = centre[lung][k] + radius * p[k];
    }
  }
}

supine_status supine_phantom_create(size_t vertices, double millilitres, supine_mesh *mesh,
                                    supine_error *error) {
  if (vertices < SUPINE_PHANTOM_VERTICES_MIN || vertices > SUPINE_PHANTOM_VERTICES_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "vertex count %zu: give %d to %d",
                            vertices, SUPINE_PHANTOM_VERTICES_MIN, SUPINE_PHANTOM_VERTICES_MAX);
  }
  if (!(millilitres > 0.0) || !isfinite(millilitres)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a volume of %g mL: give a positive volume", millilitres);
  }
  const double exact = sqrt(((double)vertices / 2.0 - 2.0) / 10.0);
  const size_t frequency = (size_t)fmax(2.0, floor(exact + 0.5));
  const size_t count = supine_phantom_geodesic_vertex_count(frequency);
  const size_t triangles = supine_phantom_geodesic_triangle_count(frequency);
  if (supine_mesh_allocate(2 * count, 2 * triangles, mesh) != SUPINE_OK) {
    return supine_error_memory(error, "%zu vertices", 2 * count);
  }
  for (size_t lung = 0; lung < 2; ++lung) {
    double *part = mesh->vertices + 3 * lung * count;
    supine_phantom_geodesic(frequency, (uint32_t)(lung * count), part,
                            mesh->triangles + 3 * lung * triangles);
    shape(lung, count, part);
  }
  const double factor = cbrt(1e3 * millilitres / supine_mesh_volume(mesh));
  for (size_t i = 0; i < 3 * mesh->vertex_count; ++i) {
    mesh->vertices[i] *= factor;
  }
  return SUPINE_OK;
}
