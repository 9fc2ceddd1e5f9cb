/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Volumes by their forms against volumes of the surface, and the scale that gives a volume. */
#include <float.h>

#include "test.h"

#include <supine/runtime.h>
#include <supine/safetensors.h>

#include "runtime_fixture.h"

#include "tests/poses.h"

static supine_basis *open_bytes(const fixture *f, unsigned char **bytes) {
  size_t size = 0;
  *bytes = fixture_bytes(f, &size);
  supine_basis *basis = NULL;
  supine_error error = {0};
  if (supine_basis_open_memory(*bytes, size, &basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return basis;
}

static void check_lung_volumes(bool vector) {
  fixture *f = fixture_create(47, 5, 2, 2, vector, true, 9, 77);
  unsigned char *bytes = NULL;
  supine_basis *basis = open_bytes(f, &bytes);
  double *xyz = calloc(3 * f->vertices, sizeof *xyz);
  assert_non_null(xyz);
  uint64_t random = 4242;
  for (int trial = 0; trial < 50; ++trial) {
    const double gravity[3] = {fixture_random(&random), fixture_random(&random),
                               fixture_random(&random)};
    double weights[5];
    assert_int_equal(supine_basis_weights(basis, gravity, weights), SUPINE_OK);
    const double scales[2] = {3 * fixture_random(&random), 3 * fixture_random(&random)};
    for (size_t lung = 0; lung < 2; ++lung) {
      fixture_deform(f, weights, (double[]){0, 0}, xyz);
      const double rest = fixture_volume(f, lung, xyz);
      fixture_deform(f, weights, scales, xyz);
      const double gained = fixture_volume(f, lung, xyz) - rest;
      const double given = posed_lung_volume(basis, lung, weights, scales[lung]);
      assert_true(fabs(given - gained) <= 1000 * DBL_EPSILON * (fabs(rest) + fabs(gained)));
    }
  }
  free(xyz);
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

static void test_lung_volume_scalar_equals_surface(void **state) {
  (void)state;
  check_lung_volumes(false);
}

static void test_lung_volume_vector_equals_surface(void **state) {
  (void)state;
  check_lung_volumes(true);
}

static void test_scale_random_volumes_reached(void **state) {
  (void)state;
  fixture *f = fixture_create(47, 5, 2, 2, false, true, 9, 77);
  unsigned char *bytes = NULL;
  supine_basis *basis = open_bytes(f, &bytes);
  uint64_t random = 99;
  int reached = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const double gravity[3] = {fixture_random(&random), fixture_random(&random),
                               fixture_random(&random)};
    const double volume = 100 * fixture_random(&random);
    double weights[5];
    double scale = 0;
    assert_int_equal(supine_basis_weights(basis, gravity, weights), SUPINE_OK);
    if (posed_scale(basis, weights, volume, &scale, NULL) == SUPINE_OK) {
      ++reached;
      const double total =
          posed_lung_volume(basis, 0, weights, scale) + posed_lung_volume(basis, 1, weights, scale);
      assert_true(fabs(total - volume) <= 1e-10 * fabs(volume));
    }
    for (size_t lung = 0; lung < 2; ++lung) {
      if (posed_lung_scale(basis, lung, weights, volume, &scale, NULL) == SUPINE_OK) {
        ++reached;
        assert_true(fabs(posed_lung_volume(basis, lung, weights, scale) - volume) <=
                    1e-10 * fabs(volume));
      }
    }
  }
  assert_true(reached > 300);
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

/* A basis whose cubic is a s + b s^2 + c s^3 exactly: one mode, one constant harmonic, weight 1. */
static supine_basis *open_cubic(double a, double b, double c, unsigned char **bytes) {
  fixture *f = fixture_create(5, 1, 0, 1, false, true, 1, 3);
  f->mode[0] = 1 / 0.28209479177387814;
  f->linear[0] = a;
  f->quadratic[0] = b;
  f->cubic[0] = c;
  supine_basis *basis = open_bytes(f, bytes);
  fixture_destroy(f);
  return basis;
}

static void test_scale_cubics_branch_of_rest_only(void **state) {
  (void)state;
  static const struct {
    double a, b, c, volume, scale; /* scale NAN: out of reach */
  } cases[] = {
      {2, 0, 0, 10, 5},           /* linear */
      {2, 0, 0, -10, -5},         /**/
      {-2, 0, 0, 10, -5},         /* the field shrinks the lung */
      {0, 0, 0, 1, NAN},          /* nothing moves */
      {0, 0, 1, 8, NAN},          /* no slope to begin with */
      {0, 0, 0, 0, 0},            /**/
      {2, 1, 0, 8, 2},            /* 2 s + s^2 = 8: s = 2, not -4 */
      {2, 1, 0, -0.75, -0.5},     /* turns back at s = -1, V = -1 */
      {2, 1, 0, -1, -1},          /* just reached */
      {2, 1, 0, -1.0001, NAN},    /**/
      {1, 0, 1, 10, 2},           /* s + s^3 */
      {1, 0, 1, -30, -3},         /**/
      {3, 0, -1, 2, 1},           /* 3 s - s^3 turns at s = 1, V = 2; s = -2 gives 2 too */
      {3, 0, -1, 2.001, NAN},     /* although s = -2.0001 would give it */
      {3, 0, -1, 1.375, 0.5},     /**/
      {6, -4.5, 1, 2.5, 1},       /* turns at s = 1 (2.5) and at s = 2 */
      {6, -4.5, 1, 2.6, NAN},     /* reached again only beyond both turns */
      {1e-300, 0, 0, 1e300, NAN}, /* beyond every number */
      {1e-3, 0, 0, 1e3, 1e6},     /**/
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    unsigned char *bytes = NULL;
    supine_basis *basis = open_cubic(cases[i].a, cases[i].b, cases[i].c, &bytes);
    const double g[3] = {0.3, 0.2, -0.1};
    double weight = 0;
    double scale = 12345;
    supine_error error = {0};
    assert_int_equal(supine_basis_weights(basis, g, &weight), SUPINE_OK);
    assert_true(fabs(weight - 1) <= 4 * DBL_EPSILON);
    weight = 1;
    const supine_status status = posed_scale(basis, &weight, cases[i].volume, &scale, &error);
    if (isnan(cases[i].scale)) {
      assert_int_equal(status, SUPINE_ERROR_NUMERICAL);
      assert_true(strlen(error.message) > 0);
    } else {
      assert_int_equal(status, SUPINE_OK);
      /* Where the slope vanishes the root is known to the square root of epsilon alone. */
      assert_true(fabs(scale - cases[i].scale) <= 4e-8 * fabs(cases[i].scale));
    }
    supine_basis_close(basis);
    free(bytes);
  }
}

static void test_scale_not_finite_volume_refused(void **state) {
  (void)state;
  unsigned char *bytes = NULL;
  supine_basis *basis = open_cubic(2, 0, 0, &bytes);
  const double one = 1;
  const double bad = NAN;
  double scale = 0;
  assert_int_equal(posed_scale(basis, &one, NAN, &scale, NULL), SUPINE_ERROR_NUMERICAL);
  assert_int_equal(posed_scale(basis, &one, INFINITY, &scale, NULL), SUPINE_ERROR_NUMERICAL);
  assert_int_equal(posed_scale(basis, &bad, 1, &scale, NULL), SUPINE_ERROR_NUMERICAL);
  supine_basis_close(basis);
  free(bytes);
}

static void test_pose_open_surface_says_so(void **unused) {
  (void)unused;
  fixture *f = fixture_create(9, 3, 1, 1, false, false, 9, 5);
  unsigned char *bytes = NULL;
  supine_basis *basis = open_bytes(f, &bytes);
  const supine_state state = {.gravity = {0, 1, 0}, .volume = {SUPINE_VOLUME_SCAN, 10}};
  supine_pose pose;
  supine_error error;
  assert_int_equal(supine_basis_pose(basis, &state, &pose, &error), SUPINE_ERROR_OPEN_SURFACE);
  assert_non_null(strstr(error.message, "--scale"));
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_lung_volume_scalar_equals_surface),
      cmocka_unit_test(test_lung_volume_vector_equals_surface),
      cmocka_unit_test(test_scale_random_volumes_reached),
      cmocka_unit_test(test_scale_cubics_branch_of_rest_only),
      cmocka_unit_test(test_scale_not_finite_volume_refused),
      cmocka_unit_test(test_pose_open_surface_says_so),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
