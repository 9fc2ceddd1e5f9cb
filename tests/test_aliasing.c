/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What oversampling buys on a field of no finite band: heights along gravity, whose lowest and
 * highest point change at kinks. Prints the table behind supine_sh_grid_size's default. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "sh/transform.h"
#include <supine/sh.h>

#include "sh_helpers.h"

enum { POINTS = 60, HELD_OUT = 400 };

/* h_i(g) = (g.p_i - min) / (max - min) */
static void heights(double points[POINTS][3], const double g[3], double *h) {
  double low = INFINITY;
  double high = -INFINITY;
  for (size_t i = 0; i < POINTS; ++i) {
    h[i] = g[0] * points[i][0] + g[1] * points[i][1] + g[2] * points[i][2];
    low = fmin(low, h[i]);
    high = fmax(high, h[i]);
  }
  for (size_t i = 0; i < POINTS; ++i) {
    h[i] = (h[i] - low) / (high - low);
  }
}

static double *coefficients_on(double points[POINTS][3], size_t band, size_t latitudes,
                               size_t longitudes) {
  supine_sh_grid *grid = NULL;
  supine_sh_transform *plan = NULL;
  assert_int_equal(supine_sh_grid_create(latitudes, longitudes, &grid), SUPINE_OK);
  assert_int_equal(supine_sh_transform_create(band, grid, &plan, NULL), SUPINE_OK);
  const supine_sh_batch batch = {.fields = POINTS};
  double *ring = malloc(longitudes * POINTS * sizeof *ring);
  double *coefficients = calloc(supine_sh_count(band) * POINTS, sizeof *coefficients);
  assert_non_null(ring);
  assert_non_null(coefficients);
  for (size_t j = 0; j < latitudes; ++j) {
    for (size_t k = 0; k < longitudes; ++k) {
      double g[3];
      supine_sh_grid_direction(grid, j, k, g);
      heights(points, g, ring + k * POINTS);
    }
    assert_int_equal(supine_sh_forward_ring(plan, &batch, j, ring, coefficients, NULL), SUPINE_OK);
  }
  free(ring);
  supine_sh_transform_destroy(plan);
  supine_sh_grid_destroy(grid);
  return coefficients;
}

static double norm_of_difference(const double *a, const double *b, size_t count) {
  double sum = 0;
  for (size_t i = 0; i < count; ++i) {
    sum += (a[i] - b[i]) * (a[i] - b[i]);
  }
  return sqrt(sum);
}

/* Root mean square error over directions that no grid has. */
static double held_out_error(double points[POINTS][3], size_t band, const double *coefficients) {
  const size_t count = supine_sh_count(band);
  double *y = malloc(count * sizeof *y);
  assert_non_null(y);
  double sum = 0;
  uint64_t seed = 2147483647;
  for (int t = 0; t < HELD_OUT; ++t) {
    double g[3];
    double h[POINTS];
    random_direction(&seed, g);
    heights(points, g, h);
    assert_int_equal(supine_sh_evaluate(band, g, y), SUPINE_OK);
    for (size_t i = 0; i < POINTS; ++i) {
      double value = 0;
      for (size_t c = 0; c < count; ++c) {
        value += coefficients[i * count + c] * y[c];
      }
      sum += (value - h[i]) * (value - h[i]);
    }
  }
  free(y);
  return sqrt(sum / HELD_OUT / POINTS);
}

static void test_grid_oversampling_default_keeps_aliasing_small(void **state) {
  (void)state;
  static const size_t bands[] = {3, 7, 15};
  double points[POINTS][3];
  uint64_t seed = 7907;
  for (size_t i = 0; i < POINTS; ++i) { /* a chest's proportions */
    points[i][0] = 75 * random_signed(&seed);
    points[i][1] = 75 * random_signed(&seed);
    points[i][2] = 125 * random_signed(&seed);
  }
  for (size_t b = 0; b < sizeof bands / sizeof *bands; ++b) {
    const size_t band = bands[b];
    const size_t count = supine_sh_count(band) * POINTS;
    double *exact = coefficients_on(points, band, 160, 320);
    const double left_out = held_out_error(points, band, exact);
    size_t latitudes = 0;
    size_t longitudes = 0;
    assert_int_equal(supine_sh_grid_size(band, 0, &latitudes, &longitudes), SUPINE_OK);
    const size_t n = band + 1;
    const size_t grids[][2] = {
        {n, 2 * n},         {n, 3 * n},    {n + n / 4, 2 * n + n / 2}, {latitudes, longitudes},
        {n + n / 2, 3 * n}, {2 * n, 4 * n}};
    double folded[6];
    double error[6];
    printf("band %zu: exact coefficients leave %.2e\n", band, left_out);
    for (size_t i = 0; i < 6; ++i) {
      double *coefficients = coefficients_on(points, band, grids[i][0], grids[i][1]);
      folded[i] = norm_of_difference(coefficients, exact, count) / sqrt(4 * M_PI * POINTS);
      error[i] = held_out_error(points, band, coefficients);
      printf("  %2zu x %-3zu %5zu directions   folded back %.2f   held-out error %.2f\n",
             grids[i][0], grids[i][1], grids[i][0] * grids[i][1], folded[i] / left_out,
             error[i] / left_out);
      free(coefficients);
    }
    free(exact);
    assert_true(folded[0] > 0.5 * left_out); /* the least grid folds back as much again */
    assert_true(folded[3] < 0.5 * left_out);
    assert_true(folded[3] < 0.75 * folded[1]); /* latitudes pay, longitudes hardly */
    assert_true(folded[5] < 0.5 * folded[3]);
    assert_true(error[3] < 1.15 * left_out); /* the two add as squares: 1.12 from 0.5 */
    assert_true(error[3] < error[0] && error[3] < error[1]);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_grid_oversampling_default_keeps_aliasing_small),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
