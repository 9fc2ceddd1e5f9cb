/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The page: its tensors are the basis', its texts stay texts. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <base64.h>
#include <export.h>

#include "export_helpers.h"

static char *folder;
static char basis[256], many[256], vector[256], open_surface[256], out[256];
static char text[8192];

static int setup(void **state) {
  (void)state;
  folder = fixture_folder();
  export_basis_make(folder, "basis", 6, 3, false, true, basis);
  export_basis_make(folder, "many", 17, 4, false, true, many);
  export_basis_make(folder, "vector", 4, 3, true, true, vector);
  export_basis_make(folder, "open", 4, 3, false, false, open_surface);
  (void)snprintf(out, sizeof out, "%s/out.html", folder);
  return 0;
}

static int teardown(void **state) {
  (void)state;
  fixture_folder_remove(folder);
  return 0;
}

/* RFC 4648, section 10. */
static void test_base64_of_known_texts(void **state) {
  (void)state;
  static const char *const pairs[][2] = {{"", ""},
                                         {"f", "Zg=="},
                                         {"fo", "Zm8="},
                                         {"foo", "Zm9v"},
                                         {"foob", "Zm9vYg=="},
                                         {"fooba", "Zm9vYmE="},
                                         {"foobar", "Zm9vYmFy"}};
  for (size_t i = 0; i < sizeof pairs / sizeof *pairs; ++i) {
    char got[16] = {0};
    FILE *file = fmemopen(got, sizeof got, "w");
    assert_non_null(file);
    supine_export_base64_write(pairs[i][0], strlen(pairs[i][0]), file);
    assert_int_equal(fclose(file), 0);
    assert_string_equal(got, pairs[i][1]);
  }
}

/* The page as a string (malloc). */
static char *read_page(void) {
  size_t size = 0;
  char *page = (char *)fixture_read(out, &size);
  page[size] = '\0';
  return page;
}

static int digit(char c) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const char *at = strchr(digits, c);
  assert_non_null(at);
  return (int)(at - digits);
}

/* Compares a tensor of the page with bytes. */
static void check_tensor(const char *page, const char *name, const void *bytes, size_t size) {
  char tag[64];
  (void)snprintf(tag, sizeof tag, "id=\"tensor-%s\">", name);
  const char *at = strstr(page, tag);
  assert_non_null(at);
  at += strlen(tag);
  const unsigned char *expected = bytes;
  unsigned bits = 0;
  unsigned held = 0;
  size_t count = 0;
  for (; *at != '<' && *at != '='; ++at) {
    bits = bits << 6 | (unsigned)digit(*at);
    held += 6;
    if (held >= 8) {
      held -= 8;
      assert_true(count < size);
      assert_int_equal(bits >> held & 255, expected[count]);
      ++count;
    }
  }
  assert_int_equal(count, size);
}

static void test_page_carries_the_basis(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(folder, text, basis, "-o", out), 0);
  char *page = read_page();
  export_source s = {0};
  assert_int_equal(supine_export_source_open(basis, &s, NULL), SUPINE_OK);
  check_tensor(page, "vertices", s.vertices, 40 * 3 * sizeof(float));
  check_tensor(page, "direction", s.direction, 40 * 3 * sizeof(float));
  check_tensor(page, "coefficients", s.coefficients, 40 * 6 * sizeof(float));
  check_tensor(page, "triangles", s.triangles, s.info->triangle_count * 3 * sizeof(uint32_t));
  check_tensor(page, "modes", s.modes, 6 * 16 * sizeof(double));
  check_tensor(page, "linear", s.linear, 2 * 6 * sizeof(double));
  check_tensor(page, "quadratic", s.quadratic, 2 * 36 * sizeof(double));
  check_tensor(page, "cubic", s.cubic, 2 * 216 * sizeof(double));
  assert_null(strstr(page, "{{"));
  assert_null(strstr(page, "src="));
  assert_null(strstr(page, "@import"));
  assert_non_null(strstr(page, "default-src 'none'"));
  supine_export_source_close(&s);
  free(page);
}

static void test_page_of_an_open_surface_has_no_volumes(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(folder, text, open_surface, "-o", out, "--scale", "12"), 0);
  char *page = read_page();
  assert_non_null(strstr(page, "&quot;hasVolume&quot;:false"));
  assert_non_null(strstr(page, "&quot;breathLargest&quot;:12"));
  assert_null(strstr(page, "tensor-linear"));
  free(page);
}

static void test_page_title_stays_text(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(folder, text, basis, "-o", out, "--title", "</script><b>&"), 0);
  char *page = read_page();
  assert_non_null(strstr(page, "<title>&lt;/script&gt;&lt;b&gt;&amp;</title>"));
  assert_null(strstr(page, "</script><b>"));
  free(page);
}

static void test_page_of_too_many_modes_or_vectors_is_refused(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(folder, text, many, "-o", out), 3);
  assert_non_null(strstr(text, "--modes 16"));
  assert_int_equal(EXPORT_RUN(folder, text, vector, "-o", out), 3);
  assert_non_null(strstr(text, "a vector basis"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_base64_of_known_texts),
      cmocka_unit_test(test_page_carries_the_basis),
      cmocka_unit_test(test_page_of_an_open_surface_has_no_volumes),
      cmocka_unit_test(test_page_title_stays_text),
      cmocka_unit_test(test_page_of_too_many_modes_or_vectors_is_refused),
  };
  return cmocka_run_group_tests(tests, setup, teardown);
}
