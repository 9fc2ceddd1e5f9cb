/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What every cmocka program includes: cmocka's own four headers first, then the usual ones. */
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

/* Write a text as a file. */
static inline void test_write(const char *path, const char *text) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_true(fputs(text, file) >= 0);
  assert_int_equal(fclose(file), 0);
}

#endif
