/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test files of pressure-volume samples and of fitted curves. */
#include "tests/helpers/test.h"

#include "base/number.h"
#include "program/options/pv.h"

static char folder[] = "/tmp/supine-pv-XXXXXX";
static char path[64];

static int folder_make(void **state) {
  (void)state;
  if (mkdtemp(folder) == NULL) {
    return -1;
  }
  (void)snprintf(path, sizeof path, "%s/file.csv", folder);
  return 0;
}

static int folder_remove(void **state) {
  (void)state;
  (void)unlink(path);
  return rmdir(folder);
}

static void write_bytes(const char *text, size_t size) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(text, 1, size, file), size);
  assert_int_equal(fclose(file), 0);
}

static void expect_load(const char *text, size_t size, const char *expected) {
  write_bytes(text, size);
  supine_pv pv;
  supine_pv_report reports[SUPINE_PV_LIMB_COUNT];
  supine_error error = {0};
  assert_int_equal(supine_options_pv_fit_file(path, 0.95, &pv, reports, &error),
                   SUPINE_ERROR_FORMAT);
  assert_says(error.message, expected);
  assert_says(error.message, path);
}

TEST(test_fit_file_malformed_names_the_line) {
  static const struct {
    const char *text;
    const char *expected;
  } bad[] = {
      {"", "empty"},
      {"# nothing\n\n", "empty"},
      {"1,2\n3,4\n", ":1: the header has no column \"pressure_cmH2O\""},
      {"pressure_cmH2O,\"volume_mL\n", ":1: a quote is not closed"},
      {"pressure_cmH2O,pressure_cmH2O\n", ":1: repeated column"},
      {"#\npressure_cmH2O,limb\n", ":2: the header has no column \"volume_mL\""},
      {"pressure_cmH2O,volume_mL\n1,2\n1\n", ":3: 1 field, but the header has 2"},
      {"pressure_cmH2O,volume_mL\n1,2,3\n", ":2: 3 fields"},
      {"pressure_cmH2O,volume_mL\n1,2\n\n3,nan\n", ":4: volume_mL \"nan\""},
      {"pressure_cmH2O,volume_mL\ninf,2\n", ":2: pressure_cmH2O \"inf\""},
      {"pressure_cmH2O,volume_mL\n1e999,2\n", ":2: pressure_cmH2O \"1e999\""},
      {"pressure_cmH2O,volume_mL\n,2\n", ":2: pressure_cmH2O \"\""},
      {"pressure_cmH2O,volume_mL\n1,2 mL\n", ":2: volume_mL \"2 mL\""},
      {"pressure_cmH2O,volume_mL\n1,\"2\"3\n", ":2: a quote is not closed"},
      {"pressure_cmH2O,volume_mL,limb\n1,2,in\n", ":2: limb \"in\""},
      {"pressure_cmH2O,volume_mL\n", "0 samples"},
      {"pressure_cmH2O,volume_mL,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,"
       "\n",
       ":1: more than 64 fields"},
  };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    expect_load(bad[i].text, strlen(bad[i].text), bad[i].expected);
  }
  static const char nul[] = "pressure_cmH2O,volume_mL\n1,2\0\n";
  expect_load(nul, sizeof nul - 1, ":2: a NUL byte");
}

TEST(test_load_missing_file_or_folder_reports_read_error) {
  supine_pv pv;
  supine_pv_report reports[SUPINE_PV_LIMB_COUNT];
  supine_error error = {0};
  assert_int_equal(supine_options_pv_fit_file("/nonexistent/s.csv", 0.95, &pv, reports, &error),
                   SUPINE_ERROR_READ);
  assert_says(error.message, "/nonexistent/s.csv");
  assert_int_equal(supine_options_pv_load("/nonexistent/p.csv", &pv, &error), SUPINE_ERROR_READ);
  assert_int_equal(supine_options_pv_load(folder, &pv, &error), SUPINE_ERROR_READ);
  assert_says(error.message, folder);
}

static supine_status load(const char *text, supine_pv *pv, supine_error *error) {
  write_bytes(text, strlen(text));
  return supine_options_pv_load(path, pv, error);
}

#define CURVE(name, pressure, volume, control)                                                     \
  "\"" name "\": {\"pressure_cmH2O\": [" pressure "], \"volume_mL\": [" volume                     \
  "], \"control\": [" control "], \"rms_mL\": 1.5}"

TEST(test_load_limbs_same_numbers) {
  const supine_pv written = {
      {{{-1.0 / 3.0, 29.9}, {1234.5678901234567, 5.0e3}, {0.1, -2.0 / 7.0, 1e-17, 49.9, -50.0}},
       {{0.0, 30.0}, {-0.0, 6000.1}, {0.0, 1.0, 2.0, 3.0, 4.0}}}};
  supine_pv read;
  assert_int_equal(
      load("{\"confidence\": 0.95, " CURVE(
               "inhale", "-0.33333333333333331, 29.9", "1234.5678901234567, 5000",
               "0.1, -0.2857142857142857, 1e-17, 49.9, "
               "-50") ", " CURVE("exhale", "0, 30", "-0.0, 6000.1", "0, 1, 2, 3, 4") "}",
           &read, NULL),
      SUPINE_OK);
  assert_memory_equal(&read, &written, sizeof read);
}

