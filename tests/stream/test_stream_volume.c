/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the judgement of volumes, and volumes of a breath. */
#include "program/stream/tracked_patient.h"
#include "tests/helpers/runtime_fixture.h"
#include "tests/helpers/test.h"

static void expect_volume(const supine_stream_volume *volume, const supine_basis *basis,
                          const double gravity[3], double time, supine_volume wanted) {
  const supine_state at = supine_stream_volume_at(volume, basis, gravity, time);
  assert_memory_equal(at.gravity, gravity, sizeof at.gravity);
  assert_int_equal(at.volume.kind, wanted.kind);
  assert_true(at.volume.ml == wanted.ml);
}

TEST(test_volume_judge_and_breath_equal_library) {
  fixture *made = fixture_create(200, 4, 2, 2, false, true, 10.0, 5);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(made, &size);
  supine_basis *basis = NULL;
  supine_error error;
  assert_int_equal(supine_basis_open_memory(bytes, size, &basis, &error), SUPINE_OK);
  supine_stream_volume *volume = fixture_allocate(1, sizeof *volume);
  const double gravity[3] = {0, 1, 0};
  *volume = (supine_stream_volume){.fixed = {.volume = {SUPINE_VOLUME_SCAN, 40.0}}};
  assert_int_equal(supine_stream_volume_judge(volume, basis, gravity, NULL, &error), SUPINE_OK);
  expect_volume(volume, basis, gravity, 1.0, (supine_volume){SUPINE_VOLUME_SCAN, 40.0});
  static const double wrong[] = {NAN, INFINITY, -1e300};
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
    volume->fixed.volume.ml = wrong[i];
    assert_int_equal(supine_stream_volume_judge(volume, basis, gravity, NULL, &error),
                     SUPINE_ERROR_ARGUMENT);
  }
  /* The volume follows the breathing model, within a thousandth of the tidal volume. */
  const supine_pv_breath breath = supine_breath_default();
  assert_int_equal(supine_stream_volume_breathe(volume, supine_breath_normal(), &breath, &error),
                   SUPINE_OK);
  for (int i = 0; i < 200; ++i) {
    const double time = 0.0731 * i;
    double wanted = 0.0;
    assert_int_equal(
        supine_breath_evaluate(supine_breath_normal(), &breath, 1, &time, &wanted, NULL, &error),
        SUPINE_OK);
    const supine_state at = supine_stream_volume_at(volume, basis, gravity, time);
    assert_int_equal(at.volume.kind, SUPINE_VOLUME_SCAN); /* this basis has no rest volumes */
    assert_true(fabs(at.volume.ml - wanted) < 1e-3 * breath.tidal);
  }
  const supine_pv_breath none = {.tidal = -1.0, .rate = 12.0, .inhale_fraction = 0.3};
  assert_int_equal(supine_stream_volume_breathe(volume, supine_breath_normal(), &none, &error),
                   SUPINE_ERROR_ARGUMENT);
  free(volume);
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(made);
}

TEST_GROUP(NULL, NULL)
