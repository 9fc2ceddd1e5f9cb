/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that numbers with units are parsed, and that volumes need a unit. */
#include <math.h>

#include "base/quantity.h"
#include "tests/helpers/test.h"

TEST(test_quantity_parse_each_unit_literal) {
  static const struct {
    const char *text;
    supine_quantity quantity;
    double value;
  } good[] = {
      {"500mL", SUPINE_QUANTITY_VOLUME, 500},   {"0.5L", SUPINE_QUANTITY_VOLUME, 500},
      {"2.6l", SUPINE_QUANTITY_VOLUME, 2600},   {"-3ml", SUPINE_QUANTITY_VOLUME, -3},
      {"4", SUPINE_QUANTITY_LENGTH, 4},         {"4mm", SUPINE_QUANTITY_LENGTH, 4},
      {"0.25cm", SUPINE_QUANTITY_LENGTH, 2.5},  {"0.5m", SUPINE_QUANTITY_LENGTH, 500},
      {"175", SUPINE_QUANTITY_HEIGHT, 175},     {"1.75m", SUPINE_QUANTITY_HEIGHT, 175},
      {"1750mm", SUPINE_QUANTITY_HEIGHT, 175},  {"90s", SUPINE_QUANTITY_TIME, 90},
      {"1.5min", SUPINE_QUANTITY_TIME, 90},     {"250ms", SUPINE_QUANTITY_TIME, 0.25},
      {"15deg", SUPINE_QUANTITY_ANGLE, 15},     {"15\xC2\xB0", SUPINE_QUANTITY_ANGLE, 15},
      {"5", SUPINE_QUANTITY_PRESSURE, 5},       {"5cmH2O", SUPINE_QUANTITY_PRESSURE, 5},
      {"1kPa", SUPINE_QUANTITY_PRESSURE, 10.19716},
      {"10hPa", SUPINE_QUANTITY_PRESSURE, 10.19716},
      {"10mmHg", SUPINE_QUANTITY_PRESSURE, 13.59506},/* ISO 80000-4 */
      {"0.2/s", SUPINE_QUANTITY_RATE, 12},      {"12/min", SUPINE_QUANTITY_RATE, 12},
      {"1e2", SUPINE_QUANTITY_NUMBER, 100}};
  for (size_t i = 0; i < sizeof good / sizeof *good; ++i) {
    double value = NAN;
    supine_error error = {0};
    assert_int_equal(supine_quantity_parse(good[i].text, good[i].quantity, 1, &value, &error),
                     SUPINE_OK);
    assert_true(fabs(value - good[i].value) <= 1e-6 * fabs(good[i].value));
  }
}

TEST(test_quantity_parse_wrong_text_refused_with_the_unit) {
  static const struct {
    const char *text;
    supine_quantity quantity;
    const char *reason; /* "" if the caller says what is wanted */
  } bad[] = {{"500", SUPINE_QUANTITY_VOLUME, "'500' has no unit: give a volume such as 500mL"},
             {"500mm", SUPINE_QUANTITY_VOLUME, "'500mm' has an unknown unit: give mL or L"},
             {"500mLs", SUPINE_QUANTITY_VOLUME, "unknown unit"},
             {"0x1F4mL", SUPINE_QUANTITY_VOLUME, "unknown unit"},
             {"5mL", SUPINE_QUANTITY_LENGTH, "give mm, cm or m"},
             {"5mm", SUPINE_QUANTITY_NUMBER, ""},
             {"0x10", SUPINE_QUANTITY_NUMBER, ""},
             {"", SUPINE_QUANTITY_LENGTH, ""},
             {"mm", SUPINE_QUANTITY_LENGTH, ""},
             {"nan", SUPINE_QUANTITY_LENGTH, ""},
             {"1e308m", SUPINE_QUANTITY_LENGTH, ""},
             {"5 mL", SUPINE_QUANTITY_VOLUME, ""},
             {"1,2", SUPINE_QUANTITY_LENGTH, ""}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    double value = NAN;
    supine_error error = {0};
    assert_int_equal(supine_quantity_parse(bad[i].text, bad[i].quantity, 1, &value, &error),
                     SUPINE_ERROR_ARGUMENT);
    if (bad[i].reason[0] == '\0') {
      assert_string_equal(error.message, "");
    } else {
      assert_non_null(strstr(error.message, bad[i].reason));
    }
  }
}

TEST(test_quantity_parse_list_takes_exactly_its_numbers) {
  double value[3];
  assert_int_equal(supine_quantity_parse("1,2cm,-3", SUPINE_QUANTITY_LENGTH, 3, value, NULL),
                   SUPINE_OK);
  assert_true(value[0] == 1 && value[1] == 20 && value[2] == -3);
  assert_int_equal(supine_quantity_parse("1,2", SUPINE_QUANTITY_LENGTH, 3, value, NULL),
                   SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_quantity_parse("1,2,3,4", SUPINE_QUANTITY_LENGTH, 3, value, NULL),
                   SUPINE_ERROR_ARGUMENT);
}

TEST_GROUP(NULL, NULL)
