/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test basis files: valid files open, and damaged files are refused. */
#include "tests/helpers/test.h"

#include <supine/runtime.h>
#include <supine/safetensors.h>

#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

/* Open a basis from a copy of exactly this size, so that a sanitizer sees any read past its end. */
static supine_status open_copy(const unsigned char *bytes, size_t size, supine_error *error) {
  unsigned char *copy = malloc(size == 0 ? 1 : size);
  assert_non_null(copy);
  memcpy(copy, bytes, size);
  supine_basis *basis = NULL;
  const supine_status status = supine_basis_open_memory(copy, size, &basis, error);
  assert_true((status == SUPINE_OK) == (basis != NULL));
  supine_basis_close(basis);
  free(copy);
  return status;
}

TEST(test_open_synthetic_basis_returns_written_content) {
  fixture *f = fixture_create(37, 7, 3, 3, false, true, 9, 1);
  char *folder = fixture_folder();
  char path[128];
  (void)snprintf(path, sizeof path, "%s/a.safetensors", folder);
  fixture_write(f, path);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open(path, &basis, NULL), SUPINE_OK);
  const supine_basis_info *info = supine_basis_get_info(basis);
  assert_int_equal(info->vertex_count, 37);
  assert_int_equal(info->triangle_count, f->triangles);
  assert_int_equal(info->mode_count, 7);
  assert_int_equal(info->band, 3);
  assert_int_equal(info->lung_count, 3);
  for (size_t i = 0; i <= 3; ++i) {
    assert_int_equal(info->lung_begin[i], 37 * i / 3);
  }
  assert_false(info->vector);
  assert_true(info->has_volume);
  assert_memory_equal(supine_basis_vertices(basis), f->vertex, 37 * 3 * sizeof(float));
  assert_memory_equal(supine_basis_triangles(basis), f->triangle,
                      f->triangles * 3 * sizeof(uint32_t));
  assert_string_equal(supine_basis_metadata(basis, "units"), "mm");
  assert_null(supine_basis_metadata(basis, "absent"));
  supine_basis_close(basis);
  supine_basis_close(NULL);
  fixture_folder_remove(folder);
  fixture_destroy(f);
}

TEST(test_open_every_truncation_refused) {
  fixture *f = fixture_create(11, 2, 1, 2, false, true, 9, 2);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  assert_int_equal(open_copy(bytes, size, NULL), SUPINE_OK);
  for (size_t length = 0; length < size; ++length) {
    assert_int_equal(open_copy(bytes, length, NULL), SUPINE_ERROR_FORMAT);
  }
  unsigned char *longer = calloc(size + 8, 1);
  assert_non_null(longer);
  memcpy(longer, bytes, size);
  for (size_t extra = 1; extra <= 8; ++extra) {
    assert_int_equal(open_copy(longer, size + extra, NULL), SUPINE_ERROR_FORMAT);
  }
  free(longer);
  free(bytes);
  fixture_destroy(f);
}

