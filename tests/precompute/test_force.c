/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test forces (18), vertex heights and displacement directions (15)-(17) of [Santhanam2008]. */
#include <float.h>

#include "precompute/physics/model.h"
#include "tests/helpers/test.h"

#include "tests/helpers/lungs_helpers.h"

static int setup(void **state) {
  supine_mesh lumps[2] = {helper_lump(9, 90.0, 3), helper_lump(10, -85.0, 4)};
  supine_lungs *lungs = calloc(1, sizeof *lungs);
  assert_int_equal(supine_lungs_create(lumps, 2, NULL, lungs, NULL), SUPINE_OK);
  supine_mesh_free(&lumps[0]);
  supine_mesh_free(&lumps[1]);
  *state = lungs;
  return 0;
}

static int teardown(void **state) {
  supine_lungs_free(*state);
  free(*state);
  return 0;
}

static double height(const supine_lungs *lungs, const double *g, size_t i) {
  const double *p = lungs->mesh.vertices + 3 * i;
  return g[0] * p[0] + g[1] * p[1] + g[2] * p[2];
}

TEST(test_height_range_random_directions_equals_brute_force) {
  const supine_lungs *lungs = *state;
  enum { COUNT = 77 };
  double g[3 * COUNT];
  double minimum[COUNT];
  double maximum[COUNT];
  uint64_t seed = 12;
  for (size_t d = 0; d < COUNT; ++d) {
    random_direction(&seed, g + 3 * d);
  }
  assert_int_equal(supine_physics_height_range(lungs, false, COUNT, g, minimum, maximum),
                   SUPINE_OK);
  for (size_t d = 0; d < COUNT; ++d) {
    double low = INFINITY;
    double high = -INFINITY;
    for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
      low = fmin(low, height(lungs, g + 3 * d, i));
      high = fmax(high, height(lungs, g + 3 * d, i));
    }
    assert_close(minimum[d], low, 8 * DBL_EPSILON * 300.0);
    assert_close(maximum[d], high, 8 * DBL_EPSILON * 300.0);
  }
}

/* Compute the force on each vertex for gravity g. The lungs extend from `low` to `high` along g,
 * mm. */
static void force_along(const supine_lungs *lungs, const supine_force_law *law, const double g[3],
                        double low, double high, double *force) {
  const supine_gravities gravity = {1, g, &low, &high};
  supine_physics_force(lungs, law, &gravity, lungs->mesh.vertex_count, NULL, force);
}

TEST(test_force_paper_law_equals_height_from_0_to_1) {
  const supine_lungs *lungs = *state;
  const size_t n = lungs->mesh.vertex_count;
  const supine_force_law law = supine_physics_model(SUPINE_LAW_PAPER).force;
  double *down = malloc(n * sizeof *down);
  double *up = malloc(n * sizeof *up);
  const double g[3] = {0.36, -0.48, 0.8};
  const double opposite[3] = {-0.36, 0.48, -0.8};
  double low;
  double high;
  assert_int_equal(supine_physics_height_range(lungs, false, 1, g, &low, &high), SUPINE_OK);
  force_along(lungs, &law, g, low, high, down);
  force_along(lungs, &law, opposite, -high, -low, up);
  double least = INFINITY;
  double most = -INFINITY;
  for (size_t i = 0; i < n; ++i) {
    least = fmin(least, down[i]);
    most = fmax(most, down[i]);
    assert_close(down[i], (height(lungs, g, i) - low) / (high - low), 4 * DBL_EPSILON);
    /* With opposite gravity, the force is 1 - height. */
    assert_close(down[i] + up[i], 1.0, 8 * DBL_EPSILON);
  }
  assert_close(least, 0.0, 4 * DBL_EPSILON);
  assert_close(most, 1.0, 4 * DBL_EPSILON);
  free(down);
  free(up);
}

