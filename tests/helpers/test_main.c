/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Run the tests that TEST defines, or with the argument `full` those of TEST_FULL, in the order of
 * their definitions. If a test is skipped and none
 * fails, exit with 77, so that CTest reports a skipped program. */
#include "tests/helpers/test.h"

#include <locale.h>

#include <gsl/gsl_errno.h>

/* In a program that is linked without GSL, the address of gsl_set_error_handler_off is NULL. */
#pragma weak gsl_set_error_handler_off

enum { SKIPPED = 77 }; /* exit code of a skipped program, as SKIP_RETURN_CODE in CMakeLists.txt */

static struct CMUnitTest tests[2][64]; /* of TEST and of TEST_FULL */
static size_t test_count[2];
static CMFixtureFunction group_setup, group_teardown;
static bool skipped;

void test_add(const char *name, CMUnitTestFunction test, bool full) {
  if (test_count[full] == sizeof tests[full] / sizeof *tests[full]) {
    abort();
  }
  tests[full][test_count[full]++] = (struct CMUnitTest){.name = name, .test_func = test};
}

void test_set_group(CMFixtureFunction setup, CMFixtureFunction teardown) {
  group_setup = setup;
  group_teardown = teardown;
}

/* NOLINTBEGIN(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp): names for ld --wrap */
_Noreturn void __real__skip(const char *file, int line);
_Noreturn void __wrap__skip(const char *file, int line);

void __wrap__skip(const char *file, int line) {
  skipped = true;
  __real__skip(file, line);
}
/* NOLINTEND(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp) */

/* Set the locale of the environment variable SUPINE_TEST_LOCALE, as a host program sets its own. */
static void set_locale(void) {
  const char *name = getenv("SUPINE_TEST_LOCALE");
  if (name != NULL && setlocale(LC_ALL, name) == NULL) {
    (void)fprintf(stderr, "there is no locale %s\n", name);
    abort();
  }
}

int main(int argc, char **argv) {
  const bool full = argc > 1 && strcmp(argv[1], "full") == 0;
  set_locale();
  if (gsl_set_error_handler_off != NULL) {
    (void)gsl_set_error_handler_off(); /* GSL's default handler would abort the program */
  }
  const int failed =
      _cmocka_run_group_tests("tests", tests[full], test_count[full], group_setup, group_teardown);
  return failed == 0 && skipped ? SKIPPED : failed;
}
