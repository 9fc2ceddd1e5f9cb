/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test directions of gravity from names of postures, rotations and tilts. */
#include <float.h>

#include "tests/helpers/test.h"

#include <supine/posture.h>

#include "base/vec3.h"

#include "tests/helpers/runtime_fixture.h"

static const double tolerance = 8 * DBL_EPSILON;

static void assert_vector(const double v[3], double x, double y, double z) {
  assert_true(fabs(v[0] - x) <= tolerance);
  assert_true(fabs(v[1] - y) <= tolerance);
  assert_true(fabs(v[2] - z) <= tolerance);
}

TEST(test_gravity_named_postures_literal) {
  static const struct {
    const char *name;
    double x, y, z;
  } cases[] = {
      {"supine", 0, 1, 0},       {"prone", 0, -1, 0},
      {"left", 1, 0, 0},         {"right", -1, 0, 0},
      {"left-lateral", 1, 0, 0}, {"right-lateral", -1, 0, 0},
      {"upright", 0, 0, -1},     {"inverted", 0, 0, 1},
      {"HFS", 0, 1, 0},          {"FFS", 0, 1, 0},
      {"HFP", 0, -1, 0},         {"FFP", 0, -1, 0},
      {"HFDL", 1, 0, 0},         {"FFDL", 1, 0, 0},
      {"HFDR", -1, 0, 0},        {"FFDR", -1, 0, 0},
      {"hfs", 0, 1, 0},          {"SUPINE", 0, 1, 0},
      {"LFP", 0, -1, 0},         {"LFS", 0, 1, 0},
      {"RFP", 0, -1, 0},         {"RFS", 0, 1, 0},
      {"AFDR", -1, 0, 0},        {"AFDL", 1, 0, 0},
      {"PFDR", -1, 0, 0},        {"PFDL", 1, 0, 0},
      {"ffDr", -1, 0, 0},        {"Right-Lateral", -1, 0, 0},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    double g[3] = {9, 9, 9};
    assert_int_equal(supine_posture_gravity(cases[i].name, g), SUPINE_OK);
    assert_vector(g, cases[i].x, cases[i].y, cases[i].z);
  }
}

TEST(test_gravity_unknown_name_refused_output_unchanged) {
  static const char *const names[] = {"", "supin", "supines", "HF", "left_lateral", " prone"};
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    double g[3] = {9, 8, 7};
    assert_int_equal(supine_posture_gravity(names[i], g), SUPINE_ERROR_ARGUMENT);
    assert_vector(g, 9, 8, 7);
  }
}

TEST(test_posture_name_every_index_known) {
  assert_int_equal(supine_posture_count(), 24);
  for (size_t i = 0; i < supine_posture_count(); ++i) {
    double g[3];
    assert_int_equal(supine_posture_gravity(supine_posture_name(i), g), SUPINE_OK);
    assert_string_equal(supine_posture_nearest(supine_posture_name(i)), supine_posture_name(i));
  }
  assert_null(supine_posture_name(supine_posture_count()));
}

