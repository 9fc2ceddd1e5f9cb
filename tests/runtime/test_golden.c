/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Basis files that earlier versions wrote stay readable, and give the same positions. */
#include "tests/helpers/test.h"

#include <supine/runtime.h>

#include "tests/helpers/poses.h"

enum { VERTICES_MOST = 324 };

static const double gravity[3] = {0.6, 0.48, -0.64};

/* The position of a vertex, mm. */
typedef struct placed {
  size_t vertex;
  double at[3];
} placed;

/* Open a golden file without rounding the numbers of the file. */
static supine_basis *open_golden(const char *name, const char *checksum) {
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  char path[1024];
  supine_basis *basis = NULL;
  supine_error error = {0};
  (void)snprintf(path, sizeof path, "%s/%s.safetensors", SUPINE_GOLDEN, name);
  if (supine_basis_open_with(path, &exact, &basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  assert_string_equal(supine_basis_metadata(basis, "version"), "4");
  assert_string_equal(supine_basis_metadata(basis, "checksum"), checksum);
  return basis;
}

/* Assert that a pose moves four vertices to these positions. */
static void check_positions(const supine_basis *basis, const supine_pose *pose,
                            const placed want[4]) {
  float xyz[3 * VERTICES_MOST];
  assert_true(supine_basis_get_info(basis)->vertex_count <= VERTICES_MOST);
  assert_int_equal(supine_deform(basis, pose, xyz), SUPINE_OK);
  for (size_t i = 0; i < 4; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const double x = (double)xyz[3 * want[i].vertex + axis];
      /* the spacing of floats near 100 mm */
      assert_close(x, want[i].at[axis], 1e-5 + 1e-7 * fabs(want[i].at[axis]));
    }
  }
}

/* Assert that the state of `gravity` with 25 mL more than the scan gives these positions. */
static void check_state(const supine_basis *basis, const placed want[4]) {
  const supine_state state = {.gravity = {gravity[0], gravity[1], gravity[2]},
                              .volume = {SUPINE_VOLUME_SCAN, 25}};
  supine_pose pose;
  assert_int_equal(supine_basis_pose(basis, &state, &pose, NULL), SUPINE_OK);
  check_positions(basis, &pose, want);
}

/* The lungs of version 0.1.0: scalars, volumes, no volumes at rest and no normals. */
TEST(test_open_golden_lungs_same_numbers) {
  static const placed want[4] = {{0, {41.0611343, -49.5376053, -74.8942413}},
                                 {7, {72.0457611, -52.100502, -164.14653}},
                                 {199, {-71.3977737, -81.3643646, -43.8386459}},
                                 {323, {-10.6758051, -91.2364197, -76.6827545}}};
  supine_basis *basis = open_golden("basis_lungs", "xxh64:b96d623ec81c317d");
  const supine_basis_info *info = supine_basis_get_info(basis);
  assert_string_equal(supine_basis_metadata(basis, "rest_volume_ml"), "1133.539,1366.461");
  assert_string_equal(supine_basis_metadata(basis, "error_rms_percent"), "0.247566");
  assert_int_equal(info->vertex_count, 324);
  assert_int_equal(info->triangle_count, 640);
  assert_int_equal(info->mode_count, 4);
  assert_int_equal(info->band, 23);
  assert_int_equal(info->order, 0);
  assert_int_equal(info->lung_count, 2);
  assert_int_equal(info->lung_begin[1], 162);
  assert_string_equal(info->lung_names[0], "left");
  assert_string_equal(info->lung_names[1], "right");
  assert_true(info->has_volume && !info->vector && !info->has_rest && info->normal_count == 0);
  double weights[4];
  double scales[2];
  assert_int_equal(supine_basis_weights(basis, gravity, weights), SUPINE_OK);
  assert_int_equal(posed_scale(basis, weights, 350, &scales[0], NULL), SUPINE_OK);
  scales[1] = scales[0];
  check_positions(basis, POSED(basis, weights, scales), want);
  supine_basis_close(basis);
}

/* Scalars with volumes, volumes at rest, a curved path and normals. */
TEST(test_open_golden_scalar_same_numbers) {
  static const placed want[4] = {{0, {-4.26374722, 0, -2.76780367}},
                                 {7, {-75.1500015, 89.287384, 3.70753646}},
                                 {31, {144.252045, 19.8546886, 5.55485487}},
                                 {59, {75.1500015, 3.11107922, 131.699997}}};
  supine_basis *basis = open_golden("basis_scalar", "xxh64:e983a7e5796abc06");
  const supine_basis_info *info = supine_basis_get_info(basis);
  assert_true(info->has_volume && !info->vector && info->has_rest);
  assert_int_equal(info->normal_count, 6);
  assert_close(info->bend[1], -0.45, 0);
  check_state(basis, want);
  supine_basis_close(basis);
}

/* An open surface: scalars with normals, without volumes. */
TEST(test_open_golden_open_surface_same_numbers) {
  static const placed want[4] = {{0, {30, -90, -100}},
                                 {7, {54.0719604, -108.280441, -109.138016}},
                                 {31, {30, -96.1285019, -127.883278}},
                                 {99, {106.512466, -93.5640564, -217.099762}}};
  supine_basis *basis = open_golden("open_surface", "xxh64:1e31717d21bb11fa");
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_pose pose = {.basis = 0};
  assert_true(!info->has_volume && !info->vector && !info->has_rest);
  assert_int_equal(info->normal_count, 15);
  assert_int_equal(supine_basis_weights(basis, gravity, pose.weights), SUPINE_OK);
  supine_pose_fill(&pose, 3);
  check_positions(basis, &pose, want);
  supine_basis_close(basis);
}

/* Vectors with volumes alone. */
TEST(test_open_golden_vector_same_numbers) {
  static const placed want[4] = {{0, {-4.0665884, -0.0734490231, 1.15151441}},
                                 {7, {-75.5676498, 90.1080551, 2.90620208}},
                                 {31, {143.430969, 17.7063332, 2.6963582}},
                                 {59, {75.1374512, 1.87561429, 133.618011}}};
  supine_basis *basis = open_golden("basis_vector", "xxh64:3dcd52f6cddac520");
  const supine_basis_info *info = supine_basis_get_info(basis);
  assert_true(info->has_volume && info->vector && !info->has_rest && info->normal_count == 0);
  check_state(basis, want);
  supine_basis_close(basis);
}

TEST(test_open_golden_clusters_same_numbers) {
  static const placed want[4] = {{0, {-11.1195602, 9.75254726, 25.1488628}},
                                 {7, {-86.0509796, 86.0857468, 2.95210767}},
                                 {31, {120.175407, 25.56003, -6.72025299}},
                                 {59, {46.7148705, -7.8431344, 114.233932}}};
  supine_basis *basis = open_golden("basis_clusters", "xxh64:a87679da59303d43");
  const supine_basis_info *info = supine_basis_get_info(basis);
  assert_int_equal(info->cluster_count, 7);
  check_state(basis, want);
  supine_basis_close(basis);
}

/* Fields over gravity and volume, with volumes at rest and at full inflation. */
TEST(test_open_golden_simulated_same_numbers) {
  static const placed want[4] = {{0, {-4.29148197, 0, -1.16946018}},
                                 {7, {-68.7470551, 89.0993271, 4.1488862}},
                                 {31, {145.699066, 19.8385258, 6.85901594}},
                                 {59, {75.3733215, 3.1088407, 132.075592}}};
  supine_basis *basis = open_golden("basis_simulated", "xxh64:93b05ff22a7577c8");
  const supine_basis_info *info = supine_basis_get_info(basis);
  assert_int_equal(info->order, 2);
  assert_true(info->is_fields && info->has_rest && info->has_full);
  check_state(basis, want);
  supine_basis_close(basis);
}
