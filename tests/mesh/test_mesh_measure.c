/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare the volume, box and areas of surfaces with closed forms. */
#include <float.h>

#include "base/vec3.h"

#include "tests/helpers/mesh_samples.h"

/* Return the tolerance of a sum of `terms` terms of about `size`, each rounded a few times. */
static double rounding(size_t terms, double size) {
  return 8.0 * (double)terms * DBL_EPSILON * size;
}

TEST(test_volume_box_and_tetrahedron_literal) {
  supine_mesh box = sample_box();
  supine_mesh tetrahedron = sample_tetrahedron();
  assert_close(supine_mesh_volume(&box), 1430000.0, rounding(12, 1430000.0));
  assert_close(supine_mesh_volume(&tetrahedron), 288000.0, rounding(4, 288000.0));
  supine_mesh_free(&box);
  supine_mesh_free(&tetrahedron);
}

TEST(test_volume_reversed_triangles_negative) {
  supine_mesh box = sample_box();
  for (size_t t = 0; t < box.triangle_count; ++t) {
    const uint32_t swap = box.triangles[3 * t];
    box.triangles[3 * t] = box.triangles[3 * t + 1];
    box.triangles[3 * t + 1] = swap;
  }
  assert_close(supine_mesh_volume(&box), -1430000.0, rounding(12, 1430000.0));
  supine_mesh_free(&box);
}

/* The vertices of the torus are ((R + r cos b) cos a, (R + r cos b) sin a, r sin b), for N angles a
 * and M angles b. Any horizontal section is a ring between two regular polygons, so the volume is
 *
 *     N sin(2 pi / N) R (M / 2) r^2 sin(2 pi / M)
 *
 * The torus is far from the origin, where the terms of the volume are large and cancel. */
TEST(test_volume_torus_far_from_origin_closed_form) {
  enum { N = 37, M = 23 };
  const double R = 83.0;
  const double r = 29.0;
  static double vertices[3 * N * M];
  static uint32_t triangles[6 * N * M];
  for (uint32_t i = 0; i < N; ++i) {
    for (uint32_t j = 0; j < M; ++j) {
      const double a = 2.0 * M_PI * i / N;
      const double b = 2.0 * M_PI * j / M;
      double *vertex = vertices + 3 * (size_t)(i * M + j);
      vertex[0] = (R + r * cos(b)) * cos(a) + 4.0e6;
      vertex[1] = (R + r * cos(b)) * sin(a) - 3.0e6;
      vertex[2] = r * sin(b) + 5.0e6;
      const uint32_t p = i * M + j;
      const uint32_t q = (i + 1) % N * M + j;
      const uint32_t s = (i + 1) % N * M + (j + 1) % M;
      const uint32_t t = i * M + (j + 1) % M;
      const uint32_t two[6] = {p, q, s, p, s, t};
      memcpy(triangles + 6 * (size_t)(i * M + j), two, sizeof two);
    }
  }
  supine_mesh torus = sample_make(N * M, vertices, 2 * N * M, triangles);
  const double expected = N * sin(2.0 * M_PI / N) * R * 0.5 * M * r * r * sin(2.0 * M_PI / M);
  /* Tolerance: rounding error of coordinates near 5e6 mm, times the area of about 96000 mm^2. */
  assert_close(supine_mesh_volume(&torus), expected, 5.0e6 * DBL_EPSILON * 96000.0);
  supine_mesh_free(&torus);
}

/* Points spread evenly over a length a have the standard deviation a / sqrt(12). */
TEST(test_spread_of_each_of_two_boxes_closed_form) {
  supine_mesh box = sample_box();
  double low[3];
  double high[3];
  double spread[3];
  (void)supine_mesh_box(&box, low, high);
  const size_t n = box.vertex_count;
  const size_t m = box.triangle_count;
  static double vertices[2 * 3 * 64];
  static uint32_t triangles[2 * 3 * 64];
  for (size_t i = 0; i < 6 * n; ++i) { /* the second box is half as large, and elsewhere */
    const size_t k = i % (3 * n);
    vertices[i] = i < 3 * n ? box.vertices[k] : 0.5 * box.vertices[k] - 700.0;
  }
  for (size_t i = 0; i < 6 * m; ++i) {
    triangles[i] = box.triangles[i % (3 * m)] + (uint32_t)(i < 3 * m ? 0 : n);
  }
  supine_mesh both = sample_make(2 * n, vertices, 2 * m, triangles);
  for (size_t part = 0; part < 2; ++part) {
    const double size = part == 0 ? 1.0 : 0.5;
    const double volume = supine_mesh_spread(&both, part * n, (part + 1) * n, spread);
    assert_close(volume, 1430000.0 * size * size * size, rounding(12, 1.0e9));
    for (size_t k = 0; k < 3; ++k) {
      assert_close(spread[k], size * (high[k] - low[k]) / sqrt(12.0), rounding(12, 1.0e6));
    }
  }
  assert_true(supine_mesh_spread(&both, 2 * n, 3 * n, spread) == 0.0 && spread[0] == 0.0);
  supine_mesh_free(&both);
  supine_mesh_free(&box);
}

