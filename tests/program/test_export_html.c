/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the exported HTML page: its tensors equal the basis, and its texts are escaped. */
#include "tests/helpers/test.h"

#include <export.h>
#include <meshoptimizer.h>
#include <packed.h>
#include <template.h>

#include "base/number.h"
#include "tests/helpers/export_helpers.h"

static char *folder;
static char basis[256], many[256], vector[256], out[256];
static char text[8192];

static int setup(void **state) {
  (void)state;
  folder = fixture_folder();
  export_basis_make(folder, "basis", 6, 3, false, true, basis);
  export_basis_make(folder, "many", 129, 4, false, true, many);
  export_basis_make(folder, "vector", 4, 3, true, true, vector);
  (void)snprintf(out, sizeof out, "%s/out.html", folder);
  return 0;
}

static int teardown(void **state) {
  (void)state;
  fixture_folder_remove(folder);
  return 0;
}

/* Test vectors of RFC 4648, section 10. */
TEST(test_base64_rfc_4648_vectors_equal) {
  static const char *const pairs[][2] = {{"", ""},
                                         {"f", "Zg=="},
                                         {"fo", "Zm8="},
                                         {"foo", "Zm9v"},
                                         {"foob", "Zm9vYg=="},
                                         {"fooba", "Zm9vYmE="},
                                         {"foobar", "Zm9vYmFy"}};
  for (size_t i = 0; i < sizeof pairs / sizeof *pairs; ++i) {
    json_t *got = supine_export_template_base64(pairs[i][0], strlen(pairs[i][0]));
    assert_string_equal(json_string_value(got), pairs[i][1]);
    json_decref(got);
  }
}

/* Return the content of the page as a string (malloc). */
static char *read_page(void) {
  return test_read(out, &(size_t){0});
}

static int digit(char c) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const char *at = strchr(digits, c);
  assert_non_null(at);
  return (int)(at - digits);
}

/* Return the bytes of a tensor of the page (malloc), and set `size` to their number. */
static unsigned char *take_bytes(const char *page, const char *name, size_t *size) {
  char tag[64];
  (void)snprintf(tag, sizeof tag, "id=\"tensor-%s\">", name);
  const char *at = strstr(page, tag);
  assert_non_null(at);
  at += strlen(tag);
  unsigned char *bytes = malloc(strcspn(at, "<"));
  assert_non_null(bytes);
  unsigned bits = 0;
  unsigned held = 0;
  *size = 0;
  for (; *at != '<' && *at != '='; ++at) {
    bits = bits << 6 | (unsigned)digit(*at);
    held += 6;
    if (held >= 8) {
      held -= 8;
      bytes[(*size)++] = bits >> held & 255;
    }
  }
  return bytes;
}

/* Assert that a tensor of the page has these bytes. */
static void check_tensor(const char *page, const char *name, const void *bytes, size_t size) {
  size_t got = 0;
  unsigned char *found = take_bytes(page, name, &got);
  assert_int_equal(got, size);
  assert_memory_equal(found, bytes, size);
  free(found);
}

/* Decompress a tensor of 16-bit integers [rows, columns] (malloc). */
static int16_t *take_rows(const char *page, const char *name, size_t rows, size_t columns) {
  size_t size = 0;
  unsigned char *packed = take_bytes(page, name, &size);
  int16_t *counts = malloc(rows * columns * sizeof *counts);
  assert_non_null(counts);
  assert_int_equal(meshopt_decodeVertexBuffer(counts, rows, columns * sizeof *counts, packed, size),
                   0);
  free(packed);
  return counts;
}

/* Return the number called `name`, or the first number of the list called `name`, in the page. */
static double number_of(const char *page, const char *name) {
  char tag[64];
  (void)snprintf(tag, sizeof tag, "&quot;%s&quot;:", name);
  const char *at = strstr(page, tag);
  assert_non_null(at);
  at += strlen(tag);
  return strtod(at + (*at == '['), NULL);
}

/* Assert that positions and coefficients in the page are those of the basis, rounded to 16 bits.
 * The page normalises each vertex's direction of displacement to unit length, and multiplies its
 * coefficients by the original length. */
static void check_motion(const char *page, const supine_basis_info *s, const uint32_t *order) {
  const size_t n = s->vertex_count;
  const size_t modes = s->mode_count;
  const double place_unit = number_of(page, "placeUnit");
  const double unit = number_of(page, "unit");
  const double middle = number_of(page, "middle");
  int16_t *places = take_rows(page, "vertices", n, 4);
  int16_t *directions = take_rows(page, "direction", n, 4);
  int16_t *counts = take_rows(page, "coefficients", n, modes);
  meshopt_decodeFilterOct(directions, n, 4 * sizeof *directions);
  assert_true(place_unit > 0 && place_unit <= 0.005 && unit > 0 && unit <= 0.005);
  for (size_t i = 0; i < n; ++i) {
    const size_t v = order[i];
    const float *d = s->direction + 3 * v;
    const double length = hypot(hypot((double)d[0], (double)d[1]), (double)d[2]);
    assert_true(fabs(places[4 * i] * place_unit + middle - (double)s->vertices[3 * v]) <=
                0.5001 * place_unit);
    for (size_t axis = 0; axis < 3; ++axis) {
      assert_true(fabs(directions[4 * i + axis] / 32767.0 - (double)d[axis] / length) < 1e-4);
    }
    for (size_t k = 0; k < modes; ++k) {
      const double c = (double)s->coefficients[v * modes + k] * length;
      assert_true(fabs(counts[i * modes + k] * unit - c) <= 0.5001 * unit);
    }
  }
  free(places);
  free(directions);
  free(counts);
}

