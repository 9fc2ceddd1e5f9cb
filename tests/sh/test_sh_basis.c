/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test spherical harmonics Y_lm of a direction: closed forms, orthonormality, addition theorem,
 * edge cases. */
#include <float.h>

#include "sh/expansion.h"
#include "tests/helpers/test.h"
#include <supine/sh.h>

#include "tests/helpers/sh_helpers.h"

enum { COUNT_MAX = (SUPINE_SH_BAND_MAX + 1) * (SUPINE_SH_BAND_MAX + 1) };

/* Compute the real harmonics of a unit vector for l = 0 to 4 as polynomials, from Wikipedia, "Table
 * of spherical harmonics", section "Real spherical harmonics". For l <= 2 they agree with (3) of R.
 * Ramamoorthi and P. Hanrahan, "An efficient representation for irradiance environment maps",
 * SIGGRAPH 2001. */
static void closed_forms(const double d[3], double y[25]) {
  const double x = d[0];
  const double yy = d[1];
  const double z = d[2];
  const double p = M_1_PI;
  y[0] = 0.5 * sqrt(p);

  y[1] = sqrt(0.75 * p) * yy;
  y[2] = sqrt(0.75 * p) * z;
  y[3] = sqrt(0.75 * p) * x;

  y[4] = 0.5 * sqrt(15 * p) * x * yy;
  y[5] = 0.5 * sqrt(15 * p) * yy * z;
  y[6] = 0.25 * sqrt(5 * p) * (3 * z * z - 1);
  y[7] = 0.5 * sqrt(15 * p) * x * z;
  y[8] = 0.25 * sqrt(15 * p) * (x * x - yy * yy);

  y[9] = 0.25 * sqrt(17.5 * p) * yy * (3 * x * x - yy * yy);
  y[10] = 0.5 * sqrt(105 * p) * x * yy * z;
  y[11] = 0.25 * sqrt(10.5 * p) * yy * (5 * z * z - 1);
  y[12] = 0.25 * sqrt(7 * p) * (5 * z * z * z - 3 * z);
  y[13] = 0.25 * sqrt(10.5 * p) * x * (5 * z * z - 1);
  y[14] = 0.25 * sqrt(105 * p) * (x * x - yy * yy) * z;
  y[15] = 0.25 * sqrt(17.5 * p) * x * (x * x - 3 * yy * yy);

  y[16] = 0.75 * sqrt(35 * p) * x * yy * (x * x - yy * yy);
  y[17] = 0.75 * sqrt(17.5 * p) * yy * (3 * x * x - yy * yy) * z;
  y[18] = 0.75 * sqrt(5 * p) * x * yy * (7 * z * z - 1);
  y[19] = 0.75 * sqrt(2.5 * p) * yy * (7 * z * z * z - 3 * z);
  y[20] = 0.1875 * sqrt(p) * (35 * z * z * z * z - 30 * z * z + 3);
  y[21] = 0.75 * sqrt(2.5 * p) * x * (7 * z * z * z - 3 * z);
  y[22] = 0.375 * sqrt(5 * p) * (x * x - yy * yy) * (7 * z * z - 1);
  y[23] = 0.75 * sqrt(17.5 * p) * x * (x * x - 3 * yy * yy) * z;
  y[24] = 0.1875 * sqrt(35 * p) * (x * x * (x * x - 3 * yy * yy) - yy * yy * (3 * x * x - yy * yy));
}

TEST(test_index_every_harmonic_equals_position) {
  size_t position = 0;
  for (size_t l = 0; l <= SUPINE_SH_BAND_MAX; ++l) {
    for (int m = -(int)l; m <= (int)l; ++m, ++position) {
      assert_int_equal(supine_sh_index(l, m), position);
    }
    assert_int_equal(supine_sh_count(l), position);
  }
}

TEST(test_evaluate_to_band_4_matches_closed_forms) {
  const double tolerance = 16 * DBL_EPSILON;
  uint64_t seed = 7368787;
  for (int trial = 0; trial < 500; ++trial) {
    double d[3];
    double expected[25];
    double y[25];
    random_direction(&seed, d);
    closed_forms(d, expected);
    assert_int_equal(supine_sh_evaluate(4, d, y), SUPINE_OK);
    for (size_t i = 0; i < 25; ++i) {
      assert_close(y[i], expected[i], tolerance);
    }
  }
}

