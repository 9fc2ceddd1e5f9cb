/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Real pairs at rest in six postures: what turning a patient must and must not do, nothing of which
 * the model was fitted to. */
#include "precompute/precompute.h"
#include "test.h"

#include "lungs_helpers.h"
#include "tests/postures.h"

enum { SUPINE, PRONE, LEFT, RIGHT, UPRIGHT };

static void check_pair(const char *left, const char *right, supine_axes axes) {
  const char *const names[] = {left, right};
  static const supine_scan full = {true, {.gravity = {0, 1, 0}, .volume = {SUPINE_VOLUME_FULL, 0}}};
  const supine_resting resting = supine_reference_resting_default();
  supine_precompute_options options = {
      .model = supine_physics_model(SUPINE_LAW_DEEP), .band = 23, .modes = 16, .held_out = 20};
  supine_lungs lungs = {0};
  supine_reference reference;
  supine_precompute_report report;
  supine_error error = {0};
  supine_basis *basis = NULL;
  posture_figures f[POSTURE_COUNT];
  char path[] = "/tmp/supine-postures-XXXXXX";
  if (!helper_real_lungs(names, 2, axes, &lungs)) {
    skip();
  }
  const int file = mkstemp(path);
  assert_true(file >= 0 && close(file) == 0);
  assert_int_equal(
      supine_reference_find(&lungs, &options.model, &full, &resting, &reference, &error),
      SUPINE_OK);
  options.reference = &reference;
  if (supine_precompute(&lungs, &options, path, &report, &error) != SUPINE_OK ||
      supine_basis_open(path, &basis, &error) != SUPINE_OK ||
      postures_measure(basis, f, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  for (int p = 0; p < POSTURE_COUNT; ++p) {
    printf("%s: mean %.1f mm, left %+.1f %%, right %+.1f %%, turned over %.4f %%, %.2f\n",
           posture_figure_names[p], f[p].move_mean, 100.0 * f[p].change[0], 100.0 * f[p].change[1],
           100.0 * f[p].turned_over, f[p].dependent);
    assert_true(f[p].turned_over < 0.0005);
  }
  assert_true(f[PRONE].move_mean > 6.0 && f[PRONE].move_mean < 20.0);
  assert_true(f[PRONE].move_base > 2.0 * f[PRONE].move_top);
  assert_true(f[LEFT].change[0] > -0.10 && f[LEFT].change[0] < 0.10);
  assert_true(f[LEFT].change[1] > 0.08 && f[LEFT].change[1] < 0.36);
  assert_true(f[RIGHT].change[1] > -0.10 && f[RIGHT].change[1] < 0.10);
  assert_true(f[RIGHT].change[0] > 0.08 && f[RIGHT].change[0] < 0.36);
  /* the lower lung is smaller and takes more of the breath than supine */
  assert_true(f[LEFT].breath[0] > f[SUPINE].breath[0] && f[RIGHT].breath[1] > f[SUPINE].breath[1]);
  assert_true(f[UPRIGHT].dependent < 3.0);
  assert_true(f[PRONE].dependent < f[SUPINE].dependent && f[PRONE].dependent < 1.5);
  supine_basis_close(basis);
  supine_lungs_free(&lungs);
  assert_int_equal(unlink(path), 0);
}

static void test_adult_turns_as_published(void **state) {
  (void)state;
  check_pair("lungs/chaste_left.ply", "lungs/chaste_right.ply", SUPINE_AXES_AUTO);
}

static void test_001_turns_as_published(void **state) {
  (void)state;
  check_pair("covid/covid001_left.ply", "covid/covid001_right.ply", SUPINE_AXES_RAS);
}

static void test_002_turns_as_published(void **state) {
  (void)state;
  check_pair("covid/covid002_left.ply", "covid/covid002_right.ply", SUPINE_AXES_RAS);
}

static void test_005_turns_as_published(void **state) {
  (void)state;
  check_pair("covid/covid005_left.ply", "covid/covid005_right.ply", SUPINE_AXES_RAS);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_adult_turns_as_published),
                                     cmocka_unit_test(test_001_turns_as_published),
                                     cmocka_unit_test(test_002_turns_as_published),
                                     cmocka_unit_test(test_005_turns_as_published)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
