/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that the solver reaches the required residual on meshes and stiffness unlike a lung's. */
#include "precompute/lungs/phantom.h"
#include "precompute/physics/solve.h"
#include "tests/helpers/test.h"

#include "tests/helpers/lungs_helpers.h"

static supine_mesh phantom(void) {
  supine_mesh mesh = {0};
  assert_int_equal(supine_phantom_create(3000, 2500.0, &mesh, NULL), SUPINE_OK);
  return mesh;
}

/* Return the largest difference between the applied force and the force computed back from a
 * solution, relative to the largest force. If the model spreads forces (reach > 0), first divide
 * both forces at each vertex by its stiffness. */
static double residual(const supine_lungs *lungs, const supine_model *model, const double g[3],
                       const supine_solution *solution) {
  const size_t n = solution->vertex_count;
  double *force = malloc(2 * n * sizeof *force);
  double range[2];
  assert_int_equal(supine_physics_height_range(lungs, false, 1, g, range, range + 1), SUPINE_OK);
  const supine_gravities gravity = {1, g, range, range + 1};
  supine_physics_force(lungs, &model->force, &gravity, n, NULL, force);
  assert_int_equal(
      supine_physics_equilibrium_force(solution->equilibrium, solution->catch_, force + n, NULL),
      SUPINE_OK);
  for (size_t i = 0; i < 2 * n && model->reach > 0.0 && model->stiffness != NULL; ++i) {
    force[i] /= model->stiffness[i % n];
  }
  const double relative = helper_difference(n, force, force + n) / helper_largest(n, force);
  free(force);
  return relative;
}

/* Solve without and with a reach, a distance over which forces spread. Assert a small residual.
 * Assert that the force that each vertex keeps, catch_, is finite, and not negative without a
 * reach. */
static void check(const char *what, supine_mesh *mesh, const double *stiffness) {
  static const double g[3] = {0.48, 0.64, -0.6};
  supine_lungs lungs = {0};
  supine_error error = {0};
  if (supine_lungs_create(mesh, 1, NULL, &lungs, &error) != SUPINE_OK) {
    fail_msg("%s: %s", what, error.message);
  }
  for (int k = 0; k < 2; ++k) {
    supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
    supine_solution solution = {0};
    model.reach = k == 0 ? 0.0 : 10.0;
    model.stiffness = stiffness;
    if (supine_physics_solve(&lungs, &model, g, &solution, &error) != SUPINE_OK) {
      fail_msg("%s, reach %g: %s", what, model.reach, error.message);
    }
    const double left = residual(&lungs, &model, g, &solution);
    printf("%s, reach %2.0f mm: %zu vertices, residual %.0e\n", what, model.reach,
           solution.vertex_count, left);
    assert_true(left <= 1e-10);
    for (size_t i = 0; i < solution.vertex_count; ++i) {
      assert_true(isfinite(solution.catch_[i]));
      assert_true(k == 1 || solution.catch_[i] > -1e-9);
    }
    supine_physics_solution_free(&solution);
  }
  supine_lungs_free(&lungs);
  supine_mesh_free(mesh);
}

/* Make slivers: move a corner of every seventh triangle to a thousandth of its distance from the
 * next corner. */
TEST(test_solve_slivers_reaches_residual) {
  supine_mesh mesh = phantom();
  for (size_t t = 0; t < mesh.triangle_count; t += 7) {
    double *a = mesh.vertices + 3 * (size_t)mesh.triangles[3 * t];
    const double *b = mesh.vertices + 3 * (size_t)mesh.triangles[3 * t + 1];
    for (size_t k = 0; k < 3; ++k) {
      a[k] = b[k] + 1e-3 * (a[k] - b[k]);
    }
  }
  check("slivers", &mesh, NULL);
}

TEST(test_solve_duplicate_faces_reaches_residual) {
  supine_mesh mesh = phantom();
  const size_t count = mesh.triangle_count;
  mesh.triangles = realloc(mesh.triangles, 6 * count * sizeof *mesh.triangles);
  memcpy(mesh.triangles + 3 * count, mesh.triangles, 3 * count * sizeof *mesh.triangles);
  mesh.triangle_count = 2 * count;
  check("every face twice", &mesh, NULL);
}

TEST(test_solve_ten_thousand_components_reaches_residual) {
  enum { COUNT = 10000 };
  static const uint32_t faces[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};
  supine_mesh mesh = {.vertex_count = 4 * COUNT, .triangle_count = 4 * COUNT};
  uint64_t seed = 515;
  mesh.vertices = calloc(3 * mesh.vertex_count, sizeof *mesh.vertices);
  mesh.triangles = calloc(3 * mesh.triangle_count, sizeof *mesh.triangles);
  for (size_t c = 0; c < COUNT; ++c) {
    const double at[3] = {300.0 * helper_random(&seed), 200.0 * helper_random(&seed),
                          250.0 * helper_random(&seed)};
    for (size_t v = 0; v < 4; ++v) {
      for (size_t k = 0; k < 3; ++k) {
        mesh.vertices[3 * (4 * c + v) + k] = at[k] + (v == k + 1 ? 0.7 : 0.0);
      }
    }
    for (size_t k = 0; k < 12; ++k) {
      mesh.triangles[12 * c + k] = (uint32_t)(4 * c) + faces[k];
    }
  }
  check("10,000 components", &mesh, NULL);
}

TEST(test_solve_flat_mesh_reaches_residual) {
  supine_mesh mesh = phantom();
  for (size_t i = 0; i < mesh.vertex_count; ++i) {
    mesh.vertices[3 * i + 1] *= 1e-6;
  }
  check("flat to a ten-thousandth of a millimetre", &mesh, NULL);
}

TEST(test_solve_far_from_origin_reaches_residual) {
  supine_mesh mesh = phantom();
  for (size_t i = 0; i < 3 * mesh.vertex_count; ++i) {
    mesh.vertices[i] += 1e7;
  }
  check("1e7 mm off", &mesh, NULL);
}

TEST(test_solve_stiffness_over_six_decades_reaches_residual) {
  supine_mesh mesh = phantom();
  uint64_t seed = 66;
  double *stiffness = calloc(mesh.vertex_count, sizeof *stiffness);
  for (size_t i = 0; i < mesh.vertex_count; ++i) {
    stiffness[i] = pow(10.0, 6.0 * helper_random(&seed) - 3.0);
  }
  check("six decades of stiffness", &mesh, stiffness);
  free(stiffness);
}
