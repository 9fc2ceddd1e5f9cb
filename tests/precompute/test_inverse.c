/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that the applied force on each vertex can be computed from its force in equilibrium. */
#include "precompute/physics/model.h"
#include "tests/helpers/test.h"

#include "tests/helpers/lungs_helpers.h"

typedef struct fixture {
  supine_lungs lungs;
  supine_equilibrium *equilibrium[2]; /* without and with a distance over which forces are spread */
  double *stiffness, *force, *lesions;
} fixture;

static int setup(void **state) {
  fixture *f = calloc(1, sizeof *f);
  uint64_t seed = 4099;
  supine_mesh lump = helper_lump(4, 60.0, 77);
  assert_int_equal(supine_lungs_create(&lump, 1, NULL, &f->lungs, NULL), SUPINE_OK);
  const size_t n = lump.vertex_count;
  f->stiffness = malloc(n * sizeof(double));
  f->force = malloc(n * sizeof(double));
  f->lesions = malloc(n * sizeof(double));
  for (size_t i = 0; i < n; ++i) {
    f->stiffness[i] = 0.3 + 3.0 * helper_random(&seed);
    f->force[i] = 0.5 + helper_random(&seed);
    f->lesions[i] = 1.0 + (double)(i % 7 == 0) * helper_random(&seed);
  }
  for (int k = 0; k < 2; ++k) {
    supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
    model.reach = k == 0 ? 0.0 : 17.3;
    model.lesions = f->lesions;
    assert_int_equal(supine_physics_model_equilibrium(&f->lungs, &model, &f->equilibrium[k], NULL),
                     SUPINE_OK);
  }
  supine_mesh_free(&lump);
  *state = f;
  return 0;
}

static int teardown(void **state) {
  fixture *f = *state;
  for (int k = 0; k < 2; ++k) {
    supine_physics_equilibrium_destroy(f->equilibrium[k]);
  }
  free(f->stiffness);
  free(f->force);
  free(f->lesions);
  supine_lungs_free(&f->lungs);
  free(f);
  return 0;
}

static void solve(const fixture *f, int k, const double *stiffness, double *catch_) {
  assert_int_equal(supine_physics_equilibrium_set_stiffness(f->equilibrium[k], stiffness, NULL),
                   SUPINE_OK);
  assert_int_equal(supine_physics_equilibrium_solve(f->equilibrium[k], 1, f->force, catch_, NULL),
                   SUPINE_OK);
}

TEST(test_equilibrium_force_from_catch_recovered) {
  const fixture *f = *state;
  const size_t n = f->lungs.mesh.vertex_count;
  double *catch_ = malloc(n * sizeof *catch_);
  double *force = malloc(n * sizeof *force);
  for (int k = 0; k < 2; ++k) {
    for (int even = 0; even < 2; ++even) {
      const double *stiffness = even == 1 ? NULL : f->stiffness;
      solve(f, k, stiffness, catch_);
      assert_int_equal(supine_physics_equilibrium_force(f->equilibrium[k], catch_, force, NULL),
                       SUPINE_OK);
      /* The test would prove nothing if the solution equalled the applied force. */
      assert_true(helper_difference(n, catch_, f->force) > 0.01);
      assert_true(helper_difference(n, force, f->force) < 1e-10);
    }
  }
  free(catch_);
  free(force);
}

TEST_GROUP(setup, teardown)
