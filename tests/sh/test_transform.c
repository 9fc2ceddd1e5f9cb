/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the transform of fields on a grid: round trips, comparison with quadrature, refused
 * arguments. */
#include <float.h>

#include "sh/expansion.h"
#include "tests/helpers/test.h"
#include <supine/sh.h>

#include "tests/helpers/sh_helpers.h"

typedef struct setup {
  size_t band, count, points, longitudes;
  supine_sh_grid *grid;
} setup;

static setup set_up(size_t band, size_t latitudes, size_t longitudes) {
  setup s = {.band = band,
             .count = supine_sh_count(band),
             .points = latitudes * longitudes,
             .longitudes = longitudes};
  assert_int_equal(supine_sh_grid_create(latitudes, longitudes, &s.grid), SUPINE_OK);
  return s;
}

static void tear_down(setup *s) {
  supine_sh_grid_destroy(s->grid);
}

static double *make(size_t count, uint64_t seed) {
  double *numbers = malloc((count + 1) * sizeof *numbers);
  assert_non_null(numbers);
  for (size_t i = 0; i < count; ++i) {
    numbers[i] = seed == 0 ? NAN : random_signed(&seed);
  }
  return numbers;
}

/* Compute coefficients [fields, count] of values [points, fields]. */
static void forward(const setup *s, size_t fields, const double *values, double *coefficients) {
  assert_int_equal(supine_sh_transform(s->band, s->grid, fields, values, coefficients, NULL),
                   SUPINE_OK);
}

static double largest_difference(const double *a, const double *b, size_t count) {
  double worst = 0;
  for (size_t i = 0; i < count; ++i) {
    const double off = fabs(a[i] - b[i]);
    assert_true(isfinite(off));
    worst = fmax(worst, off);
  }
  return worst;
}

/* Compute the grid values [points, fields] of fields with coefficients [fields, count] by summing
 * harmonics. */
static void sum_harmonics(const setup *s, size_t fields, const double *coefficients,
                          double *values) {
  double *y = make(s->count, 0);
  for (size_t i = 0; i < s->points; ++i) {
    double d[3];
    supine_sh_grid_direction(s->grid, i / s->longitudes, i % s->longitudes, d);
    assert_int_equal(supine_sh_evaluate(s->band, d, y), SUPINE_OK);
    for (size_t f = 0; f < fields; ++f) {
      values[i * fields + f] = 0.0;
      for (size_t c = 0; c < s->count; ++c) {
        values[i * fields + f] += coefficients[f * s->count + c] * y[c];
      }
    }
  }
  free(y);
}

TEST(test_transform_band_limited_round_trip) {
  static const size_t sizes[][3] = {/* band, latitudes, longitudes */
                                    {0, 1, 1},    {1, 2, 3},    {3, 4, 8},    {3, 5, 7},
                                    {7, 8, 16},   {7, 9, 15},   {15, 16, 32}, {15, 24, 31},
                                    {15, 17, 45}, {31, 32, 64}, {31, 48, 63}, {31, 33, 300}};
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; ++i) {
    setup s = set_up(sizes[i][0], sizes[i][1], sizes[i][2]);
    const size_t fields = 1 + 10 * i;
    double *expected = make(s.count * fields, 77003 + i);
    double *values = make(s.points * fields, 0);
    double *back = make(s.count * fields, 0);
    sum_harmonics(&s, fields, expected, values);
    forward(&s, fields, values, back);
    assert_close(largest_difference(back, expected, s.count * fields), 0, 1e-13);
    free(back);
    free(values);
    free(expected);
    tear_down(&s);
  }
}

TEST(test_forward_harmonic_of_highest_band_gives_one_coefficient) {
  setup s = set_up(SUPINE_SH_BAND_MAX, SUPINE_SH_BAND_MAX + 1, 2 * SUPINE_SH_BAND_MAX + 2);
  static const size_t chosen[] = {0, 2, 4095, 4096, 4097, 4159, 4160, 4161, 4223, 4224};
  enum { FIELDS = sizeof chosen / sizeof *chosen };
  double *values = make(s.points * FIELDS, 0);
  double *y = make(s.count, 0);
  double *coefficients = make(s.count * FIELDS, 0);
  for (size_t i = 0; i < s.points; ++i) {
    double d[3];
    supine_sh_grid_direction(s.grid, i / s.longitudes, i % s.longitudes, d);
    assert_int_equal(supine_sh_evaluate(s.band, d, y), SUPINE_OK);
    for (size_t f = 0; f < FIELDS; ++f) {
      values[i * FIELDS + f] = y[chosen[f]];
    }
  }
  forward(&s, FIELDS, values, coefficients);
  for (size_t c = 0; c < s.count; ++c) {
    for (size_t f = 0; f < FIELDS; ++f) {
      assert_close(coefficients[f * s.count + c], c == chosen[f], 1e-13);
    }
  }
  free(coefficients);
  free(y);
  free(values);
  tear_down(&s);
}

/* For values without a band limit, the transform still equals plain quadrature. */
TEST(test_forward_any_values_equal_direct_quadrature) {
  enum { FIELDS = 5 };
  setup s = set_up(6, 9, 20);
  double *values = make(s.points * FIELDS, 31337);
  double *coefficients = make(s.count * FIELDS, 0);
  double *expected = calloc(s.count * FIELDS, sizeof *expected);
  double *y = make(s.count, 0);
  assert_non_null(expected);
  for (size_t i = 0; i < s.points; ++i) {
    double d[3];
    supine_sh_grid_direction(s.grid, i / s.longitudes, i % s.longitudes, d);
    assert_int_equal(supine_sh_evaluate(s.band, d, y), SUPINE_OK);
    const double w = s.grid->weight[i / s.longitudes] * 2 * M_PI / (double)s.longitudes;
    for (size_t f = 0; f < FIELDS; ++f) {
      for (size_t c = 0; c < s.count; ++c) {
        expected[f * s.count + c] += w * values[i * FIELDS + f] * y[c];
      }
    }
  }
  forward(&s, FIELDS, values, coefficients);
  assert_close(largest_difference(coefficients, expected, s.count * FIELDS), 0, 128 * DBL_EPSILON);
  free(y);
  free(expected);
  free(coefficients);
  free(values);
  tear_down(&s);
}

TEST(test_transform_small_grid_or_high_band_refused) {
  static const size_t sizes[][3] = {
      {3, 3, 8}, {3, 4, 6}, {SUPINE_SH_BAND_MAX + 1, 200, 400}, {SIZE_MAX, 200, 400}};
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; ++i) {
    supine_sh_grid *grid = NULL;
    supine_error error = {0};
    assert_int_equal(supine_sh_grid_create(sizes[i][1], sizes[i][2], &grid), SUPINE_OK);
    assert_int_equal(supine_sh_transform(sizes[i][0], grid, 1, NULL, NULL, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_int_equal(error.status, SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, "directions cannot represent band");
    supine_sh_grid_destroy(grid);
  }
}
