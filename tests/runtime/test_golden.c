/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Basis files of every version of the format stay readable. */
#include "tests/helpers/test.h"

#include <supine/runtime.h>

#include "tests/helpers/poses.h"

/* Assert that a basis file gives the same results as in version 0.1.0. The golden files of all
 * versions of the format hold the same synthetic lungs. */
static void check_golden(const char *path, const char *version, const char *checksum) {
  supine_basis *basis = NULL;
  supine_error error = {0};
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  if (supine_basis_open_with(path, &exact, &basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  const supine_basis_info *info = supine_basis_get_info(basis);
  assert_string_equal(supine_basis_metadata(basis, "version"), version);
  assert_string_equal(supine_basis_metadata(basis, "checksum"), checksum);
  assert_string_equal(supine_basis_metadata(basis, "rest_volume_ml"), "1133.539,1366.461");
  assert_string_equal(supine_basis_metadata(basis, "error_rms_percent"), "0.247566");
  assert_int_equal(info->vertex_count, 324);
  assert_int_equal(info->triangle_count, 640);
  assert_int_equal(info->mode_count, 4);
  assert_int_equal(info->band, 23);
  assert_int_equal(info->lung_count, 2);
  assert_int_equal(info->lung_begin[1], 162);
  assert_string_equal(info->lung_names[0], "left");
  assert_string_equal(info->lung_names[1], "right");
  assert_true(info->has_volume && !info->vector);
  const double gravity[3] = {0.6, 0.48, -0.64};
  double weights[4];
  double scales[2];
  float xyz[3 * 324];
  assert_int_equal(supine_basis_weights(basis, gravity, weights), SUPINE_OK);
  assert_int_equal(posed_scale(basis, weights, 350, &scales[0], NULL), SUPINE_OK);
  scales[1] = scales[0];
  supine_deform(basis, POSED(basis, weights, scales), xyz);
  static const struct {
    size_t vertex;
    double at[3];
  } want[] = {{0, {41.0611343, -49.5376053, -74.8942413}},
              {7, {72.0457611, -52.100502, -164.14653}},
              {199, {-71.3977737, -81.3643646, -43.8386459}},
              {323, {-10.6758051, -91.2364197, -76.6827545}}};
  for (size_t i = 0; i < sizeof want / sizeof *want; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const double x = (double)xyz[3 * want[i].vertex + axis];
      assert_true(fabs(x - want[i].at[axis]) <= 1e-5); /* the spacing of floats near 100 mm */
    }
  }
  supine_basis_close(basis);
}

TEST(test_open_version_1_same_numbers) {
  check_golden(SUPINE_GOLDEN "/basis_1.safetensors", "1", "09c82e877f967eaf");
}

TEST(test_open_version_2_same_numbers) {
  check_golden(SUPINE_GOLDEN "/basis_2.safetensors", "2", "xxh64:3898f5ec94e2adbe");
}
