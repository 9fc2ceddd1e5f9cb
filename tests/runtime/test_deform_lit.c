/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that normals equal the weighted sum of their modes, computed in double precision. */
#include "tests/helpers/test.h"

#include <supine/runtime.h>

#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

enum { VERTICES = 211, MODES = 5, BATCH = 3 };

/* Bound on the relative rounding error of a sum of up to 66 products, divided by a square root. */
static const double rounding = 66 * 0x1p-23;

/* Return the largest error from packing the numbers of a mode in fewer bits, in units of the 16-bit
 * numbers of the file. The first third of the modes gets 13 bits, the second 10 and the last 9. */
static double packed_error(size_t mode, size_t modes) {
  static const double bits[] = {13, 10, 9};
  const double limit = 256.0 / 255 * INT16_MAX;
  return limit * pow(2, -bits[mode / ((modes + 2) / 3)]);
}

typedef struct opened {
  fixture *f;
  unsigned char *bytes;
  supine_basis *basis;
  double weights[BATCH * MODES];
  double scales[BATCH * 2];
} opened;

static opened open_lit(size_t normals, supine_simd simd) {
  opened o = {.f = fixture_create(VERTICES, MODES, 2, 2, false, true, 9, 31)};
  size_t size = 0;
  uint64_t random = 17;
  if (normals > 0) {
    fixture_add_normals(o.f, normals, 5);
    /* gives vertex 40 the normal 0, like a vertex without triangles */
    memset(o.f->normal + 3 * normals * 40, 0, 3 * normals * sizeof *o.f->normal);
  }
  o.bytes = fixture_bytes(o.f, &size);
  const supine_basis_options options = {sizeof options, .simd = simd};
  const supine_status status =
      supine_basis_open_memory_with(o.bytes, size, &options, &o.basis, NULL);
  assert_true(status == SUPINE_OK || status == SUPINE_ERROR_UNSUPPORTED);
  for (size_t i = 0; i < BATCH * MODES; ++i) {
    o.weights[i] = fixture_random(&random);
  }
  for (size_t i = 0; i < BATCH * 2; ++i) {
    o.scales[i] = 1 + 0.5 * fixture_random(&random);
  }
  return o;
}

static void drop(opened *o) {
  supine_basis_close(o->basis);
  free(o->bytes);
  fixture_destroy(o->f);
}

/* Compute the weights v of the modes of a lung's surface normals: polynomials of degree 2 in s
 * w[k], with the weights w of the displacement modes and the factor s on the lung's displacement.
 */
static void expected_weights(const fixture *f, size_t lung, const double *w, double s, double *v) {
  const size_t terms = (MODES + 1) * (MODES + 2) / 2;
  for (size_t j = 0; j < f->normals; ++j) {
    const double *form = f->normal_weight + (lung * f->normals + j) * terms;
    double q[MODES + 1] = {1};
    size_t at = 0;
    for (size_t k = 0; k < MODES; ++k) {
      q[k + 1] = s * w[k];
    }
    v[j] = 0;
    for (size_t k = 0; k <= MODES; ++k) {
      for (size_t l = k; l <= MODES; ++l) {
        v[j] += form[at++] * q[k] * q[l];
      }
    }
  }
}

/* Compute the unit normal n of vertex i. Return a bound on the error of each coordinate. */
static double expected_normal(const fixture *f, size_t i, const double *w, const double *s,
                              double *n) {
  double off = 0;
  double v[SUPINE_NORMAL_MODES_MAX];
  expected_weights(f, f->lung[i], w, s[f->lung[i]], v);
  for (size_t axis = 0; axis < 3; ++axis) {
    n[axis] = 0;
    for (size_t j = 0; j < f->normals; ++j) {
      n[axis] += v[j] * f->normal[(3 * i + axis) * f->normals + j];
    }
  }
  for (size_t j = 0; j < f->normals; ++j) {
    off += fabs(v[j]) * packed_error(j, f->normals);
  }
  const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  for (size_t axis = 0; axis < 3; ++axis) {
    n[axis] = length > 0 ? n[axis] / length : 0;
  }
  /* If two vectors differ by d, their unit vectors differ by at most 2 |d| / length of the first.
   * Here no coordinate of d exceeds `off`, so |d| <= sqrt(3) off. */
  return length > 0 ? 2 * sqrt(3.0) * off / length + rounding : 0;
}

static void check_formula(size_t normals, supine_simd simd) {
  opened o = open_lit(normals, simd);
  if (o.basis != NULL) {
    float xyz[3 * VERTICES];
    float lit[3 * VERTICES];
    float plain[3 * VERTICES];
    double v[2 * SUPINE_NORMAL_MODES_MAX];
    assert_int_equal(supine_basis_get_info(o.basis)->normal_count, normals);
    assert_int_equal(supine_deform_lit(o.basis, POSED(o.basis, o.weights, o.scales), xyz, lit),
                     SUPINE_OK);
    supine_deform(o.basis, POSED(o.basis, o.weights, o.scales), plain);
    assert_memory_equal(xyz, plain, sizeof xyz);
    for (size_t i = 0; i < VERTICES; ++i) {
      double n[3];
      const double near = expected_normal(o.f, i, o.weights, o.scales, n);
      for (size_t axis = 0; axis < 3; ++axis) {
        assert_true(fabs((double)lit[3 * i + axis] - n[axis]) <= near);
      }
    }
    supine_basis_normal_weights(o.basis, POSED(o.basis, o.weights, o.scales), v);
    for (size_t lung = 0; lung < 2; ++lung) {
      double want[SUPINE_NORMAL_MODES_MAX];
      expected_weights(o.f, lung, o.weights, o.scales[lung], want);
      for (size_t j = 0; j < normals; ++j) {
        assert_true(fabs(v[lung * normals + j] - want[j]) <= 1e-18 + 1e-12 * fabs(want[j]));
      }
    }
  }
  drop(&o);
}