TEST(test_force_box_part_uses_box_coordinates) {
  const supine_lungs *lungs = *state;
  const supine_force_law law = {.base = 0.5, .gain = 0.0, .box = {1.0, 10.0, 100.0}};
  const double g[3] = {0.0, 1.0, 0.0};
  double *force = malloc(lungs->mesh.vertex_count * sizeof *force);
  force_along(lungs, &law, g, lungs->minimum[1], lungs->maximum[1], force);
  for (size_t i = 0; i < lungs->mesh.vertex_count; i += 13) {
    double box[3];
    supine_lungs_box_coordinates(lungs, i, box);
    assert_close(force[i], 0.5 + box[0] + 10.0 * box[1] + 100.0 * box[2], 1e-12);
  }
  free(force);
}

/* The constant `soften` multiplies the force at each vertex by a factor. The factors have geometric
 * mean 1, and their logarithm grows linearly with height. */
TEST(test_force_softened_logarithm_linear_in_height) {
  const supine_lungs *lungs = *state;
  const size_t n = lungs->mesh.vertex_count;
  supine_force_law law = {.base = 2.0};
  const double g[3] = {0.36, -0.48, 0.8};
  double low;
  double high;
  double *force = malloc(n * sizeof *force);
  double logarithms = 0.0;
  law.soften = 1.3;
  assert_int_equal(supine_physics_height_range(lungs, false, 1, g, &low, &high), SUPINE_OK);
  force_along(lungs, &law, g, low, high, force);
  for (size_t i = 0; i < n; ++i) {
    const double steps = (height(lungs, g, i) - height(lungs, g, 0)) / (high - low);
    assert_close(log(force[i] / force[0]), 1.3 * steps, 1e-13);
    logarithms += log(force[i] / 2.0) / (double)n;
  }
  assert_close(logarithms, 0.0, 1e-13);
  free(force);
}

TEST(test_force_some_vertices_same_as_all) {
  const supine_lungs *lungs = *state;
  enum { COUNT = 5 };
  const size_t n = lungs->mesh.vertex_count;
  const supine_force_law law = {.base = 0.3, .gain = 1.7, .box = {0.2, -0.4, 1.1}, .soften = 0.7};
  const size_t vertices[3] = {n - 1, 0, n / 3};
  uint64_t seed = 9;
  double g[3 * COUNT];
  double low[COUNT];
  double high[COUNT];
  double some[3 * COUNT];
  double *all = malloc(n * sizeof *all);
  for (size_t d = 0; d < COUNT; ++d) {
    random_direction(&seed, g + 3 * d);
  }
  assert_int_equal(supine_physics_height_range(lungs, false, COUNT, g, low, high), SUPINE_OK);
  const supine_gravities gravities = {COUNT, g, low, high};
  supine_physics_force(lungs, &law, &gravities, 3, vertices, some);
  for (size_t d = 0; d < COUNT; ++d) {
    force_along(lungs, &law, g + 3 * d, low[d], high[d], all);
    for (size_t k = 0; k < 3; ++k) {
      assert_close(some[k * COUNT + d], all[vertices[k]], 1e-15);
    }
  }
  free(all);
}

