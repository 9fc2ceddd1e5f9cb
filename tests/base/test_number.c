/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that numbers are parsed and printed with a decimal point in the locale that test_locale.sh
 * sets. */
#include <locale.h>
#include <math.h>

#include "base/locale.h"
#include "base/number.h"
#include "tests/helpers/test.h"

TEST(test_number_parse_any_text_takes_the_point_only) {
  static const struct {
    const char *text;
    double value;
    ptrdiff_t length;
  } cases[] = {{"", 0.0, 0},
               {"-", 0.0, 0},
               {"+.5", 0.5, 3},
               {"5.", 5.0, 2},
               {"1.5.2", 1.5, 3},
               {"1,5", 1.0, 1},
               {",5", 0.0, 0},
               {"12,5mL", 12.0, 2},
               {"2.6L", 2.6, 3},
               {" \t7.25", 7.25, 6},
               {"1e", 1.0, 1},
               {"1E-5x", 1e-5, 4},
               {"nonsense", 0.0, 0},
               {"0.1e1", 1.0, 5},
               {"0x10", 0.0, 1},
               {" -0X1p3", 0.0, 3},
               {"--5", 0.0, 0},
               {"+-5", 0.0, 0},
               {"\xA0"
                "5",
                0.0, 0},
               {"2.2250738585072011e-308", 2.2250738585072011e-308, 23},
               {"123456789012345678901234567890.5", 123456789012345678901234567890.5, 32}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    char *end = NULL;
    const double value = supine_number_parse(cases[i].text, &end);
    if (value != cases[i].value || end - cases[i].text != cases[i].length) {
      fail_msg("'%s': %td characters, not %td", cases[i].text, end - cases[i].text,
               cases[i].length);
    }
  }
}

TEST(test_number_shorten_long_runs_of_digits_only) {
  char text[512];
  assert_int_equal(supine_print_text(text, sizeof text, "%.0f mL, %.0f %%, 12345678901234567890",
                                     1.5e308, -2e21),
                   309 + 5 + 23 + 24);
  supine_number_shorten(text);
  assert_string_equal(text, "1.50e+308 mL, -2.00e+21 %, 12345678901234567890");
  supine_number_shorten(text);
  assert_string_equal(text, "1.50e+308 mL, -2.00e+21 %, 12345678901234567890");
}

TEST(test_number_print_reals_with_a_point_and_commas_of_the_text_as_they_are) {
  char text[80];
  assert_int_equal(supine_print_text(text, sizeof text, "%.1f,%+.2e|%-6.1f|%06.2f,%g", 0.5, -1234.5,
                                     2.25, 3.14159, 1e-7),
                   33);
  assert_string_equal(text, "0.5,-1.23e+03|2.2   |003.14,1e-07");
}

TEST(test_print_file_same_text) {
  FILE *file = tmpfile();
  char text[32] = "";
  assert_non_null(file);
  assert_int_equal(supine_print(file, "v %.9g,%d\n", 0.5, 3), 8);
  rewind(file);
  assert_int_equal(fread(text, 1, sizeof text - 1, file), 8);
  assert_string_equal(text, "v 0.5,3\n");
  (void)fclose(file);
}

TEST(test_locale_scope_ends_with_locale_before) {
  char before[8];
  char after[8];
  (void)snprintf(before, sizeof before, "%.1f", 0.5);
  {
    SUPINE_C_LOCALE;
    char inside[8];
    (void)snprintf(inside, sizeof inside, "%.1f", 0.5);
    assert_string_equal(inside, "0.5");
  }
  (void)snprintf(after, sizeof after, "%.1f", 0.5);
  assert_string_equal(before, after);
  assert_string_equal(before,
                      getenv("SUPINE_TEST_MARK") != NULL ? getenv("SUPINE_TEST_MARK") : "0.5");
}