/* Assert that two basis files hold the same basis. */
static void assert_same_basis(const unsigned char *a, const unsigned char *b, size_t size) {
  supine_basis *left = NULL;
  supine_basis *right = NULL;
  assert_int_equal(supine_basis_open_memory(a, size, &left, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_open_memory(b, size, &right, NULL), SUPINE_OK);
  const supine_basis_info *x = supine_basis_get_info(left);
  const supine_basis_info *y = supine_basis_get_info(right);
  assert_int_equal(x->vertex_count, y->vertex_count);
  assert_int_equal(x->triangle_count, y->triangle_count);
  assert_int_equal(x->mode_count, y->mode_count);
  assert_int_equal(x->band, y->band);
  assert_int_equal(x->lung_count, y->lung_count);
  assert_int_equal(x->vector, y->vector);
  assert_int_equal(x->has_volume, y->has_volume);
  static const char *const keys[] = {"format", "version", "kind", "units", "checksum"};
  for (size_t i = 0; i < sizeof keys / sizeof *keys; ++i) {
    assert_string_equal(supine_basis_metadata(left, keys[i]),
                        supine_basis_metadata(right, keys[i]));
  }
  double weights[2][SUPINE_MODES_MAX];
  const double gravity[3] = {0.48, -0.6, 0.64};
  assert_int_equal(supine_basis_weights(left, gravity, weights[0]), SUPINE_OK);
  assert_int_equal(supine_basis_weights(right, gravity, weights[1]), SUPINE_OK);
  assert_memory_equal(weights[0], weights[1], x->mode_count * sizeof(double));
  const double scales[SUPINE_LUNGS_MAX] = {1.5, 2.5};
  float *xyz = calloc(6 * x->vertex_count, sizeof *xyz);
  assert_non_null(xyz);
  supine_deform(left, POSED(left, weights[0], scales), xyz);
  supine_deform(right, POSED(right, weights[1], scales), xyz + 3 * x->vertex_count);
  assert_memory_equal(xyz, xyz + 3 * x->vertex_count, 3 * x->vertex_count * sizeof *xyz);
  free(xyz);
  supine_basis_close(left);
  supine_basis_close(right);
}

TEST(test_open_every_flipped_bit_refused_or_same) {
  fixture *f = fixture_create(11, 2, 1, 2, false, true, 9, 3);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  unsigned char *damaged = malloc(size);
  assert_non_null(damaged);
  memcpy(damaged, bytes, size);
  uint64_t header = 0;
  memcpy(&header, bytes, 8);
  size_t accepted = 0;
  for (size_t bit = 0; bit < 8 * size; ++bit) {
    damaged[bit / 8] ^= (unsigned char)(1U << bit % 8);
    const supine_status status = open_copy(damaged, size, NULL);
    if (status == SUPINE_OK) {
      /* Changes of the header or its length may go undetected; changes of the data must not. */
      assert_true(bit / 8 < 8 + header);
      assert_same_basis(bytes, damaged, size);
      ++accepted;
    } else {
      assert_int_equal(status, SUPINE_ERROR_FORMAT);
    }
    damaged[bit / 8] ^= (unsigned char)(1U << bit % 8);
  }
  /* Only the white space that pads the header may change unnoticed. */
  assert_true(accepted <= 8);
  /* Try other values of each byte of the header. */
  for (size_t i = 0; i < 8 + header; ++i) {
    for (unsigned value = 0; value < 256; value += 7) {
      damaged[i] = (unsigned char)value;
      if (damaged[i] != bytes[i] && open_copy(damaged, size, NULL) == SUPINE_OK) {
        assert_same_basis(bytes, damaged, size);
      }
    }
    damaged[i] = bytes[i];
  }
  free(damaged);
  free(bytes);
  fixture_destroy(f);
}

/* Change a fixture by `spoil`, and assert that its file is refused for this reason. */
static void expect_refused(void (*spoil)(fixture *), const char *reason) {
  fixture *f = fixture_create(12, 3, 1, 2, false, true, 9, 4);
  spoil(f);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_error error = {0};
  assert_int_equal(open_copy(bytes, size, &error), SUPINE_ERROR_FORMAT);
  assert_says(error.message, reason);
  free(bytes);
  fixture_destroy(f);
}

static void spoil_triangle(fixture *f) {
  f->triangle[5] = (uint32_t)f->vertices;
}
static void spoil_vertex(fixture *f) {
  f->vertex[35] = NAN;
}
static void spoil_direction(fixture *f) {
  f->direction[0] = INFINITY;
}
static void spoil_coefficient(fixture *f) {
  f->coefficient[35] = -INFINITY;
}
static void spoil_mode(fixture *f) {
  f->mode[11] = (double)NAN;
}

/* Make a coefficient finite, but so large that positions would overflow. */
static void spoil_mode_size(fixture *f) {
  f->mode[11] = 1e277;
}

static void spoil_coefficient_size(fixture *f) {
  f->coefficient[11] = 0x1p30F;
}
static void spoil_linear(fixture *f) {
  f->linear[5] = (double)NAN;
}
static void spoil_quadratic(fixture *f) {
  f->quadratic[17] = (double)INFINITY;
}
static void spoil_cubic(fixture *f) {
  f->cubic[53] = (double)NAN;
}
static void spoil_resting(fixture *f) {
  static const double resting[18] = {-900, 0, 0, 0, 0, 0, 0, 0, (double)NAN, -900};
  f->resting = resting;
}
static void spoil_resting_size(fixture *f) {
  static const double resting[18] = {-900, 0x1p30, 0, 0, 0, 0, 0, 0, 0, -900};
  f->resting = resting;
}
static void spoil_lung_order(fixture *f) {
  f->lung[11] = 0;
}
static void spoil_lung_gap(fixture *f) {
  for (size_t i = 6; i < 12; ++i) {
    f->lung[i] = 2;
  }
}
static void spoil_lung_first(fixture *f) {
  f->lung[0] = 1;
}

TEST(test_open_wrong_content_refused_with_reason) {
  expect_refused(spoil_triangle,
                 "a triangle refers to vertex 12, but the number of vertices is 12");
  expect_refused(spoil_vertex, "'vertices' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_direction, "'direction' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_coefficient,
                 "'coefficients' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_mode, "'modes' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_mode_size, "'modes' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_coefficient_size,
                 "'coefficients' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_linear, "'volume_linear' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_quadratic,
                 "'volume_quadratic' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_cubic, "'volume_cubic' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_resting,
                 "'resting_volume' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_resting_size,
                 "'resting_volume' has a number that is not finite, or 2^30 or more");
  expect_refused(spoil_lung_order, "grouped by lung");
  expect_refused(spoil_lung_gap, "vertex 6 belongs to lung 2");
  expect_refused(spoil_lung_first, "vertex 0 belongs to lung 1");
}

typedef struct parts {
  supine_tensor tensors[10];
  size_t tensor_count;
  supine_metadata metadata[5];
  size_t metadata_count;
  const char *message; /* text that the error message must contain; NULL: the path */
} parts;

static const float zeros[64] = {0};
static const double zeros64[64] = {0};
static const float corners[64] = {0, 0, 0, 100, 0, 0, 0, 100, 0, 0, 0, 100}; /* mm */
static const uint32_t faces[16] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
/* Volume at rest minus that of the tetrahedron, 167 mL: -100 mL, divided by Y(0, 0). */
static const double resting[18] = {-354, 0, 0, 0, 0, 0, 0, 0, 0, -354};

/* Return a valid basis of a tetrahedron and one mode. */
static parts sound(void) {
  return (parts){.tensors = {{"vertices", SUPINE_F32, 2, {4, 3}, corners},
                             {"triangles", SUPINE_U32, 2, {4, 3}, faces},
                             {"direction", SUPINE_F32, 2, {4, 3}, zeros},
                             {"coefficients", SUPINE_F32, 2, {4, 1}, zeros},
                             {"modes", SUPINE_F64, 3, {1, 4, 1}, zeros64},
                             {"lung", SUPINE_U8, 1, {4}, zeros},
                             {"volume_linear", SUPINE_F64, 3, {1, 3, 1}, zeros64},
                             {"volume_quadratic", SUPINE_F64, 4, {1, 3, 1, 1}, zeros64},
                             {"volume_cubic", SUPINE_F64, 4, {1, 1, 1, 1}, zeros64}},
                 .tensor_count = 9,
                 .metadata = {{"format", "supine-basis"}, {"version", "4"}, {"kind", "scalar"}},
                 .metadata_count = 3};
}

static supine_status open_parts(const parts *p) {
  char *folder = fixture_folder();
  char path[128];
  (void)snprintf(path, sizeof path, "%s/a", folder);
  assert_int_equal(supine_safetensors_write(path, p->tensors, p->tensor_count, p->metadata,
                                            p->metadata_count, NULL),
                   SUPINE_OK);
  supine_basis *basis = NULL;
  supine_error error = {0};
  const supine_status status = supine_basis_open(path, &basis, &error);
  assert_true(status == SUPINE_OK ||
              strstr(error.message, p->message != NULL ? p->message : path) != NULL);
  supine_basis_close(basis);
  fixture_folder_remove(folder);
  return status;
}

TEST(test_open_wrong_structure_refused) {
  parts p = sound();
  assert_int_equal(open_parts(&p), SUPINE_OK);
  for (size_t i = 0; i < 9; ++i) { /* each tensor in turn is missing or has another type */
    p = sound();
    p.tensors[i].name = "other";
    assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
    p = sound();
    p.tensors[i].dtype = p.tensors[i].dtype == SUPINE_U8 ? SUPINE_U32 : SUPINE_U8;
    assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
    /* Make each axis in turn too long or empty. */
    for (size_t axis = 0; axis < p.tensors[i].rank; ++axis) {
      p = sound();
      p.tensors[i].shape[axis] += 1;
      const bool free_axis = (i == 1 && axis == 0);
      assert_int_equal(open_parts(&p), free_axis ? SUPINE_OK : SUPINE_ERROR_FORMAT);
      p.tensors[i].shape[axis] = 0;
      assert_int_equal(open_parts(&p), free_axis ? SUPINE_OK : SUPINE_ERROR_FORMAT);
    }
  }
  for (size_t i = 0; i < 3; ++i) { /* each metadata string in turn is changed or missing */
    p = sound();
    p.metadata[i].value = "other";
    assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
    p.metadata[i].key = "other";
    assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  }
  for (char version = '0'; version <= '9'; ++version) {
    const char text[2] = {version, '\0'};
    p = sound();
    p.metadata[1].value = text;
    p.message = "this library reads version 4";
    assert_int_equal(open_parts(&p), version == '4' ? SUPINE_OK : SUPINE_ERROR_FORMAT);
  }
  p = sound(); /* Volumes at rest are optional. They have nine coefficients for each lung. */
  p.tensors[p.tensor_count++] = (supine_tensor){"resting_volume", SUPINE_F64, 2, {1, 9}, resting};
  assert_int_equal(open_parts(&p), SUPINE_OK);
  p.tensors[9].dtype = SUPINE_F32;
  assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  for (size_t terms = 4; terms <= 16; terms += 4) {
    p.tensors[9] = (supine_tensor){"resting_volume", SUPINE_F64, 2, {1, terms}, resting};
    assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  }
  p.tensors[9] = (supine_tensor){"resting_volume", SUPINE_F64, 1, {9}, resting};
  assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  p.tensors[9] = (supine_tensor){"resting_volume", SUPINE_F64, 2, {2, 9}, resting};
  assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  /* If the modes are of the kind `vector`, coefficients are [N, 3, modes], not [N, modes]. */
  p = sound();
  p.metadata[2].value = "vector";
  assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  p.tensors[3] = (supine_tensor){"coefficients", SUPINE_F32, 3, {4, 3, 1}, zeros};
  assert_int_equal(open_parts(&p), SUPINE_OK);
  /* A basis without volume forms, the three tensors volume_linear to volume_cubic, is valid. */
  p = sound();
  p.tensor_count = 6;
  assert_int_equal(open_parts(&p), SUPINE_OK);
  p.tensor_count = 7;
  assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
}

TEST(test_open_implausible_metadata_refused) {
  static const char *const wrong[][2] = {
      {"scan_gravity", "0,0,0"},
      {"scan_gravity", "0,5,0"},
      {"full_upright_gain", "7"},
      {"full_upright_gain", "-0.1"},
      {"scan_volume_ml", "1e10"},
      {"midline_mm", "-1e8"},
      {"expected_error_mm", "0"},
      {"expected_error_mm", "nan"},
      {"expected_error_mm", "4.5,4.5"},
      {"expected_error_from_mm", ""},
      {"resting_spread", "-0.17"},
      {"resting_spread", "1e300"},
      {"bend", "0,1e9,0"},
      {"bend", "0,inf,0"},
      {"lung_hilum_mm", "1,2"},
      {"lung_hilum_mm", "1,2,1e9"},
  };
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
    parts p = sound();
    p.tensors[p.tensor_count++] = (supine_tensor){"resting_volume", SUPINE_F64, 2, {1, 9}, resting};
    assert_int_equal(open_parts(&p), SUPINE_OK);
    p.metadata[p.metadata_count++] = (supine_metadata){wrong[i][0], wrong[i][1]};
    p.message = strcmp(wrong[i][0], "midline_mm") == 0 ? "midline" : wrong[i][0];
    assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  }
}