/* Assert that the page has every triangle once. A triangle may start at any of its corners. */
static void check_corners(const char *page, const uint32_t *corners, size_t count) {
  size_t size = 0;
  unsigned char *packed = take_bytes(page, "triangles", &size);
  uint32_t *found = malloc(count * sizeof *found);
  assert_non_null(found);
  assert_int_equal(meshopt_decodeIndexBuffer(found, count, sizeof *found, packed, size), 0);
  for (size_t t = 0; t < count; t += 3) {
    size_t matches = 0;
    for (size_t u = 0; u < count; ++u) {
      const size_t first = u / 3 * 3;
      matches += found[u] == corners[t] && found[first + (u + 1) % 3] == corners[t + 1] &&
                 found[first + (u + 2) % 3] == corners[t + 2];
    }
    assert_int_equal(matches, 1);
  }
  free(packed);
  free(found);
}

/* Open a basis, and find the order in which a page stores its vertices and triangles.
 * @param simplify  number of vertices to which the surface is reduced, or 0 */
static const supine_basis_info *open_in_order(const char *path, size_t simplify,
                                              supine_basis **opened, supine_arena *arena,
                                              export_order *order) {
  assert_int_equal(supine_basis_open(path, opened, NULL), SUPINE_OK);
  const supine_basis_info *info = supine_basis_get_info(*opened);
  assert_int_equal(supine_export_order_make(info, true, simplify, arena, order, NULL), SUPINE_OK);
  return info;
}

TEST(test_page_tensors_equal_basis) {
  assert_int_equal(EXPORT_RUN(text, basis, "-o", out), 0);
  char *page = read_page();
  supine_basis *opened = NULL;
  SUPINE_ARENA arena = {0};
  export_order order = {0};
  const supine_basis_info *s = open_in_order(basis, 0, &opened, &arena, &order);
  check_motion(page, s, order.vertex);
  check_corners(page, order.corners, 3 * s->triangle_count);
  check_tensor(page, "modes", s->modes, 6 * 16 * sizeof(double));
  check_tensor(page, "volume_linear", s->volume_linear, (size_t)2 * 3 * 6 * sizeof(double));
  check_tensor(page, "volume_quadratic", s->volume_quadratic, (size_t)2 * 3 * 36 * sizeof(double));
  check_tensor(page, "volume_cubic", s->volume_cubic, 2 * 216 * sizeof(double));
  assert_null(strstr(page, "{{"));
  assert_null(strstr(page, "src="));
  assert_null(strstr(page, "@import"));
  assert_says(page, "default-src 'none'");
  supine_basis_close(opened);
  free(page);
}

TEST(test_page_title_with_markup_escaped) {
  assert_int_equal(EXPORT_RUN(text, basis, "-o", out, "--title", "</script><b>&"), 0);
  char *page = read_page();
  assert_says(page, "<title>&lt;/script&gt;&lt;b&gt;&amp;</title>");
  assert_null(strstr(page, "</script><b>"));
  free(page);
}

TEST(test_page_too_many_modes_refused) {
  assert_int_equal(EXPORT_RUN(text, many, "-o", out), 3);
  assert_says(text, "--modes 128");
}

TEST(test_page_of_vector_basis_coefficients_equal_basis) {
  assert_int_equal(EXPORT_RUN(text, vector, "-o", out), 0);
  char *page = read_page();
  supine_basis *opened = NULL;
  SUPINE_ARENA arena = {0};
  export_order order = {0};
  const supine_basis_info *s = open_in_order(vector, 0, &opened, &arena, &order);
  const size_t n = s->vertex_count;
  const size_t k = s->mode_count;
  const size_t stride = (k + 1) / 2 * 2;
  const double unit = number_of(page, "unit");
  int16_t *counts = take_rows(page, "coefficients", 3 * n, stride); /* [3, n, stride] */
  for (size_t i = 0; i < 3 * n * k; ++i) {
    const size_t row = i / k;
    const size_t from = (3 * (size_t)order.vertex[row % n] + row / n) * k + i % k;
    const double c = (double)s->coefficients[from];
    assert_true(fabs(counts[row * stride + i % k] * unit - c) <= 0.5001 * unit);
  }
  assert_null(strstr(page, "tensor-direction"));
  supine_basis_close(opened);
  free(counts);
  free(page);
}

