/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Headers, macros and functions that every test program uses. test_main.c has the main function. */
#ifndef SUPINE_TEST_H
#define SUPINE_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Define a test: TEST(test_name) { ... }. The group's setup may set `*state`. */
#define TEST(name) TEST_OF(name, false)

/* Define a test that needs lungs that are not shipped (tests/README.md), or another program. Only
 * `test_NAME full` runs it, which is the test NAME_full of CTest. */
#define TEST_FULL(name) TEST_OF(name, true)

#define TEST_OF(name, full)                                                                        \
  static void name(void **state);                                                                  \
  __attribute__((constructor)) static void name##_add(void) {                                      \
    test_add(#name, name, full);                                                                   \
  }                                                                                                \
  static void name(__attribute__((unused)) void **state)

/* Call `setup` before the first test of this program and `teardown` after the last. */
#define TEST_GROUP(setup, teardown)                                                                \
  __attribute__((constructor)) static void test_group_set(void) {                                  \
    test_set_group(setup, teardown);                                                               \
  }

void test_add(const char *name, CMUnitTestFunction test, bool full);
void test_set_group(CMFixtureFunction setup, CMFixtureFunction teardown);

/* Assert |value - expected| <= tolerance. On failure print both in double precision, because
 * assert_float_equal of cmocka 1.1.5 prints only single precision. */
#define assert_close(value, expected, tolerance)                                                   \
  do {                                                                                             \
    const double value_ = (value);                                                                 \
    const double expected_ = (expected);                                                           \
    if (!(fabs(value_ - expected_) <= (tolerance))) {                                              \
      fail_msg("%s = %.17g, not %.17g: off by %.3g", #value, value_, expected_,                    \
               value_ - expected_);                                                                \
    }                                                                                              \
  } while (0)

/* Assert that the text contains the words. On failure print the words and the start of the text. */
#define assert_says(text, words)                                                                   \
  do {                                                                                             \
    const char *text_ = (text);                                                                    \
    const char *words_ = (words);                                                                  \
    if (strstr(text_, words_) == NULL) {                                                           \
      fail_msg("\"%s\" is missing in: %.4000s", words_, text_);                                    \
    }                                                                                              \
  } while (0)

static inline void test_write(const char *path, const char *text) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_true(fputs(text, file) >= 0);
  assert_int_equal(fclose(file), 0);
}

/* Return the content of a file (malloc), followed by a NUL that `size` does not count. */
static inline void *test_read(const char *path, size_t *size) {
  FILE *file = fopen(path, "rb");
  assert_non_null(file);
  assert_int_equal(fseek(file, 0, SEEK_END), 0);
  *size = (size_t)ftell(file);
  rewind(file);
  char *bytes = malloc(*size + 1);
  assert_non_null(bytes);
  assert_int_equal(fread(bytes, 1, *size, file), *size);
  assert_int_equal(fclose(file), 0);
  bytes[*size] = '\0';
  return bytes;
}

#endif