TEST(test_open_implausible_collapse_refused) {
  static const char *const expansions[] = {"-0.5", "101", "nan", "0.5,0.5", "0.26"};
  for (size_t i = 0; i < sizeof expansions / sizeof *expansions; ++i) {
    parts p = sound();
    p.metadata[p.metadata_count++] = (supine_metadata){"lung_expansion", expansions[i]};
    p.metadata[p.metadata_count++] = (supine_metadata){"lung_hilum_mm", "10,20,30"};
    p.message = "lung_expansion";
    const bool good = i + 1 == sizeof expansions / sizeof *expansions;
    assert_int_equal(open_parts(&p), good ? SUPINE_OK : SUPINE_ERROR_FORMAT);
  }
}

/* Open a basis with one row of volumes at rest, of which the first number is given. */
static supine_status open_rest(double first, const char *message) {
  const double row[9] = {first};
  parts p = sound();
  p.tensors[p.tensor_count++] = (supine_tensor){"resting_volume", SUPINE_F64, 2, {1, 9}, row};
  p.message = message;
  return open_parts(&p);
}

TEST(test_open_implausible_volumes_refused) {
  const double large[1] = {1.05e9};
  assert_int_equal(open_rest(-354, NULL), SUPINE_OK);
  assert_int_equal(open_rest(-1e-300, "differs from the reference volume by only"),
                   SUPINE_ERROR_FORMAT);
  assert_int_equal(open_rest(0, "differs from the reference volume by only"), SUPINE_ERROR_FORMAT);
  assert_int_equal(open_rest(-620, "mL at rest in a posture"), SUPINE_ERROR_FORMAT);
  assert_int_equal(open_rest(1e6, "mL at rest in a posture"), SUPINE_ERROR_FORMAT);
  for (size_t i = 6; i < 9; ++i) {
    parts p = sound();
    p.tensors[i].data = large;
    p.message = "a coefficient of the volumes is 1.05e+09 mL";
    assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  }
}

