/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine pv: exit codes and output. */
#include "test.h"

#include "program/options/pv.h"

#include "command_helpers.h"

static char folder[] = "/tmp/supine-pv-XXXXXX";
static char good[64], bad[64], out[64];
static char text[65536];

static void write_samples(const char *path, bool spoiled) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  (void)fputs("pressure_cmH2O,volume_mL\n", file);
  for (int j = 0; j <= 15; ++j) {
    const double pressure = 2.0 * j;
    double volume = 0.0;
    assert_int_equal(supine_breath_curve_evaluate(&supine_breath_normal()->limb[0], 1, &pressure,
                                                  &volume, NULL, NULL),
                     SUPINE_OK);
    (void)fprintf(file, "%.17g,%.17g\n", pressure, spoiled && j == 9 ? 0.0 : volume);
  }
  assert_int_equal(fclose(file), 0);
}

static int setup(void **state) {
  (void)state;
  if (mkdtemp(folder) == NULL) {
    return -1;
  }
  (void)snprintf(good, sizeof good, "%s/good.csv", folder);
  (void)snprintf(bad, sizeof bad, "%s/bad.csv", folder);
  (void)snprintf(out, sizeof out, "%s/out.csv", folder);
  write_samples(good, false);
  write_samples(bad, true);
  return 0;
}

static int teardown(void **state) {
  (void)state;
  (void)unlink(good);
  (void)unlink(bad);
  (void)unlink(out);
  return rmdir(folder);
}

#define RUN(kept, ...) COMMAND_RUN(&supine_command_pv, kept, text, __VA_ARGS__)

TEST(test_pv_fit_written_parameters_load) {
  assert_int_equal(RUN(KEPT_OUT, "fit", good, "-o", out), 0);
  assert_non_null(strstr(text, "\n  samples              16\n"));
  assert_null(strstr(text, "exhale")); /* its curve is the other limb's */
  supine_pv pv;
  assert_int_equal(supine_breath_load(out, &pv, NULL), SUPINE_OK);
  const double difference = pv.limb[1].control[1] - supine_breath_normal()->limb[0].control[1];
  assert_true(difference < 1e-6 && difference > -1e-6);
}

TEST(test_pv_fit_json_has_each_field) {
  assert_int_equal(RUN(KEPT_OUT, "fit", "--json", "--confidence", "0.5", good), 0);
  json_t *root = json_loads(text, 0, NULL);
  assert_true(json_real_value(json_object_get(root, "confidence")) == 0.5);
  assert_null(json_object_get(root, "exhale"));
  const json_t *limb = json_object_get(root, "inhale");
  assert_int_equal(json_integer_value(json_object_get(limb, "samples")), 16);
  assert_true(json_real_value(json_array_get(json_object_get(limb, "pressure_cmH2O"), 1)) == 30.0);
  static const char *const keys[] = {"control", "control_interval", "volume_interval_mL", "rms_mL",
                                     "rms_percent"};
  for (size_t i = 0; i < sizeof keys / sizeof *keys; ++i) {
    assert_non_null(json_object_get(limb, keys[i]));
  }
  json_decref(root);
}

TEST(test_pv_show_prints_curve) {
  assert_int_equal(RUN(KEPT_OUT, "show", "--step", "12.5"), 0);
  double cell[4][5];
  char *at = strchr(text, '\n');
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 5; ++column) {
      char *end = NULL;
      cell[row][column] = strtod(at + 1, &end);
      assert_true(end != at + 1);
      assert_int_equal(*end, column < 4 ? ',' : '\n');
      at = end;
    }
  }
  assert_string_equal(at, "\n");
  static const double pressures[4] = {0.0, 12.5, 25.0, 30.0};
  for (int row = 0; row < 4; ++row) {
    assert_true(cell[row][0] == pressures[row]);
  }
  assert_true(cell[0][1] == 0.0 && cell[3][1] == 6000.0); /* inhale, mL */
  assert_true(cell[1][3] > cell[1][1]);                   /* exhalation has more volume */
  assert_true(cell[0][4] > cell[3][4]);                   /* and compliance decreases */
}

TEST(test_pv_help_prints_usage) {
  assert_int_equal(RUN(KEPT_OUT, "--help"), 0);
  assert_non_null(strstr(text, "pressure_cmH2O,volume_mL,limb"));
  assert_non_null(strstr(text, "Examples:"));
}

static void expect_printed(const char *message) {
  if (strstr(text, message) == NULL) {
    fail_msg("\"%s\" has no \"%s\"", text, message);
  }
}

TEST(test_pv_failures_have_exit_codes) {
  assert_int_equal(RUN(KEPT_ERR, "fit"), 1);
  expect_printed("give 'fit FILE'");
  assert_int_equal(RUN(KEPT_ERR, "fit", good, bad), 1);
  assert_int_equal(RUN(KEPT_ERR, "draw", good), 1);
  expect_printed("not 'draw'");
  assert_int_equal(RUN(KEPT_ERR, NULL), 1);
  assert_int_equal(RUN(KEPT_ERR, "fit", good, "--confidence", "1"), 1);
  assert_int_equal(RUN(KEPT_ERR, "fit", good, "--confidence", "x"), 1);
  assert_int_equal(RUN(KEPT_ERR, "show", "--step", "0"), 1);
  assert_int_equal(RUN(KEPT_ERR, "show", "--step", "1e-9"), 1);
  assert_int_equal(RUN(KEPT_ERR, "show", good, out), 1);
  assert_int_equal(RUN(KEPT_ERR, "fit", "/nonexistent/s.csv"), 2);
  expect_printed("/nonexistent/s.csv");
  assert_int_equal(RUN(KEPT_ERR, "fit", bad, "-o", out), 2);
  expect_printed("bad.csv:11: volume 0 mL");
  assert_int_equal(RUN(KEPT_ERR, "show", good), 2);
  assert_int_equal(RUN(KEPT_ERR, "fit", good, "-o", "/nonexistent/p.csv"), 4);
  expect_printed("/nonexistent/p.csv");
}

TEST_GROUP(setup, teardown)