TEST(test_deform_lit_every_instruction_set_equals_formula) {
  static const size_t numbers[] = {1, 2, 3, 6, 8, 9, 12, 20, 64};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; ++i) {
    for (int simd = SUPINE_SIMD_AUTO; simd < SUPINE_SIMD_COUNT; ++simd) {
      check_formula(numbers[i], (supine_simd)simd);
    }
  }
}

TEST(test_deform_lit_range_same_bits_as_whole) {
  for (int simd = SUPINE_SIMD_AUTO; simd < SUPINE_SIMD_COUNT; ++simd) {
    opened o = open_lit(8, (supine_simd)simd);
    float whole[3 * VERTICES];
    for (size_t begin = 0; o.basis != NULL && begin < VERTICES; begin += 13) {
      assert_int_equal(supine_deform_lit(o.basis, POSED(o.basis, o.weights, o.scales), NULL, whole),
                       SUPINE_OK);
      for (size_t end = begin; end <= VERTICES; end += 11) {
        float part[3 * VERTICES + 1];
        part[3 * (end - begin)] = 12345;
        assert_int_equal(supine_deform_lit_range(o.basis, POSED(o.basis, o.weights, o.scales),
                                                 begin, end, NULL, part),
                         SUPINE_OK);
        assert_memory_equal(part, whole + 3 * begin, 3 * (end - begin) * sizeof *part);
        assert_true(part[3 * (end - begin)] == 12345); /* nothing is written beyond the range */
      }
    }
    drop(&o);
  }
}

/* Compare what supine_deform_lit writes with supine_deform and supine_normals, whole and in
 * parts. */
static void expect_triangle_normals(const supine_basis *basis, const supine_pose *pose) {
  float xyz[3 * VERTICES];
  float normals[3 * VERTICES];
  float part[3 * VERTICES];
  float truth[2][3 * VERTICES];
  assert_int_equal(supine_deform(basis, pose, truth[0]), SUPINE_OK);
  supine_normals(basis, truth[0], truth[1]);
  assert_int_equal(supine_deform_lit(basis, pose, xyz, normals), SUPINE_OK);
  assert_memory_equal(xyz, truth[0], sizeof xyz);
  assert_memory_equal(normals, truth[1], sizeof normals);
  for (size_t begin = 0; begin < VERTICES; begin += 17) {
    const size_t end = begin + 17 < VERTICES ? begin + 17 : VERTICES;
    assert_int_equal(
        supine_deform_lit_range(basis, pose, begin, end, begin % 2 == 0 ? xyz : NULL, part),
        SUPINE_OK);
    for (size_t i = 0; i < 3 * (end - begin); ++i) {
      assert_close(part[i], truth[1][3 * begin + i], 1e-6);
    }
  }
}

TEST(test_deform_lit_without_stored_normals_those_of_triangles) {
  opened o = open_lit(0, SUPINE_SIMD_AUTO);
  expect_triangle_normals(o.basis, POSED(o.basis, o.weights, o.scales));
  drop(&o);
  o = open_lit(8, SUPINE_SIMD_AUTO);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(o.f, &size);
  supine_basis *basis = NULL;
  supine_basis_options options = {sizeof options, .without_normals = true};
  assert_int_equal(supine_basis_open_memory_with(bytes, size, &options, &basis, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_get_info(basis)->normal_count, 0);
  expect_triangle_normals(basis, POSED(basis, o.weights, o.scales));
  supine_basis_close(basis);
  /* A program built before the option without_normals existed passes a smaller size. The library
   * must not read beyond that size. */
  options.size = offsetof(supine_basis_options, without_normals);
  assert_int_equal(supine_basis_open_memory_with(bytes, size, &options, &basis, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_get_info(basis)->normal_count, 8);
  supine_basis_close(basis);
  free(bytes);
  drop(&o);
}

/* Return the status of opening the fixture as a basis. */
static supine_status open_status(const fixture *f) {
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_basis *basis = NULL;
  const supine_status status = supine_basis_open_memory(bytes, size, &basis, NULL);
  supine_basis_close(basis);
  free(bytes);
  return status;
}

TEST(test_open_bad_normals_refused) {
  fixture *f = fixture_create(20, 2, 1, 1, false, false, 1, 3);
  fixture_add_normals(f, 4, 1);
  assert_int_equal(open_status(f), SUPINE_OK);
  f->normal_weight[5] = (double)NAN;
  assert_int_equal(open_status(f), SUPINE_ERROR_FORMAT);
  f->normal_weight[5] = 0;
  f->normals = 3;
  assert_int_equal(open_status(f), SUPINE_OK);
  free(f->normal);
  free(f->normal_weight);
  fixture_add_normals(f, SUPINE_NORMAL_MODES_MAX + 1, 1);
  assert_int_equal(open_status(f), SUPINE_ERROR_FORMAT);
  fixture_destroy(f);
}