TEST(test_open_implausible_tensors_refused) {
  static const double large[4] = {1e8};
  static const float far[12] = {0, 2e7F};
  static const float infinite[1] = {INFINITY};
  static const uint32_t part[4] = {0, 1, 2, 1};
  parts p = sound();
  p.tensors[4].data = large;
  p.message = "modes have weights of up to";
  assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  p = sound();
  p.tensors[0].data = far;
  p.message = "from the origin";
  assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  p = sound(); /* a tensor that the library does not read */
  p.tensors[p.tensor_count++] = (supine_tensor){"other", SUPINE_F32, 1, {1}, infinite};
  p.message = "'other' has a number that is not finite";
  assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
  p = sound();
  p.tensor_count = 6; /* an open surface, with names */
  p.tensors[p.tensor_count++] = (supine_tensor){"part", SUPINE_U32, 1, {4}, part};
  p.tensors[p.tensor_count++] = (supine_tensor){"names", SUPINE_U8, 1, {5}, "a\nb\nc"};
  assert_int_equal(open_parts(&p), SUPINE_OK);
  p.tensors[7].shape[0] = 3;
  p.message = "vertex 2 has name 2, but tensor 'names' has 2";
  assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
}

TEST(test_open_damaged_content_remedy_is_embed) {
  parts p = sound();
  p.metadata[p.metadata_count++] = (supine_metadata){"content", "points"};
  p.tensors[0].dtype = SUPINE_F64;
  p.message = "embed its content again";
  assert_int_equal(open_parts(&p), SUPINE_ERROR_FORMAT);
}

