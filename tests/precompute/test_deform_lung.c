/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that positions of a real lung with 16 harmonics err by at most the error bound of the
 * basis. */
#include "tests/helpers/test.h"

#include <supine/runtime.h>

#include "precompute/precompute.h"
#include "tests/helpers/basis_helpers.h"

#include "tests/helpers/lungs_helpers.h"

/* Compute positions in a pose in double precision, from the coefficients in the file. */
static void deform_exactly(const supine_basis_info *info, const supine_pose *pose, double *xyz) {
  for (size_t i = 0; i < info->vertex_count; ++i) {
    double amount = 0.0;
    for (size_t k = 0; k < info->mode_count; ++k) {
      amount += pose->weights[k] * (double)info->coefficients[i * info->mode_count + k];
    }
    for (size_t axis = 3 * i; axis < 3 * i + 3; ++axis) {
      xyz[axis] = (double)info->vertices[axis] +
                  pose->gains[0][axis % 3] * amount * (double)info->direction[axis];
    }
  }
}

TEST(test_deform_real_lung_every_path_within_stated_error) {
  static const char *const names[] = {"left.obj"};
  supine_lungs lungs = {0};
  if (!helper_real_lungs(names, 1, SUPINE_AXES_AUTO, &lungs)) {
    skip();
  }
  char path[] = "/tmp/supine-deform-XXXXXX";
  const int file = mkstemp(path);
  assert_true(file >= 0 && close(file) == 0);
  const supine_prepared prepared = {.source = {.lungs = lungs},
                                    .model = supine_physics_model(SUPINE_LAW_PAPER)};
  const supine_basis_choice choice = {.band = 3, .held_out = 5};
  assert_int_equal(helper_write_basis(path, &prepared, &choice, NULL, NULL), SUPINE_OK);
  supine_basis *bases[SUPINE_STORAGE_COUNT * SUPINE_SIMD_COUNT] = {NULL};
  for (int i = 0; i < SUPINE_STORAGE_COUNT * SUPINE_SIMD_COUNT; ++i) {
    const supine_basis_options how = {sizeof how,
                                      .storage = (supine_storage)(i / SUPINE_SIMD_COUNT),
                                      .simd = (supine_simd)(i % SUPINE_SIMD_COUNT)};
    const supine_status status = supine_basis_open_with(path, &how, &bases[i], NULL);
    assert_true(status == SUPINE_OK || status == SUPINE_ERROR_UNSUPPORTED);
  }
  assert_int_equal(unlink(path), 0);
  const supine_basis_info *chosen = supine_basis_get_info(bases[0]);
  double *exact = malloc(3 * chosen->vertex_count * sizeof *exact);
  float *xyz = malloc(3 * chosen->vertex_count * sizeof *xyz);
  uint64_t seed = 1000;
  for (int trial = 0; trial < 200; ++trial) {
    supine_state breath = {.volume = {SUPINE_VOLUME_SCAN, 500.0}};
    supine_pose pose;
    random_direction(&seed, breath.gravity);
    assert_int_equal(supine_basis_pose(bases[0], &breath, &pose, NULL), SUPINE_OK);
    deform_exactly(chosen, &pose, exact);
    for (int b = 0; b < SUPINE_STORAGE_COUNT * SUPINE_SIMD_COUNT; ++b) {
      if (bases[b] == NULL) {
        continue;
      }
      double top = 0.0;
      supine_deform(bases[b], &pose, xyz);
      for (size_t i = 0; i < 3 * chosen->vertex_count; i += 3) {
        const double x = (double)xyz[i] - exact[i];
        const double y = (double)xyz[i + 1] - exact[i + 1];
        const double z = (double)xyz[i + 2] - exact[i + 2];
        top = fmax(top, sqrt(x * x + y * y + z * z));
      }
      assert_true(top <= supine_basis_error(bases[b], &pose));
      assert_true(b > 0 || top <= 0.005); /* only the default storage (b = 0) promises 0.005 mm */
    }
  }
  assert_int_equal(chosen->storage, SUPINE_STORAGE_INT16);
  assert_true(chosen->storage_error <= 0.005);
  for (int b = 0; b < SUPINE_STORAGE_COUNT * SUPINE_SIMD_COUNT; ++b) {
    supine_basis_close(bases[b]);
  }
  free(exact);
  free(xyz);
  supine_lungs_free(&lungs);
}
