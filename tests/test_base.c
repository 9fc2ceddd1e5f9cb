/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Status strings, output files and threads: what every folder stands on. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "sh/base/output.h"
#include "sh/base/parallel.h"
#include <supine/status.h>

static void test_status_string_every_code_distinct(void **state) {
  (void)state;
  for (int i = 0; i < (int)SUPINE_STATUS_COUNT; ++i) {
    for (int j = 0; j < i; ++j) {
      assert_string_not_equal(supine_status_string((supine_status)i),
                              supine_status_string((supine_status)j));
    }
  }
}

static void test_status_string_outside_enumeration_not_null(void **state) {
  (void)state;
  assert_string_equal(supine_status_string(SUPINE_STATUS_COUNT), "unknown status");
  assert_string_equal(supine_status_string((supine_status)-1), "unknown status");
  assert_string_equal(supine_status_string((supine_status)1000), "unknown status");
}

static void test_error_set_long_message_cut(void **state) {
  (void)state;
  char text[2 * sizeof(((supine_error *)0)->message)];
  memset(text, 'x', sizeof text - 1);
  text[sizeof text - 1] = '\0';
  supine_error error;
  assert_int_equal(supine_error_set(&error, SUPINE_ERROR_MESH, "%s", text), SUPINE_ERROR_MESH);
  assert_int_equal(error.status, SUPINE_ERROR_MESH);
  assert_int_equal(strlen(error.message), sizeof error.message - 1);
  assert_int_equal(supine_error_set(NULL, SUPINE_ERROR_READ, "none"), SUPINE_ERROR_READ);
}

static void read_text(const char *path, char *text, size_t size) {
  FILE *file = fopen(path, "rb");
  assert_non_null(file);
  text[fread(text, 1, size - 1, file)] = '\0';
  (void)fclose(file);
}

static void test_output_commit_replaces_abandon_keeps(void **state) {
  (void)state;
  char folder[] = "/tmp/supine-output-XXXXXX";
  assert_non_null(mkdtemp(folder));
  char path[64];
  char text[16];
  (void)snprintf(path, sizeof path, "%s/out", folder);
  supine_output output;
  assert_int_equal(supine_output_open(path, &output, NULL), SUPINE_OK);
  (void)fputs("first", output.file);
  assert_int_not_equal(access(path, F_OK), 0);
  assert_int_equal(supine_output_commit(&output, NULL), SUPINE_OK);
  read_text(path, text, sizeof text);
  assert_string_equal(text, "first");
  assert_int_equal(supine_output_open(path, &output, NULL), SUPINE_OK);
  (void)fputs("second", output.file);
  supine_output_abandon(&output);
  supine_output_abandon(&output);
  read_text(path, text, sizeof text);
  assert_string_equal(text, "first");
  assert_int_equal(unlink(path), 0);
  assert_int_equal(rmdir(folder), 0); /* fails where a temporary file is left */
}

static void test_output_full_or_missing_target_reports_write(void **state) {
  (void)state;
  supine_output output;
  supine_error error;
  assert_int_equal(supine_output_open("/nonexistent-folder/x", &output, &error),
                   SUPINE_ERROR_WRITE);
  assert_non_null(strstr(error.message, "/nonexistent-folder/x"));
  assert_int_equal(supine_output_open("/tmp", &output, &error), SUPINE_ERROR_WRITE);
  assert_int_equal(supine_output_open("/dev/full", &output, &error), SUPINE_OK);
  (void)fputs("lost", output.file);
  assert_int_equal(supine_output_commit(&output, &error), SUPINE_ERROR_WRITE);
  assert_non_null(strstr(error.message, "/dev/full"));
}

typedef struct tally {
  _Atomic unsigned char seen[1000];
  size_t grain;
} tally;

static void tally_range(void *context, size_t begin, size_t end, size_t thread) {
  tally *counts = context;
  assert_true(thread < 8);
  assert_int_equal(begin % counts->grain, 0);
  for (size_t i = begin; i < end; ++i) {
    (void)atomic_fetch_add(&counts->seen[i], 1);
  }
}

static void test_parallel_for_any_split_covers_each_item_once(void **state) {
  (void)state;
  static const size_t sizes[] = {0, 1, 2, 7, 16, 17, 999, 1000};
  for (size_t s = 0; s < sizeof sizes / sizeof *sizes; ++s) {
    for (size_t threads = 1; threads <= 8; ++threads) {
      for (size_t grain = 1; grain <= 33; grain += 16) {
        tally counts = {.grain = grain};
        supine_parallel_for(sizes[s], grain, threads, tally_range, &counts);
        for (size_t i = 0; i < 1000; ++i) {
          assert_int_equal(counts.seen[i], i < sizes[s] ? 1 : 0);
        }
      }
    }
  }
  assert_true(supine_thread_count() >= 1);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_status_string_every_code_distinct),
      cmocka_unit_test(test_status_string_outside_enumeration_not_null),
      cmocka_unit_test(test_error_set_long_message_cut),
      cmocka_unit_test(test_output_commit_replaces_abandon_keeps),
      cmocka_unit_test(test_output_full_or_missing_target_reports_write),
      cmocka_unit_test(test_parallel_for_any_split_covers_each_item_once),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