TEST(test_open_too_many_modes_or_bands_refused) {
  fixture *f = fixture_create(5, SUPINE_MODES_MAX, 0, 1, false, false, 1, 6);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  assert_int_equal(open_copy(bytes, size, NULL), SUPINE_OK);
  free(bytes);
  fixture_destroy(f);
  f = fixture_create(5, SUPINE_MODES_MAX + 1, 0, 1, false, false, 1, 6);
  bytes = fixture_bytes(f, &size);
  assert_int_equal(open_copy(bytes, size, NULL), SUPINE_ERROR_FORMAT);
  free(bytes);
  fixture_destroy(f);
  f = fixture_create(5, 1, 64, 1, false, false, 1, 6);
  bytes = fixture_bytes(f, &size);
  assert_int_equal(open_copy(bytes, size, NULL), SUPINE_OK);
  free(bytes);
  fixture_destroy(f);
  f = fixture_create(5, 1, 65, 1, false, false, 1, 6);
  bytes = fixture_bytes(f, &size);
  assert_int_equal(open_copy(bytes, size, NULL), SUPINE_ERROR_FORMAT);
  free(bytes);
  fixture_destroy(f);
  f = fixture_create(17, 1, 0, 16, false, false, 1, 6);
  bytes = fixture_bytes(f, &size);
  assert_int_equal(open_copy(bytes, size, NULL), SUPINE_OK);
  free(bytes);
  fixture_destroy(f);
}

