/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that volume forms equal the volume of the surface, and that gains (factors on the
 * displacement) are found for a given volume. Volume forms are polynomials in gains or mode
 * weights. */
#include <float.h>

#include "tests/helpers/test.h"

#include <supine/runtime.h>

#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

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

TEST(test_lung_volume_scalar_equals_surface) {
  check_lung_volumes(false);
}

TEST(test_lung_volume_vector_equals_surface) {
  check_lung_volumes(true);
}

TEST(test_scale_random_volumes_reached) {
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

/* Make a basis whose volume change is a s + b s^2 + c s^3 mL if the displacement is multiplied by
 * s. It has one mode, whose weight is 1 in any direction. */
static supine_basis *open_cubic(double a, double b, double c, unsigned char **bytes) {
  fixture *f = fixture_create(5, 1, 0, 1, false, true, 1, 3);
  f->mode[0] = 1 / 0.28209479177387814;
  memset(f->linear, 0, 3 * sizeof *f->linear);
  memset(f->quadratic, 0, 3 * sizeof *f->quadratic);
  f->linear[0] = a;
  f->quadratic[0] = b;
  f->cubic[0] = c;
  supine_basis *basis = open_bytes(f, bytes);
  fixture_destroy(f);
  return basis;
}

TEST(test_scale_cubic_volume_gives_root_connected_to_zero) {
  static const struct {
    /* `scale` is the s that solves a s + b s^2 + c s^3 = volume; NAN if the volume is refused. */
    double a, b, c, volume, scale;
  } cases[] = {
      {2, 0, 0, 10, 5},
      {2, 0, 0, -10, -5},
      {-2, 0, 0, 10, -5}, /* the displacement shrinks the lung */
      {0, 0, 0, 1, NAN},  /* the volume never changes */
      {0, 0, 1, 8, NAN},  /* refused: the polynomial s^3 has zero slope at s = 0 */
      {0, 0, 0, 0, 0},
      {2, 1, 0, 8, 2},        /* 2 s + s^2 = 8 at s = 2; s = -4 is beyond the minimum */
      {2, 1, 0, -0.75, -0.5}, /* 2 s + s^2 has the minimum -1 at s = -1 */
      {2, 1, 0, -1, -1},      /* the minimum of 2 s + s^2 */
      {2, 1, 0, -1.0001, NAN},
      {1, 0, 1, 10, 2}, /* s + s^3 = 10 at s = 2 */
      {1, 0, 1, -30, -3},
      {3, 0, -1, 2, 1},       /* 3 s - s^3 has the maximum 2 at s = 1; s = -2 also gives 2 */
      {3, 0, -1, 2.001, NAN}, /* 3 s - s^3 = 2.001 only near s = -2, beyond the minimum */
      {3, 0, -1, 1.375, 0.5},
      {6, -4.5, 1, 2.5, 1},       /* 6 s - 4.5 s^2 + s^3 has the maximum 2.5 at s = 1 */
      {6, -4.5, 1, 2.6, NAN},     /* 6 s - 4.5 s^2 + s^3 = 2.6 only beyond the minimum */
      {1e-300, 0, 0, 1e300, NAN}, /* the scale overflows */
      {1e-3, 0, 0, 1e3, 1e6},
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
      /* Where the slope is 0, the root is known only to the square root of epsilon. */
      assert_true(fabs(scale - cases[i].scale) <= 4e-8 * fabs(cases[i].scale));
    }
    supine_basis_close(basis);
    free(bytes);
  }
}