/* The page has the clusters as they are in the basis, and no coefficients. */
TEST(test_page_of_clusters_equals_basis) {
  char clusters[256];
  fixture *f = fixture_create(40, 5, 3, 2, true, true, 5, 4711);
  (void)snprintf(clusters, sizeof clusters, "%s/clusters", folder);
  fixture_add_clusters(f, 7, 5.5, 16);
  fixture_write(f, clusters);
  assert_int_equal(EXPORT_RUN(text, clusters, "-o", out), 0);
  char *page = read_page();
  supine_basis *opened = NULL;
  SUPINE_ARENA arena = {0};
  export_order order = {0};
  const supine_basis_info *s = open_in_order(clusters, 0, &opened, &arena, &order);
  int16_t *rows = take_rows(page, "clusters", s->vertex_count, 4);
  for (size_t i = 0; i < s->vertex_count; ++i) {
    const size_t v = order.vertex[i];
    assert_int_equal(rows[4 * i], s->cluster_scalars[2 * v]);
    assert_int_equal(rows[4 * i + 1], s->cluster_scalars[2 * v + 1]);
    assert_int_equal(rows[4 * i + 2], s->cluster[v]);
    assert_int_equal(rows[4 * i + 3], 0);
  }
  check_tensor(page, "cluster_vectors", f->cluster_vector,
               (size_t)7 * 5 * SUPINE_CLUSTER_NUMBERS * sizeof(float));
  assert_int_equal(number_of(page, "clusters"), 7);
  assert_null(strstr(page, "tensor-coefficients"));
  supine_basis_close(opened);
  fixture_destroy(f);
  free(rows);
  free(page);
}

/* Return the number after `before` in the text that the command printed. */
static double number_after(const char *printed, const char *before) {
  const char *at = strstr(printed, before);
  assert_non_null(at);
  return supine_number_parse(at + strlen(before), NULL);
}

TEST(test_page_simplified_vertices_are_original_rows) {
  char lungs[256];
  char whole[256];
  (void)snprintf(lungs, sizeof lungs, "%s/lungs.ply", folder);
  (void)snprintf(whole, sizeof whole, "%s/whole", folder);
  assert_int_equal(
      COMMAND_RUN(&supine_command_phantom, KEPT_BOTH, text, "--vertices", "3000", "-o", lungs), 0);
  assert_int_equal(COMMAND_RUN(&supine_command_precompute, KEPT_BOTH, text, lungs, "--held-out",
                               "9", "-o", whole),
                   0);
  assert_int_equal(EXPORT_RUN(text, whole, "-o", out, "--simplify", "600"), 0);
  char *page = read_page();
  supine_basis *opened = NULL;
  SUPINE_ARENA arena = {0};
  export_order order = {0};
  const supine_basis_info *s = open_in_order(whole, 600, &opened, &arena, &order);
  assert_true(order.vertex_count > 500 && order.vertex_count < 700);
  assert_int_equal(number_of(page, "vertices"), order.vertex_count);
  assert_int_equal(number_of(page, "wholeVertices"), s->vertex_count);
  const size_t n = order.vertex_count;
  const size_t stride = (s->mode_count + 1) / 2 * 2;
  const double unit = number_of(page, "unit");
  int16_t *counts = take_rows(page, "coefficients", n, stride);
  for (size_t i = 0; i < n * s->mode_count; ++i) { /* each kept vertex has the row it had */
    const size_t v = order.vertex[i / s->mode_count];
    const float *d = s->direction + 3 * v;
    const double reach = hypot(hypot((double)d[0], (double)d[1]), (double)d[2]);
    const double c = (double)s->coefficients[v * s->mode_count + i % s->mode_count] * reach;
    assert_true(fabs(counts[i / s->mode_count * stride + i % s->mode_count] * unit - c) <=
                0.5001 * unit);
  }
  for (size_t lung = 0; lung < s->lung_count; ++lung) { /* corners are vertices of the lung */
    for (size_t i = order.corner_begin[lung]; i < order.corner_begin[lung + 1]; ++i) {
      assert_in_range(order.corners[i], order.lung_begin[lung], order.lung_begin[lung + 1] - 1);
    }
    for (size_t i = order.lung_begin[lung]; i < order.lung_begin[lung + 1]; ++i) {
      assert_in_range(order.vertex[i], s->lung_begin[lung], s->lung_begin[lung + 1] - 1);
    }
  }
  double rms = 0.0;
  double largest = 0.0;
  assert_int_equal(supine_export_order_error(s, &order, &rms, &largest, NULL), SUPINE_OK);
  assert_true(rms > 0.0 && rms < 1.0 && largest > rms && largest < 8.0);
  assert_true(fabs(number_after(text, " vertices: ") - rms) < 0.00051);
  supine_basis_close(opened);
  free(counts);
  free(page);
}

TEST(test_page_simplified_to_more_vertices_refused) {
  assert_int_equal(EXPORT_RUN(text, basis, "-o", out, "--simplify", "100000"), 1);
  assert_says(text, "vertices: simplify to fewer than that");
}

TEST_GROUP(setup, teardown)