TEST(test_open_foreign_files_refused) {
  static const struct {
    const char *text;
    size_t size;
  } cases[] = {
      {"", 0},
      {"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", 50},
      {"solid lung\nendsolid lung\n", 25},
      {"{\"json\": true}", 14},
      {"\x02\0\0\0\0\0\0\0{}", 10},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    supine_error error = {0};
    assert_int_equal(open_copy((const unsigned char *)cases[i].text, cases[i].size, &error),
                     SUPINE_ERROR_FORMAT);
    assert_true(strlen(error.message) > 0);
  }
  supine_basis *basis = NULL;
  supine_error error;
  assert_int_equal(supine_basis_open("/nonexistent/basis", &basis, &error), SUPINE_ERROR_READ);
  assert_says(error.message, "/nonexistent/basis");
  assert_int_equal(supine_basis_open("/tmp", &basis, &error), SUPINE_ERROR_READ);
}

static void check_view(bool vector, bool volume) {
  fixture *f = fixture_create(26, 3, 1, 2, vector, volume, 9, 41);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_memory(bytes, size, &basis, NULL), SUPINE_OK);
  const supine_basis_info *info = supine_basis_get_info(basis);
  assert_memory_equal(info->vertices, f->vertex, 3 * f->vertices * sizeof(float));
  assert_memory_equal(info->triangles, f->triangle, 3 * f->triangles * sizeof(uint32_t));
  assert_memory_equal(info->coefficients, f->coefficient,
                      (vector ? 9 : 3) * f->vertices * sizeof(float));
  assert_memory_equal(info->modes, f->mode, 3 * 4 * sizeof(double));
  assert_true((info->direction == NULL) == vector);
  assert_true((info->volume_linear != NULL) == volume);
  if (!vector) {
    assert_memory_equal(info->direction, f->direction, 3 * f->vertices * sizeof(float));
  }
  for (size_t lung = 0; lung < 2; ++lung) {
    float box[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 3 * f->lung_begin[lung]; i < 3 * f->lung_begin[lung + 1]; ++i) {
      box[i % 3] = fminf(box[i % 3], f->vertex[i]);
      box[3 + i % 3] = fmaxf(box[3 + i % 3], f->vertex[i]);
    }
    assert_memory_equal(info->bounds + 6 * lung, box, sizeof box);
    /* Lungs without names in the file are numbered. */
    assert_string_equal(info->lung_names[lung], lung == 0 ? "0" : "1");
  }
  const supine_tensor *lung = supine_basis_tensor(basis, "lung");
  assert_non_null(lung);
  assert_memory_equal(lung->data, f->lung, f->vertices);
  assert_null(supine_basis_tensor(basis, "lungs"));
  if (volume) {
    const double w[3] = {0.3, -1.1, 0.7};
    supine_pose pose = {.weights = {w[0], w[1], w[2]}};
    double held[2];
    supine_pose_fill(&pose, 1.3);
    supine_basis_volumes(basis, &pose, held);
    for (size_t j = 0; j < 2; ++j) {
      const double said = info->reference_volume[j] + posed_lung_volume(basis, j, w, 1.3);
      assert_true(fabs(held[j] - said) <= 1e-12 * fabs(said));
    }
  }
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