TEST(test_box_literal) {
  supine_mesh box = sample_box();
  double minimum[3];
  double maximum[3];
  supine_mesh_box(&box, minimum, maximum);
  const double expected_minimum[3] = {-30.0, 10.0, -50.0};
  const double expected_maximum[3] = {70.0, 120.0, 80.0};
  assert_memory_equal(minimum, expected_minimum, sizeof minimum);
  assert_memory_equal(maximum, expected_maximum, sizeof maximum);
  supine_mesh_free(&box);
}

TEST(test_vertex_area_tetrahedron_literal) {
  supine_mesh mesh = sample_tetrahedron();
  double area[4];
  supine_mesh_vertex_area(&mesh, area);
  /* The three faces in the coordinate planes have 120^2 / 2 = 7200 mm^2 each, the fourth has
   * sqrt(3) times that. */
  const double slanted = 7200.0 * sqrt(3.0);
  assert_close(area[0], 7200.0, rounding(3, 7200.0));
  for (int i = 1; i < 4; ++i) {
    assert_close(area[i], (2.0 * 7200.0 + slanted) / 3.0, rounding(3, 9000.0));
  }
  supine_mesh_free(&mesh);
}

TEST(test_vertex_area_sums_to_surface) {
  supine_mesh box = sample_box();
  double area[8];
  supine_mesh_vertex_area(&box, area);
  double sum = 0.0;
  for (int i = 0; i < 8; ++i) {
    sum += area[i];
  }
  assert_close(sum, 2.0 * (100.0 * 110.0 + 110.0 * 130.0 + 130.0 * 100.0), rounding(36, 76600.0));
  supine_mesh_free(&box);
}

/* A surface that moves along its smoothed normals gains the volume that was asked, inwards and
 * outwards, and its normals stay unit vectors. */
TEST(test_offset_smoothed_normals_gains_volume) {
  supine_mesh box = sample_box();
  supine_topology topology = {0};
  double normals[24];
  double space[24];
  double change[3];
  assert_int_equal(supine_mesh_topology_create(&box, &topology), SUPINE_OK);
  supine_mesh_smooth_normals(&box, &topology, normals, space);
  for (size_t i = 0; i < 8; ++i) {
    assert_close(supine_length(normals + 3 * i), 1.0, rounding(3, 1.0));
  }
  supine_mesh_volume_along(&box, normals, change);
  for (int sign = -1; sign <= 1; sign += 2) {
    const double wanted = sign * 71500.0; /* 5 % */
    double h = 0.0;
    assert_true(supine_mesh_offset_to(change, wanted, &h));
    assert_true(sign * h > 0.0);
    supine_mesh moved = sample_box();
    for (size_t i = 0; i < 24; ++i) {
      moved.vertices[i] += h * normals[i];
    }
    assert_close(supine_mesh_volume(&moved), 1430000.0 + wanted, 1e-9 * 1430000.0);
    supine_mesh_free(&moved);
  }
  double none = 0.0;
  assert_false(supine_mesh_offset_to((const double[3]){0.0, 0.0, 0.0}, 1.0, &none));
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&box);
}

TEST(test_measures_empty_mesh_zero) {
  const supine_mesh mesh = {0};
  double minimum[3] = {1, 1, 1};
  double maximum[3] = {1, 1, 1};
  supine_mesh_box(&mesh, minimum, maximum);
  for (int axis = 0; axis < 3; ++axis) {
    assert_true(minimum[axis] == 0.0 && maximum[axis] == 0.0);
  }
  assert_true(supine_mesh_volume(&mesh) == 0.0);
}
