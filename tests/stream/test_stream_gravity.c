/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test directions of gravity from trackers' matrices and quaternions, refused poses. */
#include "base/vec3.h"
#include "program/stream/gravity.h"
#include "tests/helpers/test.h"
#include <supine/posture.h>

/* several times the rounding error of a 32-bit float */
static const double tolerance = 1e-6;

static void expect_gravity(const double gravity[3], const char *posture) {
  double wanted[3];
  assert_int_equal(supine_posture_gravity(posture, wanted), SUPINE_OK);
  for (int i = 0; i < 3; ++i) {
    assert_true(fabs(gravity[i] - wanted[i]) < tolerance);
  }
}

/* A posture, and the directions of the body's left, back and head in a room: the columns of a
 * tracker's matrix. In the room z is up, y points from the foot end to the head end of a bed, and x
 * to the right of someone who stands at the foot end and looks towards the head end. */
typedef struct placement {
  const char *posture;
  double left[3], back[3], head[3];
} placement;

static const placement placements[] = {
    /* Head at the head end of the bed, face up: seen from the feet, the patient's left is on the
     * right. */
    {"supine", {1, 0, 0}, {0, 0, -1}, {0, 1, 0}},
    /* Head at the head end of the bed, face down: seen from the feet, the patient's left is on the
     * left. */
    {"prone", {-1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
    /* Lying on the left side: the patient's left points down, and the back points to -x. */
    {"left", {0, 0, -1}, {-1, 0, 0}, {0, 1, 0}},
    /* Lying on the right side: the patient's left points up, and the back points to +x. */
    {"right", {0, 0, 1}, {1, 0, 0}, {0, 1, 0}},
    /* Head at the foot end of the bed: the four postures above, turned by 180 degrees about z. */
    {"supine", {-1, 0, 0}, {0, 0, -1}, {0, -1, 0}},
    {"prone", {1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
    {"left", {0, 0, -1}, {1, 0, 0}, {0, -1, 0}},
    {"right", {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}},
    /* Lying on the back across the bed, with the head towards -x. */
    {"supine", {0, 1, 0}, {0, 0, -1}, {-1, 0, 0}},
    {"upright", {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
    {"inverted", {1, 0, 0}, {0, -1, 0}, {0, 0, -1}}, /* head down */
};

enum { PLACEMENTS = sizeof placements / sizeof *placements };

static void matrix_of(const placement *l, double r[9]) {
  for (int i = 0; i < 3; ++i) {
    r[3 * i] = l->left[i];
    r[3 * i + 1] = l->back[i];
    r[3 * i + 2] = l->head[i];
  }
}

static double determinant(const double m[9]) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
         m[2] * (m[3] * m[7] - m[4] * m[6]);
}

static supine_stream_verdict take(const double r[9], double gravity[3]) {
  const supine_stream_setup setup = supine_stream_setup_default();
  const char *why = NULL;
  const supine_stream_verdict verdict = supine_stream_gravity_rotation(&setup, r, gravity, &why);
  assert_true((why == NULL) == (verdict == SUPINE_STREAM_EXACT));
  return verdict;
}

TEST(test_gravity_tracker_matrices_give_postures) {
  for (int i = 0; i < PLACEMENTS; ++i) {
    double r[9];
    double gravity[3];
    matrix_of(&placements[i], r);
    assert_true(fabs(determinant(r) - 1.0) < tolerance);
    assert_int_equal(take(r, gravity), SUPINE_STREAM_EXACT);
    expect_gravity(gravity, placements[i].posture);
  }
}

/* A quaternion and its negative give the same posture. */
TEST(test_gravity_tracker_quaternions_give_postures) {
  static const struct {
    const char *posture;
    double q[4]; /* from upright: cos(angle / 2), then sin(angle / 2) times the unit axis */
  } turns[] = {
      {"upright", {1, 0, 0, 0}},
      /* rotated about x by -90 degrees (backwards) or 90 degrees (forwards) */
      {"supine", {0.7071067811865476, -0.7071067811865476, 0, 0}},
      {"prone", {0.7071067811865476, 0.7071067811865476, 0, 0}},
      /* about y by 90 degrees (head to x) or -90 degrees (head to -x), or about x by 180 degrees */
      {"left", {0.7071067811865476, 0, 0.7071067811865476, 0}},
      {"right", {0.7071067811865476, 0, -0.7071067811865476, 0}},
      {"inverted", {0, 1, 0, 0}},
      {"supine", {0.5, -0.5, -0.5, 0.5}}, /* about x by -90 degrees, then about z by 90 degrees */
  };
  for (size_t i = 0; i < sizeof turns / sizeof *turns; ++i) {
    for (int sign = -1; sign < 2; sign += 2) {
      double q[4];
      double r[9];
      double gravity[3];
      for (int k = 0; k < 4; ++k) {
        q[k] = sign * turns[i].q[k];
      }
      supine_quaternion_matrix(q, r);
      assert_int_equal(take(r, gravity), SUPINE_STREAM_EXACT);
      expect_gravity(gravity, turns[i].posture);
    }
  }
}

/* In this world y is up; the marker's axes point to the patient's right, front and head. */
TEST(test_gravity_setup_rotates_world_and_marker) {
  supine_stream_setup setup = {.down = {0, -1, 0}};
  const double half_turn[4] = {0, 0, 0, 1};
  supine_quaternion_matrix(half_turn, setup.body);
  /* The patient lies on the back: the marker's x, y, z axes point along -z, y, x of the world. */
  const double r[9] = {0, 0, 1, 0, 1, 0, -1, 0, 0};
  double gravity[3];
  const char *why = NULL;
  assert_true(fabs(determinant(r) - 1.0) < tolerance);
  assert_int_equal(supine_stream_gravity_rotation(&setup, r, gravity, &why), SUPINE_STREAM_EXACT);
  expect_gravity(gravity, "supine");
  /* A tilt sensor has the axes of the marker on the patient. It reports a vector of any length that
   * points to the ground. If this vector points to the patient's right, the patient lies on it. */
  const double down[3] = {3, 0, 0};
  assert_int_equal(supine_stream_gravity_down(&setup, down, gravity, &why), SUPINE_STREAM_EXACT);
  expect_gravity(gravity, "right");
}

static void scaled(const double r[9], double x, double y, double z, double out[9]) {
  const double s[3] = {x, y, z};
  for (int i = 0; i < 9; ++i) {
    out[i] = r[i] * s[i % 3];
  }
}

TEST(test_gravity_invalid_rotations_refused) {
  for (int i = 0; i < PLACEMENTS; ++i) {
    double r[9];
    double m[9];
    double gravity[3];
    matrix_of(&placements[i], r);
    scaled(r, 1.0001, 0.9999, 1.0, m); /* a small rounding error */
    assert_int_equal(take(m, gravity), SUPINE_STREAM_EXACT);
    scaled(r, 25.4, 25.4, 25.4, m); /* a uniform scale, as if lengths were in other units */
    assert_int_equal(take(m, gravity), SUPINE_STREAM_REPAIRED);
    expect_gravity(gravity, placements[i].posture);
    scaled(r, 1.0, 1.0, 1.05, m);
    assert_int_equal(take(m, gravity), SUPINE_STREAM_REPAIRED);
    expect_gravity(gravity, placements[i].posture);
    const double kept[3] = {gravity[0], gravity[1], gravity[2]};
    scaled(r, 1.0, 1.0, 1.5, m);
    assert_int_equal(take(m, gravity), SUPINE_STREAM_REFUSED);
    scaled(r, 1.0, 1.0, -1.0, m); /* a reflection */
    assert_int_equal(take(m, gravity), SUPINE_STREAM_REFUSED);
    scaled(r, -1.0, -1.0, -1.0, m);
    assert_int_equal(take(m, gravity), SUPINE_STREAM_REFUSED);
    scaled(r, 1.0, 1.0, 0.0, m);
    assert_int_equal(take(m, gravity), SUPINE_STREAM_REFUSED);
    scaled(r, 0.0, 0.0, 0.0, m);
    assert_int_equal(take(m, gravity), SUPINE_STREAM_REFUSED);
    for (int k = 0; k < 9; ++k) {
      scaled(r, 1, 1, 1, m);
      m[k] = k % 2 == 0 ? NAN : INFINITY;
      assert_int_equal(take(m, gravity), SUPINE_STREAM_REFUSED);
    }
    scaled(r, 1e300, 1e300, 1e300, m);
    assert_int_equal(take(m, gravity), SUPINE_STREAM_REFUSED);
    assert_memory_equal(gravity, kept, sizeof kept); /* a refused pose changes nothing */
  }
}

TEST(test_gravity_invalid_quaternions_and_vectors_refused) {
  const supine_stream_setup setup = supine_stream_setup_default();
  const double good[4] = {3, -3, 0, 0};
  const double bad[3][4] = {{0, 0, 0, 0}, {NAN, 0, 0, 0}, {1, INFINITY, 0, 0}};
  double r[9];
  double gravity[3] = {7, 7, 7};
  const char *why = NULL;
  for (int i = 0; i < 3; ++i) {
    supine_quaternion_matrix(bad[i], r);
    assert_int_equal(take(r, gravity), SUPINE_STREAM_REFUSED);
    assert_int_equal(supine_stream_gravity_down(&setup, bad[i], gravity, &why),
                     SUPINE_STREAM_REFUSED);
  }
  assert_true(gravity[0] == 7.0);
  supine_quaternion_matrix(good, r);
  assert_int_equal(take(r, gravity), SUPINE_STREAM_REPAIRED);
  expect_gravity(gravity, "supine");
}