TEST(test_pose_gain_beyond_limits_refused_unless_allowed) {
  fixture *f = fixture_create(200, 4, 2, 2, false, true, 10.0, 5);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  const double gravity[3] = {0, -2, 0};
  static const double none[3] = {0};
  for (int allowed = 0; allowed < 2; ++allowed) {
    const supine_basis_options options = {sizeof options, .allow_folds = allowed == 1};
    supine_basis *basis = NULL;
    supine_pose pose;
    supine_pose wanted = {.basis = 0};
    supine_error error;
    assert_int_equal(supine_basis_open_memory_with(bytes, size, &options, &basis, NULL), SUPINE_OK);
    assert_int_equal(supine_basis_pose_gain(basis, gravity, 1.3, &pose, &error), SUPINE_OK);
    assert_int_equal(supine_basis_weights(basis, gravity, wanted.weights), SUPINE_OK);
    supine_pose_fill(&wanted, 1.3);
    wanted.basis = supine_basis_get_info(basis)->identity;
    assert_memory_equal(&pose, &wanted, sizeof pose);
    const supine_status status = supine_basis_pose_gain(basis, gravity, -9.81, &pose, &error);
    assert_int_equal(status, allowed == 1 ? SUPINE_OK : SUPINE_ERROR_NUMERICAL);
    if (allowed == 0) {
      assert_non_null(strstr(error.message, "outside -5 to 5: give a smaller gain"));
      assert_string_equal(error.remedies[0].argument, "allow_folds");
    } else {
      const supine_state state = {.gravity = {0, -2, 0}};
      supine_findings findings = {.count = 0};
      supine_basis_tell(basis, &state, &pose, &findings);
      assert_int_equal(findings.count, 1);
      assert_string_equal(findings.list[0].text,
                          "prone: the gain -9.81 multiplies every displacement, outside -5 to 5");
    }
    assert_int_equal(supine_basis_pose_gain(basis, gravity, NAN, &pose, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_int_equal(supine_basis_pose_gain(basis, none, 1.0, &pose, &error),
                     SUPINE_ERROR_ARGUMENT);
    supine_basis_close(basis);
  }
  free(bytes);
  fixture_destroy(f);
}

/* Create two lungs that grow with the gain, the second one slightly less, and that hold `share` of
 * their reference volumes at most. */
static fixture *create_growing(double share, double held[27][2][2]) {
  fixture *f = fixture_create_shrinking(200, 2, 5);
  for (size_t i = 3 * f->lung_begin[1]; i < 3 * f->vertices; ++i) {
    f->direction[i] *= 0.98F;
  }
  fixture_add_forms(f);
  double *reference = fixture_allocate(3 * f->vertices, sizeof *reference);
  for (size_t i = 0; i < 3 * f->vertices; ++i) {
    reference[i] = (double)f->vertex[i];
  }
  for (size_t lung = 0; lung < 2; ++lung) {
    const double volume = fixture_volume(f, lung, reference);
    for (size_t node = 0; node < 27; ++node) {
      held[node][lung][0] = 0.1 * volume;
      held[node][lung][1] = share * volume;
    }
  }
  free(reference);
  f->resting = resting;
  f->held = held[0][0];
  return f;
}

/* A lung that was found not to fold up to the largest volume that is tried may pass it a little,
 * while the volume of both stays below; a lung that folds before may not. */
TEST(test_pose_gain_beyond_tried_volumes_taken_unless_folds) {
  static const double gravity[3] = {1, 0, 0};
  static const double gain = 0.3142; /* (1 + 0.2 gain)^3 = 1.2006 */
  for (int folds = 0; folds < 2; ++folds) {
    double held[27][2][2];
    size_t size = 0;
    fixture *f = create_growing(folds == 1 ? 1.19 : 1.2, held);
    unsigned char *bytes = fixture_bytes(f, &size);
    supine_basis *basis = NULL;
    supine_pose pose;
    supine_error error;
    double volumes[2];
    assert_int_equal(supine_basis_open_memory(bytes, size, &basis, &error), SUPINE_OK);
    assert_int_equal(supine_basis_pose_gain(basis, gravity, gain, &pose, &error),
                     folds == 1 ? SUPINE_ERROR_NUMERICAL : SUPINE_OK);
    if (folds == 1) {
      assert_non_null(strstr(error.message, "the surface folds"));
    } else {
      assert_int_equal(supine_basis_volumes(basis, &pose, volumes), SUPINE_OK);
      assert_true(volumes[0] > 1.2 * supine_basis_get_info(basis)->reference_volume[0]);
    }
    assert_int_equal(supine_basis_pose_gain(basis, gravity, 0.33, &pose, &error),
                     SUPINE_ERROR_NUMERICAL);
    assert_non_null(strstr(error.message, "of full inflation"));
    supine_basis_close(basis);
    free(bytes);
    fixture_destroy(f);
  }
}

TEST(test_accessors_open_basis_equal_file) {
  check_view(false, true);
  check_view(true, true);
  check_view(false, false);
}

TEST(test_version_library_equals_headers) {
  int part[3] = {0};
  char text[32];
  assert_string_equal(supine_version(), SUPINE_VERSION);
  assert_int_equal(sscanf(supine_version(), "%d.%d.%d", &part[0], &part[1], &part[2]), 3);
  assert_int_equal(10000 * part[0] + 100 * part[1] + part[2], SUPINE_VERSION_NUMBER);
  (void)snprintf(text, sizeof text, "%d.%d.%d", part[0], part[1], part[2]);
  assert_string_equal(text, SUPINE_VERSION);
}

TEST(test_weights_bad_gravity_refused) {
  fixture *f = fixture_create(5, 2, 1, 1, false, false, 1, 6);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_memory(bytes, size, &basis, NULL), SUPINE_OK);
  double weights[2];
  assert_int_equal(supine_basis_weights(basis, (double[]){0, 0, 0}, weights),
                   SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_basis_weights(basis, (double[]){0, (double)NAN, 0}, weights),
                   SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_basis_weights(basis, (double[]){0, 2.5, 0}, weights), SUPINE_OK);
  /* Y(0,0), Y(1,-1), Y(1,0) and Y(1,1) at (0,1,0), in the order of sh.h. */
  const double y[4] = {0.28209479177387814, 0.48860251190291992, 0, 0};
  for (size_t k = 0; k < 2; ++k) {
    double want = 0;
    for (size_t i = 0; i < 4; ++i) {
      want += f->mode[4 * k + i] * y[i];
    }
    assert_true(fabs(weights[k] - want) <= 1e-15);
  }
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}
