/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A cmocka program of which a test was skipped, and none failed, ends with 77: CTest then counts it
 * as skipped and not as passed. The linker sends cmocka's functions here (--wrap). */
#include "test.h"

enum { SKIPPED = 77 }; /* SKIP_RETURN_CODE in CMakeLists.txt */

static int skipped;

/* NOLINTBEGIN(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp): names that ld --wrap sets
 */
_Noreturn void __real__skip(const char *file, int line);
_Noreturn void __wrap__skip(const char *file, int line);
int __real__cmocka_run_group_tests(const char *name, const struct CMUnitTest *tests, size_t count,
                                   CMFixtureFunction setup, CMFixtureFunction teardown);
int __wrap__cmocka_run_group_tests(const char *name, const struct CMUnitTest *tests, size_t count,
                                   CMFixtureFunction setup, CMFixtureFunction teardown);

void __wrap__skip(const char *file, int line) {
  ++skipped;
  __real__skip(file, line);
}

int __wrap__cmocka_run_group_tests(const char *name, const struct CMUnitTest *tests, size_t count,
                                   CMFixtureFunction setup, CMFixtureFunction teardown) {
  const int failed = __real__cmocka_run_group_tests(name, tests, count, setup, teardown);
  return failed == 0 && skipped > 0 ? SKIPPED : failed;
}
/* NOLINTEND(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp) */