/* Integrate the Gram matrix of all harmonics by the quadrature rule; return its largest deviation
 * from the identity. */
static double gram_error(size_t band) {
  const size_t count = supine_sh_count(band);
  supine_sh_grid *grid = NULL;
  assert_int_equal(supine_sh_grid_create(band + 1, 2 * band + 1, &grid), SUPINE_OK);
  const size_t points = grid->latitudes * grid->longitudes;
  double *y = malloc(points * count * sizeof *y);
  double *gram = calloc(count * count, sizeof *gram);
  assert_non_null(y);
  assert_non_null(gram);
  for (size_t i = 0; i < points; ++i) {
    double d[3];
    supine_sh_grid_direction(grid, i / grid->longitudes, i % grid->longitudes, d);
    assert_int_equal(supine_sh_evaluate(band, d, y + i * count), SUPINE_OK);
  }
  for (size_t i = 0; i < points; ++i) {
    const double *row = y + i * count;
    const double w = grid->weight[i / grid->longitudes] * 2 * M_PI / (double)grid->longitudes;
    for (size_t a = 0; a < count; ++a) {
      for (size_t b = 0; b <= a; ++b) {
        gram[a * count + b] += w * row[a] * row[b];
      }
    }
  }
  double worst = 0;
  for (size_t a = 0; a < count; ++a) {
    for (size_t b = 0; b <= a; ++b) {
      worst = fmax(worst, fabs(gram[a * count + b] - (a == b)));
    }
  }
  free(gram);
  free(y);
  supine_sh_grid_destroy(grid);
  return worst;
}

TEST(test_evaluate_under_quadrature_rule_orthonormal) {
  static const size_t bands[] = {0, 1, 3, 7, 15, 20};
  for (size_t i = 0; i < sizeof bands / sizeof *bands; ++i) {
    const double worst = gram_error(bands[i]);
    assert_true(worst < 1e-13);
  }
}

/* All harmonics up to band 64 are orthonormal. The full Gram matrix would need 7e10 products.
 * Harmonics of different order m are orthogonal on every ring of latitude, so only those of equal m
 * are integrated, over latitude. */
TEST(test_evaluate_band_64_orthonormal_in_latitude) {
  const size_t band = SUPINE_SH_BAND_MAX;
  supine_sh_grid *grid = NULL;
  assert_int_equal(supine_sh_grid_create(band + 1, 2 * band + 1, &grid), SUPINE_OK);
  double *y = malloc(grid->latitudes * COUNT_MAX * sizeof *y);
  assert_non_null(y);
  for (size_t j = 0; j < grid->latitudes; ++j) {
    double d[3];
    supine_sh_grid_direction(grid, j, 0, d);
    assert_int_equal(supine_sh_evaluate(band, d, y + j * COUNT_MAX), SUPINE_OK);
  }
  double worst = 0;
  for (int m = 0; m <= (int)band; ++m) {
    for (size_t a = (size_t)m; a <= band; ++a) {
      for (size_t b = (size_t)m; b <= a; ++b) {
        double sum = 0;
        for (size_t j = 0; j < grid->latitudes; ++j) {
          const double *row = y + j * COUNT_MAX;
          sum += grid->weight[j] * row[supine_sh_index(a, m)] * row[supine_sh_index(b, m)];
        }
        sum *= m == 0 ? 2 * M_PI : M_PI;
        worst = fmax(worst, fabs(sum - (a == b)));
      }
    }
  }
  assert_true(worst < 1e-13);
  free(y);
  supine_sh_grid_destroy(grid);
}

/* The sum over m of Y_lm(a) Y_lm(b) is (2 l + 1) / (4 pi) P_l(a.b), where P_l is a Legendre
 * polynomial. */
