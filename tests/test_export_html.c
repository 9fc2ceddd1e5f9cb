/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The page: its tensors are the basis', its texts stay texts. */
#include "test.h"

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

/* The `size` bytes of a tensor of the page (malloc). */
static void *take_tensor(const char *page, const char *name, size_t size) {
  char tag[64];
  (void)snprintf(tag, sizeof tag, "id=\"tensor-%s\">", name);
  const char *at = strstr(page, tag);
  unsigned char *bytes = malloc(size);
  assert_true(at != NULL && bytes != NULL);
  at += strlen(tag);
  unsigned bits = 0;
  unsigned held = 0;
  size_t count = 0;
  for (; *at != '<' && *at != '='; ++at) {
    bits = bits << 6 | (unsigned)digit(*at);
    held += 6;
    if (held >= 8) {
      held -= 8;
      assert_true(count < size);
      bytes[count++] = bits >> held & 255;
    }
  }
  assert_int_equal(count, size);
  return bytes;
}

/* Compares a tensor of the page with bytes. */
static void check_tensor(const char *page, const char *name, const void *bytes, size_t size) {
  void *found = take_tensor(page, name, size);
  assert_memory_equal(found, bytes, size);
  free(found);
}

/* What moves the lungs is rounded to half a count of 16 bits: directions to unit length, each
 * mode's coefficients, with the directions' lengths in them, to the mode's largest. */
static void check_motion(const char *page, const export_source *s) {
  enum { COUNT_MAX = 32767 };
  const double half = 0.5 * (1 + 1e-6) / COUNT_MAX; /* and the doubles' own rounding */
  const size_t n = s->info->vertex_count;
  const size_t modes = s->info->mode_count;
  int16_t *direction = take_tensor(page, "direction", 3 * n * sizeof *direction);
  int16_t *counts = take_tensor(page, "coefficients", modes * n * sizeof *counts);
  for (size_t k = 0; k < modes; ++k) {
    double largest = 0;
    for (int pass = 0; pass < 2; ++pass) {
      for (size_t i = 0; i < n; ++i) {
        const float *d = s->direction + 3 * i;
        const double length = hypot(hypot((double)d[0], (double)d[1]), (double)d[2]);
        const double c = (double)s->coefficients[i * modes + k] * length;
        if (pass == 0) {
          largest = fmax(largest, fabs(c));
          continue;
        }
        assert_true(fabs(counts[i * modes + k] * largest / COUNT_MAX - c) <= half * largest);
        for (size_t axis = 0; axis < 3 && k == 0; ++axis) {
          assert_true(
              fabs((double)direction[3 * i + axis] / COUNT_MAX - (double)d[axis] / length) <= half);
        }
      }
    }
    assert_true(largest > 0);
  }
  free(direction);
  free(counts);
}

/* Corners of 16 bits. */
static void check_corners(const char *page, const char *name, const uint32_t *corners,
                          size_t count) {
  uint16_t *found = take_tensor(page, name, count * sizeof *found);
  for (size_t i = 0; i < count; ++i) {
    assert_int_equal(found[i], corners[i]);
  }
  free(found);
}

static void test_page_carries_the_basis(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(text, basis, "-o", out), 0);
  char *page = read_page();
  export_source s = {0};
  assert_int_equal(supine_export_source_open(basis, &s, NULL), SUPINE_OK);
  check_tensor(page, "vertices", s.vertices, 40 * 3 * sizeof(float));
  check_motion(page, &s);
  check_corners(page, "triangles", s.triangles, 3 * s.info->triangle_count);
  check_tensor(page, "modes", s.modes, 6 * 16 * sizeof(double));
  check_tensor(page, "linear", s.info->volume_linear, 2 * 6 * sizeof(double));
  check_tensor(page, "quadratic", s.info->volume_quadratic, 2 * 36 * sizeof(double));
  check_tensor(page, "cubic", s.info->volume_cubic, 2 * 216 * sizeof(double));
  assert_null(strstr(page, "{{"));
  assert_null(strstr(page, "src="));
  assert_null(strstr(page, "@import"));
  assert_non_null(strstr(page, "default-src 'none'"));
  supine_export_source_close(&s);
  free(page);
}

static void test_page_of_an_open_surface_has_no_volumes(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(text, open_surface, "-o", out, "--scale", "12"), 0);
  char *page = read_page();
  assert_non_null(strstr(page, "&quot;hasVolume&quot;:false"));
  assert_non_null(strstr(page, "&quot;breathLargest&quot;:12"));
  assert_null(strstr(page, "tensor-linear"));
  free(page);
}

static void test_page_title_stays_text(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(text, basis, "-o", out, "--title", "</script><b>&"), 0);
  char *page = read_page();
  assert_non_null(strstr(page, "<title>&lt;/script&gt;&lt;b&gt;&amp;</title>"));
  assert_null(strstr(page, "</script><b>"));
  free(page);
}

static void test_page_of_too_many_modes_or_vectors_is_refused(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(text, many, "-o", out), 3);
  assert_non_null(strstr(text, "--modes 16"));
  assert_int_equal(EXPORT_RUN(text, vector, "-o", out), 3);
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
