/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that numbers are parsed and printed as in the C locale, in the locale that test_locale.sh
 * sets, and that the results are those of the C library. */
#include <locale.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>

#include "base/locale.h"
#include "base/number.h"
#include "test.h"

/* Parse and print with the C library, in the C locale. */
static double parse_in_c(const char *text, char **end) {
  SUPINE_C_LOCALE;
  return strtod(text, end);
}

SUPINE_PRINTF(3, 4)
static int print_in_c(char *text, size_t size, const char *format, ...) {
  SUPINE_C_LOCALE;
  va_list list;
  va_start(list, format);
  const int length = vsnprintf(text, size, format, list);
  va_end(list);
  return length;
}

static void check_parse(const char *text) {
  char *end = NULL;
  char *expected_end = NULL;
  const double value = supine_number_parse(text, &end);
  const double expected = parse_in_c(text, &expected_end);
  if (end != expected_end ||
      (memcmp(&value, &expected, sizeof value) != 0 && !(isnan(value) && isnan(expected)))) {
    char text_of[64];
    (void)print_in_c(text_of, sizeof text_of, "%.17g, not %.17g", value, expected);
    fail_msg("'%.60s': %s, %td characters, not %td", text, text_of, end - text,
             expected_end - text);
  }
}

static uint64_t next_random(uint64_t *state) { /* xorshift */
  *state ^= *state << 13;
  *state ^= *state >> 7;
  return *state ^= *state << 17;
}

TEST(test_number_parse_any_text_as_in_c_locale) {
  static const char *const texts[] = {"",
                                      "-",
                                      ".",
                                      "+.5",
                                      "5.",
                                      "1.5.2",
                                      "1,5",
                                      ",5",
                                      "12,5mL",
                                      "2.6L",
                                      " \t7",
                                      "-0",
                                      "0.000",
                                      "1e",
                                      "1e+",
                                      "1e5",
                                      "1E-5x",
                                      "1e400",
                                      "1e-400",
                                      "inf",
                                      "-Infinity",
                                      "nan",
                                      "nonsense",
                                      "1e99999999",
                                      "00012.5",
                                      "0.1e1",
                                      "4.9e-324",
                                      "2.2250738585072011e-308",
                                      "9007199254740993",
                                      "1.7976931348623159e308",
                                      "123456789012345678901234567890",
                                      "0.30000000000000004",
                                      "0e999999",
                                      "1e22",
                                      "1e23",
                                      "999999999999999e22",
                                      "9.5e-23",
                                      "\xA0"
                                      "5",
                                      "--5",
                                      "+-5"};
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    check_parse(texts[i]);
  }
}

TEST(test_number_parse_digits_beyond_the_buffer_still_decide) {
  char text[2048] = "1."; /* half way from 1 to the next double, and a digit far behind */
  static const char half[] = "00000000000000011102230246251565404236316680908203125";
  (void)strcat(text, half);
  memset(text + strlen(text), '0', 1500);
  check_parse(text);
  text[1600] = '\0';
  text[1500] = '1';
  check_parse(text);
  memset(text, '9', 1000);
  (void)strcpy(text + 1000, "e-990");
  check_parse(text);
}

TEST(test_number_print_any_real_as_in_c_locale) {
  static const char *const formats[] = {"%.17g",    "%.9g",     "%g",    "%+.3f", "%12.4e",
                                        "%-14.3g|", "%08.2f",   "%+.0f", "% .5g", "%5.15g",
                                        "%#.3g",    "%+012.3e", "%F",    "%G",    "%-+9.2f,%%"};
  uint64_t seed = 88172645463325252U;
  for (size_t i = 0; i < 30000; ++i) {
    const uint64_t bits = next_random(&seed);
    double value;
    memcpy(&value, &bits, sizeof value);
    if (i % 2 == 0) { /* numbers of the usual size */
      value = ldexp((double)(bits >> 11), -53) * 600.0 - 300.0;
    }
    const char *format = formats[i % (sizeof formats / sizeof *formats)];
    char text[600];
    char expected[600];
    const int length = supine_print_text(text, sizeof text, format, value);
    assert_int_equal(length, print_in_c(expected, sizeof expected, format, value));
    assert_string_equal(text, expected);
    check_parse(text);
  }
}

TEST(test_number_print_other_conversions_as_in_c_locale) {
#define SAME(...)                                                                                  \
  do {                                                                                             \
    char text[80];                                                                                 \
    char expected[80];                                                                             \
    assert_int_equal(supine_print_text(text, sizeof text, __VA_ARGS__),                            \
                     print_in_c(expected, sizeof expected, __VA_ARGS__));                          \
    assert_string_equal(text, expected);                                                           \
  } while (0)
  SAME("%s, %.1f, %d,%5d|%-5d|%05d|%+d|% d", "Länge", 2.5, -3, 4, 5, 6, 7, 8);
  SAME("%zu %lu %llu %ju %td %ld %lld %zd", (size_t)7, 8UL, 1ULL << 63, UINTMAX_MAX, (ptrdiff_t)-9,
       -1L, -2LL, (ssize_t)-3);
  SAME("%x %X %#x %08x %o %u %.3d %i", 255U, 255U, 255U, 255U, 8U, 4294967295U, 5, -6);
  SAME("%.*s|%-6s|%6s|%.0s|%c%%|%-3c|", 3, "abcdef", "ab", "cd", "ef", 'x', 'y');
  SAME("%*.*f|%-*d|%*d", 9, 2, 3.14159, 5, 42, -5, 42);
  SAME("%5.1f%%, %g and %s", NAN, -INFINITY,
       "much more text than fits, so that it is cut off at "
       "the end, as in snprintf");
#undef SAME
  assert_int_equal(supine_print_text(NULL, 0, "%.1f,%s", 1.5, "x"), 5);
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