TEST(test_evaluate_two_directions_obey_addition_theorem) {
  const double tolerance = 2048 * DBL_EPSILON;
  static double ya[COUNT_MAX];
  static double yb[COUNT_MAX];
  uint64_t seed = 92821;
  for (int trial = 0; trial < 300; ++trial) {
    double a[3];
    double b[3];
    random_direction(&seed, a);
    random_direction(&seed, b);
    const double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    assert_int_equal(supine_sh_evaluate(SUPINE_SH_BAND_MAX, a, ya), SUPINE_OK);
    assert_int_equal(supine_sh_evaluate(SUPINE_SH_BAND_MAX, b, yb), SUPINE_OK);
    double before = 0;
    double legendre = 1;
    for (size_t l = 0; l <= SUPINE_SH_BAND_MAX; ++l) {
      double sum = 0;
      for (int m = -(int)l; m <= (int)l; ++m) {
        sum += ya[supine_sh_index(l, m)] * yb[supine_sh_index(l, m)];
      }
      assert_close(sum, (double)(2 * l + 1) / (4 * M_PI) * legendre, tolerance);
      const double n = (double)l;
      const double above = ((2 * n + 1) * cosine * legendre - n * before) / (n + 1);
      before = legendre;
      legendre = above;
    }
  }
}

TEST(test_evaluate_poles_only_zonal_not_zero) {
  static double y[COUNT_MAX];
  for (int south = 0; south < 2; ++south) {
    const double d[3] = {0, 0, south ? -1 : 1};
    assert_int_equal(supine_sh_evaluate(SUPINE_SH_BAND_MAX, d, y), SUPINE_OK);
    for (size_t l = 0; l <= SUPINE_SH_BAND_MAX; ++l) {
      const double zonal = sqrt((double)(2 * l + 1) / (4 * M_PI)) * (south && l % 2 ? -1 : 1);
      for (int m = -(int)l; m <= (int)l; ++m) {
        assert_close(y[supine_sh_index(l, m)], m == 0 ? zonal : 0, 512 * DBL_EPSILON);
      }
    }
  }
}

/* Y(l, 1) near the pole is sqrt((2 l + 1) l (l + 1) / (8 pi)) x, and is accurate even where 1 - z^2
 * has lost all digits. */
TEST(test_evaluate_near_pole_keeps_relative_accuracy) {
  static double y[COUNT_MAX];
  const double x = 1.2345e-11;
  const double d[3] = {x, 0, 1};
  assert_int_equal(supine_sh_evaluate(SUPINE_SH_BAND_MAX, d, y), SUPINE_OK);
  for (size_t l = 1; l <= SUPINE_SH_BAND_MAX; ++l) {
    const double n = (double)l;
    const double slope = sqrt((2 * n + 1) * n * (n + 1) / (8 * M_PI));
    assert_close(y[supine_sh_index(l, 1)] / (slope * x), 1, 512 * DBL_EPSILON);
  }
}

TEST(test_evaluate_any_length_same_harmonics) {
  static const double scales[] = {5e-324 * 0x1p60, 1e-200, 0.37, 3e7, 1e200, 0x1p1022};
  double y[25];
  double expected[25];
  const double d[3] = {0.48, -0.64, 0.6};
  assert_int_equal(supine_sh_evaluate(4, d, expected), SUPINE_OK);
  for (size_t s = 0; s < sizeof scales / sizeof *scales; ++s) {
    const double scaled[3] = {scales[s] * d[0], scales[s] * d[1], scales[s] * d[2]};
    assert_int_equal(supine_sh_evaluate(4, scaled, y), SUPINE_OK);
    for (size_t i = 0; i < 25; ++i) {
      assert_close(y[i], expected[i], 32 * DBL_EPSILON);
    }
  }
}

TEST(test_evaluate_bad_argument_refused) {
  static double y[COUNT_MAX];
  const double zero[3] = {0, -0.0, 0};
  const double good[3] = {0.1, 0.2, 0.3};
  assert_int_equal(supine_sh_evaluate(3, zero, y), SUPINE_ERROR_ARGUMENT);
  for (int i = 0; i < 3; ++i) {
    double d[3] = {0.3, 0.2, 0.1};
    d[i] = NAN;
    assert_int_equal(supine_sh_evaluate(3, d, y), SUPINE_ERROR_ARGUMENT);
    d[i] = -INFINITY;
    assert_int_equal(supine_sh_evaluate(3, d, y), SUPINE_ERROR_ARGUMENT);
  }
  assert_int_equal(supine_sh_evaluate(SUPINE_SH_BAND_MAX, good, y), SUPINE_OK);
  assert_int_equal(supine_sh_evaluate(SUPINE_SH_BAND_MAX + 1, good, y), SUPINE_ERROR_ARGUMENT);
}