TEST(test_nearest_misspelling_gives_name) {
  static const char *const cases[][2] = {
      {"suppine", "supine"},
      {"spuine", "supine"},
      {"pron", "prone"},
      {"lef", "left"},
      {"rigth", "right"},
      {"upwright", "upright"},
      {"invert", "inverted"},
      {"HFDD", "HFDL"},
      {"leftlateral", "left-lateral"},
      {"Right_Lateral", "right-lateral"},
      {"Sitting", "upright"},
      {"standing", "upright"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    assert_string_equal(supine_posture_nearest(cases[i][0]), cases[i][1]);
  }
  static const char *const far[] = {"", "Bauchlage", "decubitus", "xyz", "rest"};
  for (size_t i = 0; i < sizeof far / sizeof *far; ++i) {
    assert_null(supine_posture_nearest(far[i]));
  }
  char text[5000];
  memset(text, 'q', sizeof text - 1);
  text[sizeof text - 1] = '\0';
  assert_null(supine_posture_nearest(text));
}

/* Directions computed by hand, for an object that stands, faces forward without rotation, and then
 * is turned by 90 degrees. In Unreal Engine, FRotator(pitch 90) has the quaternion (h, 0, -h, 0),
 * and FRotator(roll 90), which lowers the right side, (h, -h, 0, 0). */
TEST(test_rotation_of_engines_literal) {
  const double h = sqrt(0.5);
  const struct {
    const char *axes;
    double up[3];
    double rotation[4]; /* W, X, Y, Z */
    double gravity[3];
  } cases[] = {
      {"lps", {0, 0, 1}, {1, 0, 0, 0}, {0, 0, -1}},
      {"lps", {0, 0, 1}, {h, -h, 0, 0}, {0, 1, 0}},
      {"lps", {0, 0, 1}, {h, h, 0, 0}, {0, -1, 0}},
      {"lps", {0, 0, 1}, {h, 0, h, 0}, {1, 0, 0}},
      {"lps", {0, 0, 1}, {-h, h, 0, 0}, {0, 1, 0}},
      {"lps", {0, 0, 1}, {h, 0, 0, h}, {0, 0, -1}},
      {"unity", {0, 1, 0}, {1, 0, 0, 0}, {0, 0, -1}},
      {"unity", {0, 1, 0}, {h, -h, 0, 0}, {0, 1, 0}},
      {"unity", {0, 1, 0}, {h, h, 0, 0}, {0, -1, 0}},
      {"unity", {0, 1, 0}, {h, 0, 0, h}, {1, 0, 0}},
      {"unity", {0, 1, 0}, {h, 0, 0, -h}, {-1, 0, 0}},
      {"unity", {0, 1, 0}, {h, 0, h, 0}, {0, 0, -1}},
      {"Unreal", {0, 0, 1}, {1, 0, 0, 0}, {0, 0, -1}},
      {"Unreal", {0, 0, 1}, {h, 0, -h, 0}, {0, 1, 0}},
      {"Unreal", {0, 0, 1}, {h, 0, h, 0}, {0, -1, 0}},
      {"Unreal", {0, 0, 1}, {h, h, 0, 0}, {1, 0, 0}},
      {"Unreal", {0, 0, 1}, {h, -h, 0, 0}, {-1, 0, 0}},
      {"Unreal", {0, 0, 1}, {h, 0, 0, h}, {0, 0, -1}},
      {"three", {0, 1, 0}, {1, 0, 0, 0}, {0, 0, -1}},
      {"three", {0, 1, 0}, {h, -h, 0, 0}, {0, 1, 0}},
      {"three", {0, 1, 0}, {h, h, 0, 0}, {0, -1, 0}},
      {"three", {0, 1, 0}, {h, 0, 0, -h}, {1, 0, 0}},
      {"three", {0, 1, 0}, {h, 0, 0, h}, {-1, 0, 0}},
      {"three", {0, 0, 1}, {h, h, 0, 0}, {0, 0, -1}},
      {"headset", {0, 1, 0}, {1, 0, 0, 0}, {0, 0, -1}},
      {"headset", {0, 1, 0}, {h, h, 0, 0}, {0, 1, 0}},
      {"headset", {0, 1, 0}, {h, -h, 0, 0}, {0, -1, 0}},
      {"headset", {0, 1, 0}, {h, 0, 0, h}, {1, 0, 0}},
      {"headset", {0, 1, 0}, {h, 0, 0, -h}, {-1, 0, 0}},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    double matrix[9];
    double g[3];
    const double *q = cases[i].rotation;
    const double *expected = cases[i].gravity;
    assert_int_equal(supine_posture_rotation(q, 4, cases[i].up, cases[i].axes, g, NULL), SUPINE_OK);
    assert_vector(g, expected[0], expected[1], expected[2]);
    supine_quaternion_matrix(q, matrix);
    assert_int_equal(supine_posture_rotation(matrix, 9, cases[i].up, cases[i].axes, g, NULL),
                     SUPINE_OK);
    assert_vector(g, expected[0], expected[1], expected[2]);
  }
}

/* Rotate v by the quaternion q: out = q v q*, written with cross products. */
static void rotate(const double q[4], const double v[3], double out[3]) {
  const double t[3] = {2 * (q[2] * v[2] - q[3] * v[1]), 2 * (q[3] * v[0] - q[1] * v[2]),
                       2 * (q[1] * v[1] - q[2] * v[0])};
  out[0] = v[0] + q[0] * t[0] + q[2] * t[2] - q[3] * t[1];
  out[1] = v[1] + q[0] * t[1] + q[3] * t[0] - q[1] * t[2];
  out[2] = v[2] + q[0] * t[2] + q[1] * t[1] - q[2] * t[0];
}

TEST(test_rotation_random_maps_gravity_to_world_down) {
  uint64_t random = 20080321;
  for (int i = 0; i < 1000; ++i) {
    double q[4];
    double square = 0;
    for (int j = 0; j < 4; ++j) {
      q[j] = fixture_random(&random);
      square += q[j] * q[j];
    }
    for (int j = 0; j < 4; ++j) {
      q[j] /= sqrt(square);
    }
    double g[3];
    const double up[3] = {0, 0, 3};
    assert_int_equal(supine_posture_rotation(q, 4, up, "lps", g, NULL), SUPINE_OK);
    double world[3];
    rotate(q, g, world);
    assert_vector(world, 0, 0, -1);
  }
}

static void expect_no_rotation(const double *rotation, size_t count, const double up[3],
                               const char *axes, const char *message) {
  double g[3] = {9, 8, 7};
  supine_error error;
  assert_int_equal(supine_posture_rotation(rotation, count, up, axes, g, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_non_null(strstr(error.message, message));
  assert_vector(g, 9, 8, 7);
}

TEST(test_rotation_not_rigid_mirrored_or_not_finite_refused) {
  const double up[3] = {0, 1, 0};
  const double unit[4] = {1, 0, 0, 0};
  const double mirrored[9] = {-1, 0, 0, 0, 1, 0, 0, 0, 1};
  const double sheared[9] = {1, 0.01, 0, 0, 1, 0, 0, 0, 1};
  expect_no_rotation((double[]){0, 0, 0, 0}, 4, up, "lps", "scale 0 instead of 1");
  expect_no_rotation((double[]){1, NAN, 0, 0}, 4, up, "lps", "scale ");
  expect_no_rotation((double[]){INFINITY, 0, 0, 0}, 4, up, "lps", "scale ");
  expect_no_rotation((double[]){1.001, 0, 0, 0}, 4, up, "lps", "scale 1.002 instead of 1");
  expect_no_rotation((double[]){1, 1, 0, 0}, 4, up, "unity", "Normalise the quaternion");
  expect_no_rotation(mirrored, 9, up, "unity", "scale -1 instead of 1 (mirrored)");
  expect_no_rotation(sheared, 9, up, "three", "shear 0.005");
  expect_no_rotation(unit, 3, up, "lps", "3 numbers: give a quaternion of 4 or a matrix of 9");
  expect_no_rotation(unit, 4, (double[]){0, 0, 0}, "lps", "up is zero");
  expect_no_rotation(unit, 4, (double[]){0, NAN, 1}, "lps", "up is zero or not finite");
  expect_no_rotation(unit, 4, up, "unty",
                     "no axes 'unty': give one of lps unity unreal three headset");
  /* What rounding to 32-bit floats leaves is a rotation. */
  double g[3];
  assert_int_equal(
      supine_posture_rotation((double[]){0.70710677f, -0.70710677f, 0, 0}, 4, up, "unity", g, NULL),
      SUPINE_OK);
  assert_vector(g, 0, 1, 0);
}

TEST(test_tilt_postures_literal) {
  const double c = 0.96592582628906831; /* cosine of 15 degrees, Abramowitz & Stegun 4.3.128 */
  const double s = 0.25881904510252074; /* sine of 15 degrees */
  double g[3] = {0, 1, 0};
  assert_int_equal(supine_posture_tilt(g, 15, g), SUPINE_OK);
  assert_vector(g, 0, c, s); /* Trendelenburg: the head is lower */
  assert_int_equal(supine_posture_tilt((double[]){0, -1, 0}, 15, g), SUPINE_OK);
  assert_vector(g, 0, -c, s);
  assert_int_equal(supine_posture_tilt((double[]){0, 0, -1}, 15, g), SUPINE_OK);
  assert_vector(g, 0, s, -c); /* leaning backwards */
  assert_int_equal(supine_posture_tilt((double[]){1, 0, 0}, 15, g), SUPINE_OK);
  assert_vector(g, c, 0, s); /* on the side too */
  assert_int_equal(supine_posture_tilt((double[]){-1, 0, 0}, -15, g), SUPINE_OK);
  assert_vector(g, -c, 0, -s);
  assert_int_equal(supine_posture_tilt((double[]){0, 1, 0}, 90, g), SUPINE_OK);
  assert_vector(g, 0, 0, 1);
  assert_int_equal(supine_posture_tilt((double[]){0, 1, 0}, 90.5, g), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_posture_tilt((double[]){0, 1, 0}, -500, g), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_posture_tilt((double[]){0, 1, 0}, NAN, g), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_posture_tilt((double[]){0, INFINITY, 0}, 1, g), SUPINE_ERROR_ARGUMENT);
}

TEST(test_roll_postures_literal) {
  const double c = 0.86602540378443865; /* cosine of 30 degrees */
  double g[3] = {0, 1, 0};
  assert_int_equal(supine_posture_roll(g, 30, g), SUPINE_OK);
  assert_vector(g, 0.5, c, 0); /* towards the left side */
  assert_int_equal(supine_posture_roll((double[]){0, 1, 0}, 90, g), SUPINE_OK);
  assert_vector(g, 1, 0, 0);
  assert_int_equal(supine_posture_roll((double[]){1, 0, 0}, 90, g), SUPINE_OK);
  assert_vector(g, 0, -1, 0);
  assert_int_equal(supine_posture_roll((double[]){0, 0, -1}, 30, g), SUPINE_OK);
  assert_vector(g, 0, 0, -1);
  assert_int_equal(supine_posture_roll((double[]){0, 1, 0}, 181, g), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_posture_roll((double[]){NAN, 1, 0}, 1, g), SUPINE_ERROR_ARGUMENT);
}