TEST(test_load_one_limb_used_for_both) {
  static const char *const texts[] = {
      "{" CURVE("exhale", "0, 30", "0, 6000", "-1, 2, 3, 4, 5") "}",
      "{" CURVE("inhale", "0, 30", "0, 6000", "-1, 2, 3, 4, 5") "}"};
  for (size_t i = 0; i < 2; ++i) {
    supine_pv pv;
    assert_int_equal(load(texts[i], &pv, NULL), SUPINE_OK);
    assert_memory_equal(&pv.limb[0], &pv.limb[1], sizeof pv.limb[0]);
    assert_true(pv.limb[0].pressure[1] == 30.0 && pv.limb[0].control[4] == 5.0);
  }
}

TEST(test_load_malformed_parameters_message_names_fault) {
  static const struct {
    const char *text;
    const char *expected;
  } bad[] = {
      {"", ":1: "},
      {"{}", "neither the limb inhale nor exhale"},
      {"[1]", "neither the limb inhale nor exhale"},
      {"{\"inhale\": 1}", "inhale: Expected object"},
      {"{\"inhale\": {}}", "inhale: Object item not found: pressure_cmH2O"},
      {"{" CURVE("inhale", "0", "0, 6000", "1, 2, 3, 4, 5") "}", "inhale: "},
      {"{" CURVE("inhale", "0, 1, 2", "0, 6000", "1, 2, 3, 4, 5") "}", "inhale: "},
      {"{" CURVE("inhale", "0, 30", "0, 6000", "1, 2, 3, 4") "}", "inhale: "},
      {"{" CURVE("inhale", "0, 30", "0, 6000", "1, 2, 3, 4, \"x\"") "}", "inhale: Expected real"},
      {"{" CURVE("inhale", "30, 0", "0, 6000", "1, 2, 3, 4, 5") "}", "pressures must rise"},
      {"{" CURVE("inhale", "0, 30", "7, 7", "1, 2, 3, 4, 5") "}", "volumes must rise"},
      {"{" CURVE("exhale", "0, 30", "0, 7", "1, 2, 51, 4, 5") "}",
       "exhale: control parameter c3 is 51"},
      {"{" CURVE("inhale", "0, 30", "0, 7", "1, 2, 3, 4, 5") ", " CURVE("inhale", "0, 30", "0, 7",
                                                                        "1, 2, 3, 4, 5") "}",
       "duplicate"},
  };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    supine_pv pv;
    supine_error error = {0};
    assert_int_equal(load(bad[i].text, &pv, &error), SUPINE_ERROR_FORMAT);
    assert_says(error.message, "make the file with 'supine pv fit'");
    assert_says(error.message, bad[i].expected);
    assert_says(error.message, path);
  }
}

static void write_limbs(bool inhale, bool exhale) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  (void)fputs("\xEF\xBB\xBF# bench, 3rd of May\r\n\r\nlimb , volume_mL,pressure_cmH2O\r\n", file);
  for (int limb = 0; limb < 2; ++limb) {
    for (int j = 0; j < 12 && (limb == 0 ? inhale : exhale); ++j) {
      const double pressure = 30.0 * (limb == 0 ? j : 11 - j) / 11.0;
      double volume = 0.0;
      assert_int_equal(supine_breath_curve_evaluate(&supine_breath_normal()->limb[limb], 1,
                                                    &pressure, &volume, NULL, NULL),
                       SUPINE_OK);
      (void)supine_print(file, "%s, %.17g ,\t%.17g\n",
                         supine_breath_limb_name((supine_pv_limb)limb), volume, pressure);
    }
  }
  assert_int_equal(fclose(file), 0);
}

TEST(test_fit_file_missing_limb_uses_the_other) {
  for (int which = 1; which <= 3; ++which) {
    write_limbs((which & 1) != 0, (which & 2) != 0);
    supine_pv pv;
    supine_pv_report reports[SUPINE_PV_LIMB_COUNT];
    assert_int_equal(supine_options_pv_fit_file(path, 0.95, &pv, reports, NULL), SUPINE_OK);
    for (int limb = 0; limb < 2; ++limb) {
      const bool own = (which & (1 << limb)) != 0;
      assert_int_equal(reports[limb].samples, own ? 12 : 0);
      const supine_pv_curve *expected = &supine_breath_normal()->limb[own ? limb : 1 - limb];
      for (int i = 0; i < SUPINE_PV_CONTROLS; ++i) {
        const double difference = pv.limb[limb].control[i] - expected->control[i];
        assert_true(difference < 1e-6 && difference > -1e-6);
      }
    }
  }
}

TEST_GROUP(folder_make, folder_remove)
