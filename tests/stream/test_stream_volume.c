/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test volumes given as text, and volumes of a breath. */
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

TEST(test_volume_parse_each_form_literal) {
  fixture *made = fixture_create(200, 4, 2, 2, false, true, 10.0, 5);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(made, &size);
  supine_basis *basis = NULL;
  supine_error error;
  assert_int_equal(supine_basis_open_memory(bytes, size, &basis, &error), SUPINE_OK);
  supine_stream_volume *volume = fixture_allocate(1, sizeof *volume);
  const double gravity[3] = {0, 1, 0};
  static const struct {
    const char *text;
    supine_volume volume;
  } good[] = {
      {"rest", {SUPINE_VOLUME_REST, 0}},          {"rest+350", {SUPINE_VOLUME_REST, 350}},
      {"rest-20.5", {SUPINE_VOLUME_REST, -20.5}}, {"full", {SUPINE_VOLUME_FULL, 0}},
      {"full-1200", {SUPINE_VOLUME_FULL, -1200}}, {"2600mL", {SUPINE_VOLUME_ABSOLUTE, 2600}},
      {"scan+40", {SUPINE_VOLUME_SCAN, 40}}};
  for (size_t i = 0; i < sizeof good / sizeof *good; ++i) {
    assert_int_equal(supine_stream_volume_fix(volume, good[i].text, &error), SUPINE_OK);
    expect_volume(volume, basis, gravity, 1.0, good[i].volume);
  }
  static const char *const bad[] = {"",    "rest 5", "rest+", "rest+x",   "fuller",
                                    "nan", "inf",    "5 mL",  "rest+inf", "restful",
                                    "500", "+40",    "-1200", "0"};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    assert_int_equal(supine_stream_volume_fix(volume, bad[i], &error), SUPINE_ERROR_ARGUMENT);
    /* The refused text `bad[i]` leaves the volume that the last good text has set. */
    expect_volume(volume, basis, gravity, 1.0, good[6].volume);
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