TEST(test_scale_not_finite_volume_refused) {
  unsigned char *bytes = NULL;
  supine_basis *basis = open_cubic(2, 0, 0, &bytes);
  const double one = 1;
  const double bad = NAN;
  double scale = 0;
  assert_int_equal(posed_scale(basis, &one, NAN, &scale, NULL), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(posed_scale(basis, &one, INFINITY, &scale, NULL), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(posed_scale(basis, &bad, 1, &scale, NULL), SUPINE_ERROR_ARGUMENT);
  supine_basis_close(basis);
  free(bytes);
}

/* A lung that hardly changes its volume on the way to rest would need very many steps. */
TEST(test_volume_form_gains_tiny_rest_refused) {
  static const supine_volume_form form = {{-300, -600, -700, 50, 40, 30, -5}};
  static const double bend[3] = {0, -0.45, 0.45};
  static const double tiny[] = {-1e-300, -1e-9, 1e-300, -1};
  for (size_t i = 0; i < sizeof tiny / sizeof *tiny; ++i) {
    double gains[3];
    supine_error error = {0};
    assert_int_equal(supine_volume_form_gains(&form, bend, tiny[i], -900, gains, &error),
                     SUPINE_ERROR_NUMERICAL);
  }
}

TEST(test_volume_form_gains_not_finite_refused) {
  static const double bend[3] = {0, -0.45, 0.45};
  static const double wrong[] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
    supine_volume_form form = {{-300, -600, -700, 50, 40, 30, -5}};
    const double bad_bend[3] = {0, wrong[i], 0};
    double gains[3];
    assert_int_equal(supine_volume_form_gains(&form, bend, -800, wrong[i], gains, NULL),
                     SUPINE_ERROR_ARGUMENT);
    assert_int_equal(supine_volume_form_gains(&form, bend, wrong[i], -900, gains, NULL),
                     SUPINE_ERROR_ARGUMENT);
    assert_int_equal(supine_volume_form_gains(&form, bad_bend, -800, -900, gains, NULL),
                     SUPINE_ERROR_ARGUMENT);
    form.of[3] = wrong[i];
    assert_int_equal(supine_volume_form_gains(&form, bend, -800, -900, gains, NULL),
                     SUPINE_ERROR_ARGUMENT);
  }
}

TEST(test_pose_open_surface_refused) {
  fixture *f = fixture_create(9, 3, 1, 1, false, false, 9, 5);
  unsigned char *bytes = NULL;
  supine_basis *basis = open_bytes(f, &bytes);
  const supine_state scan = {.gravity = {0, 1, 0}, .volume = {SUPINE_VOLUME_SCAN, 10}};
  supine_pose pose;
  supine_error error;
  assert_int_equal(supine_basis_pose(basis, &scan, &pose, &error), SUPINE_ERROR_OPEN_SURFACE);
  assert_says(error.message, "close the mesh");
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

/* Change of volume of a box that holds 3000 mL at full inflation, from the gains on its axes. A
 * gain of -1 shortens the side along x by 20 %, along y by 25 %, and along z by 30 %. */
static const supine_volume_form box_form = {{3000 * 0.2, 3000 * 0.25, 3000 * 0.3, 3000 * 0.25 * 0.3,
                                             3000 * 0.2 * 0.3, 3000 * 0.2 * 0.25,
                                             3000 * 0.2 * 0.25 * 0.3}};
static const double box_bend[3] = {0, -0.45, 0.45};

static double box_volume(const double *gains) {
  return 3000 * ((1 + 0.2 * gains[0]) * (1 + 0.25 * gains[1]) * (1 + 0.3 * gains[2]) - 1);
}

TEST(test_volume_form_gains_any_volume_reached_on_path) {
  const double rest = box_volume((double[]){-1, -1, -1});
  double last[3] = {1, 1, 1};
  for (double part = -0.3; part < 1.5; part += 0.1) {
    double gains[3];
    assert_int_equal(supine_volume_form_gains(&box_form, box_bend, rest, part * rest, gains, NULL),
                     SUPINE_OK);
    assert_true(fabs(box_volume(gains) - part * rest) <= 1e-9);
    /* `box_bend` makes the gain along x the mean of the gains along y and z. */
    assert_true(fabs(gains[1] + gains[2] - 2 * gains[0]) <= 1e-12);
    for (size_t axis = 0; axis < 3; ++axis) {
      assert_true(gains[axis] < last[axis]);
      last[axis] = gains[axis];
    }
  }
}

TEST(test_volume_form_gains_at_rest_equal_on_all_axes) {
  const double rest = box_volume((double[]){-1, -1, -1});
  double gains[3];
  assert_int_equal(supine_volume_form_gains(&box_form, box_bend, rest, rest, gains, NULL),
                   SUPINE_OK);
  for (size_t axis = 0; axis < 3; ++axis) {
    assert_true(fabs(gains[axis] + 1) <= 1e-14);
  }
}

/* As the volume changes, the factors on the displacement along x, y and z change in the ratio 1 :
 * 0.1 : 1.9 at rest, and 1 : 1.45 : 0.55 at full inflation. */
TEST(test_volume_bend_path_has_stated_slopes) {
  static const double stated[2][3] = {{1, 1.45, 0.55}, {1, 0.1, 1.9}};
  for (size_t end = 0; end < 2; ++end) {
    /* At full inflation and at rest, the derivative is the same from both sides. */
    for (int side = -1; side <= 1; side += 2) {
      double at[3];
      double near[3];
      supine_volume_bend(box_bend, (double)end, at);
      supine_volume_bend(box_bend, (double)end + side * 1e-6, near);
      for (size_t axis = 0; axis < 3; ++axis) {
        assert_true(at[axis] == (double)end);
        assert_true(fabs((near[axis] - at[axis]) / (side * 1e-6) - stated[end][axis]) <= 1e-5);
      }
    }
  }
}

/* The factors along y and z have literal values for three factors along x: beyond full inflation,
 * between full inflation and rest, and below rest. */
TEST(test_volume_bend_path_has_stated_values) {
  static const double at[][3] = {
      {-0.2, -0.2864, -0.1136}, {0.4, 0.5512, 0.2488}, {1.3, 1.244062423021089, 1.355937576978911}};
  for (size_t i = 0; i < 3; ++i) {
    double ratio[3];
    supine_volume_bend(box_bend, at[i][0], ratio);
    assert_true(fabs(ratio[0] - at[i][0]) <= 1e-15);
    assert_true(fabs(ratio[1] - at[i][1]) <= 1e-15 && fabs(ratio[2] - at[i][2]) <= 1e-15);
  }
}

TEST(test_volume_form_gains_straight_path_equal_on_all_axes) {
  static const double straight[3] = {0, 0, 0};
  double gains[3];
  assert_int_equal(supine_volume_form_gains(&box_form, straight, 0, -900, gains, NULL), SUPINE_OK);
  assert_true(gains[0] == gains[1] && gains[1] == gains[2]);
  assert_true(fabs(box_volume(gains) + 900) <= 1e-9);
}

TEST(test_volume_form_gains_out_of_reach_refused) {
  const double rest = box_volume((double[]){-1, -1, -1});
  double gains[3];
  supine_error error = {0};
  assert_int_equal(supine_volume_form_gains(&box_form, box_bend, rest, -3100, gains, &error),
                   SUPINE_ERROR_NUMERICAL);
  assert_says(error.message, "3100 mL less than in the reference surface is out of reach");
  assert_int_equal(supine_volume_form_gains(&box_form, box_bend, 0, -10, gains, &error),
                   SUPINE_ERROR_NUMERICAL);
}