TEST(test_directions_box_model_literal_values) {
  /* A left lung 100 x 200 x 300 mm in size. The midline is its inner side, x = 10. */
  double vertices[] = {10, 0, 0, 110, 0, 0, 10, 200, 0, 10, 0, 300, 60, 100, 150};
  uint32_t triangles[] = {0, 1, 2, 0, 3, 1, 1, 3, 4, 1, 4, 2, 0, 2, 3, 2, 4, 3};
  const supine_mesh mesh = {5, vertices, 6, triangles};
  supine_lungs lungs = {0};
  const supine_direction_law law = supine_physics_model(SUPINE_LAW_PAPER).direction;
  double d[15];
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, &lungs, NULL), SUPINE_OK);
  assert_close(lungs.midline, 10.0, 0.0);
  assert_int_equal(lungs.side[0], 1);
  assert_int_equal(supine_physics_directions(&lungs, NULL, &law, d, NULL), SUPINE_OK);
  /* vertex 1 is outermost, frontmost and at the base, where (15)-(17) are largest */
  assert_close(d[3], 2.0, 1e-14);
  assert_close(d[4], -1.5, 1e-14);
  assert_close(d[5], -16.0, 1e-14);
  /* a vertex on the midline, back or apex face of the box does not leave that face */
  assert_close(d[7], 0.0, 0.0);
  assert_close(d[11], 0.0, 0.0);
  assert_close(d[0], 0.0, 0.0);
  /* vertex 4: X = Y = Z = 1/2, moved by 2 (1/2)^1.5, -1.5 (1/2), -16 (1/2)^1.4 */
  assert_close(d[12], 0.70710678118654752, 1e-14);
  assert_close(d[13], -0.75, 1e-14);
  assert_close(d[14], -6.0628662660415918, 1e-13);
  supine_lungs_free(&lungs);
}

/* The shear of a force of 2 h, which is 0 on one vertex, has literal values. */
TEST(test_directions_shear_literal_values) {
  double vertices[] = {10, 0, 0, 110, 0, 0, 10, 200, 0, 10, 0, 300, 60, 100, 150};
  uint32_t triangles[] = {0, 1, 2, 0, 3, 1, 1, 3, 4, 1, 4, 2, 0, 2, 3, 2, 4, 3};
  const supine_mesh mesh = {5, vertices, 6, triangles};
  const supine_force_law force = {.gain = 2.0};
  supine_direction_law law = {.c = {0.0, 1.0, 0.0, 1.0, 12.0, 1.0}, .shear = 0.5};
  supine_lungs lungs = {0};
  double d[15];
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, &lungs, NULL), SUPINE_OK);
  assert_int_equal(supine_physics_directions(&lungs, &force, &law, d, NULL), SUPINE_OK);
  /* h = 0, 0, 1, 0, 1/2 and Z = 1, 1, 1, 0, 1/2: D^2 = ((2 12)^2 + (1 6)^2) / 5; RMS force 1 */
  const double rms = sqrt((576.0 + 36.0) / 5.0);
  assert_close(d[7], -0.5 * 0.5 * rms / 2.0, 1e-13);
  assert_close(d[10], 0.5 * 0.5 * rms / 0.2, 1e-13); /* the smallest divisor: 0.2 of RMS */
  assert_close(d[13], 0.0, 1e-14);
  assert_close(d[8], -12.0, 1e-14);
  supine_lungs_free(&lungs);
}

TEST(test_directions_two_lungs_move_outwards) {
  const supine_lungs *lungs = *state;
  const size_t n = lungs->mesh.vertex_count;
  const supine_direction_law law = supine_physics_model(SUPINE_LAW_PAPER).direction;
  double *d = malloc(3 * n * sizeof *d);
  assert_int_equal(supine_physics_directions(lungs, NULL, &law, d, NULL), SUPINE_OK);
  for (size_t i = 0; i < n; ++i) {
    assert_true(i < lungs->lung_begin[1] ? d[3 * i] >= 0.0 : d[3 * i] <= 0.0);
    assert_true(d[3 * i + 1] <= 0.0 && d[3 * i + 2] <= 0.0);
  }
  free(d);
}

TEST(test_directions_bad_constants_refused) {
  double d[3];
  supine_error error;
  supine_direction_law law = supine_physics_model(SUPINE_LAW_PAPER).direction;
  law.c[3] = 0.0;
  assert_int_equal(supine_physics_directions(*state, NULL, &law, d, &error), SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "c4");
  law = supine_physics_model(SUPINE_LAW_PAPER).direction;
  law.c[4] = NAN;
  assert_int_equal(supine_physics_directions(*state, NULL, &law, d, &error), SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "c5");
}

TEST_GROUP(setup, teardown)
