/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The two routes of projection against each other, and modes against a plain singular value
 * decomposition. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <gsl/gsl_linalg.h>

#include "precompute/projection/tally.h"
#include "precompute/lungs/phantom.h"
#include "precompute/physics/solve.h"
#include "precompute/precompute.h"
#include "sh/grid.h"
#include <supine/sh.h>

#include "lungs_helpers.h"

static int setup(void **state) {
  supine_mesh mesh = {0};
  supine_lungs *lungs = calloc(1, sizeof *lungs);
  assert_int_equal(supine_phantom_create(700, 2500.0, &mesh, NULL), SUPINE_OK);
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, lungs, NULL), SUPINE_OK);
  supine_mesh_free(&mesh);
  *state = lungs;
  return 0;
}

static int teardown(void **state) {
  supine_lungs_free(*state);
  free(*state);
  return 0;
}

/* Coefficients [N, P] of a projection, from its factors. */
static double *coefficients_of(const supine_projection *projection) {
  const size_t terms = supine_sh_count(projection->band);
  double *c = calloc(projection->vertex_count * terms + 1, sizeof *c);
  for (size_t i = 0; i < projection->vertex_count; ++i) {
    for (size_t r = 0; r < projection->rank; ++r) {
      for (size_t t = 0; t < terms; ++t) {
        const double function =
            projection->functions != NULL ? projection->functions[r * terms + t] : (double)(r == t);
        c[i * terms + t] += projection->columns[i * projection->rank + r] * function;
      }
    }
  }
  return c;
}

/* The rule is fine enough for the kinks of the lowest and highest vertex: a rule of many times the
 * directions gives the same functions, but for what is far below any error that a basis states. */
static void test_linear_rule_is_fine_enough_for_the_kinks(void **state) {
  enum { FINE = 512 };
  static const size_t bands[] = {1, 15};
  static const double most[] = {5e-5, 2e-5}; /* 3.5e-5 and 1e-5 are what they are */
  for (size_t b = 0; b < 2; ++b) {
    const supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
    const size_t terms = supine_sh_count(bands[b]);
    supine_projection made;
    supine_projection fine;
    assert_int_equal(supine_projection_linear(*state, &model, bands[b], &made, NULL), SUPINE_OK);
    assert_int_equal(
        supine_projection_linear_rule(*state, &model, bands[b], FINE, FINE + 1, &fine, NULL),
        SUPINE_OK);
    double missed = 0.0;
    double all = 0.0;
    for (size_t i = 0; i < made.rank * terms; ++i) {
      missed += pow(made.functions[i] - fine.functions[i], 2.0);
      all += pow(fine.functions[i], 2.0);
    }
    assert_true(sqrt(missed / all) < most[b]);
    supine_projection_free(&made);
    supine_projection_free(&fine);
  }
}

/* Both routes are sums of the same solves: they agree to rounding where they use the same rule. */
static void test_routes_agree_where_stiffness_does_not_turn(void **state) {
  const supine_lungs *lungs = *state;
  enum { BAND = 5 };
  const size_t n = lungs->mesh.vertex_count;
  const size_t terms = supine_sh_count(BAND);
  supine_projection linear;
  supine_projection sampled;
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  model.force = (supine_force_law){.base = 0.2, .gain = 1.4, .box = {0.3, -0.1, 0.25}};
  double *stiffness = malloc(n * sizeof *stiffness);
  for (size_t i = 0; i < n; ++i) {
    stiffness[i] = exp(0.01 * lungs->mesh.vertices[3 * i + 2]);
  }
  model.stiffness = stiffness;
  model.tolerance = 1e-13;
  size_t latitudes;
  size_t longitudes;
  assert_int_equal(supine_sh_grid_size(BAND, 0.0, &latitudes, &longitudes), SUPINE_OK);
  assert_int_equal(
      supine_projection_linear_rule(lungs, &model, BAND, latitudes, longitudes, &linear, NULL),
      SUPINE_OK);
  assert_int_equal(supine_projection_sampled(lungs, &model, BAND, NULL, NULL, &sampled, NULL),
                   SUPINE_OK);
  assert_int_equal(linear.rank, 5);
  assert_int_equal(sampled.rank, terms);
  double *a = coefficients_of(&linear);
  double *b = coefficients_of(&sampled);
  const double difference = helper_difference(n * terms, a, b) / helper_largest(n * terms, a);
  printf("linear and sampled routes: %.1e of the largest coefficient\n", difference);
  assert_true(difference <= 1e-10);
  free(a);
  free(b);
  free(stiffness);
  supine_projection_free(&linear);
  supine_projection_free(&sampled);
}

/* Where the stiffness does not turn, the field is a polynomial of degree 1 in what the smooth route
 * fits, and its rule is the linear route's. */
static void test_smooth_route_is_exact_where_stiffness_does_not_turn(void **state) {
  const supine_lungs *lungs = *state;
  enum { BAND = 5 };
  const size_t values = lungs->mesh.vertex_count * supine_sh_count(BAND);
  supine_projection linear;
  supine_projection smooth;
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  model.force = (supine_force_law){.base = 0.2, .gain = 1.4, .box = {0.3, -0.1, 0.25}};
  model.tolerance = 1e-13;
  assert_int_equal(supine_projection_linear(lungs, &model, BAND, &linear, NULL), SUPINE_OK);
  assert_int_equal(supine_projection_smooth(lungs, &model, BAND, NULL, NULL, &smooth, NULL),
                   SUPINE_OK);
  assert_int_equal(smooth.solve_count, supine_projection_smooth_directions(&model));
  double *a = coefficients_of(&linear);
  double *b = coefficients_of(&smooth);
  assert_true(helper_difference(values, a, b) <= 1e-10 * helper_largest(values, a));
  free(a);
  free(b);
  supine_projection_free(&linear);
  supine_projection_free(&smooth);
}

/* Of low even bands next to nothing of the kinks folds back (h(-g) = 1 - h(g)), so that there a
 * grid is as exact as its solves; in all it errs by a third of what lies beyond its band
 * (sh/grid.h). */
static void test_smooth_route_agrees_with_a_grid(void **state) {
  const supine_lungs *lungs = *state;
  enum { BAND = 23, LOW = 4 };
  static const double softens[] = {1.0, 1.0, 2.0};
  static const double reaches[] = {0.0, 50.0, 10.0};
  const size_t n = lungs->mesh.vertex_count;
  const size_t terms = supine_sh_count(BAND);
  for (size_t c = 0; c < sizeof softens / sizeof *softens; ++c) {
    supine_projection smooth;
    supine_projection grid;
    supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
    model.force.soften = softens[c];
    model.reach = reaches[c];
    assert_int_equal(supine_projection_smooth(lungs, &model, BAND, NULL, NULL, &smooth, NULL),
                     SUPINE_OK);
    assert_int_equal(supine_projection_sampled(lungs, &model, BAND, NULL, NULL, &grid, NULL),
                     SUPINE_OK);
    double *a = coefficients_of(&smooth);
    double *b = coefficients_of(&grid);
    double low = 0.0;
    double high = 0.0;
    double all = 0.0;
    for (size_t i = 0; i < n * terms; ++i) {
      const double miss = (a[i] - b[i]) * (a[i] - b[i]);
      const size_t band = (size_t)sqrt((double)(i % terms));
      low += band <= LOW && band % 2 == 0 ? miss : 0.0;
      high += miss;
      all += b[i] * b[i];
    }
    printf("soften %g, reach %g: %zu directions in %zu steps against %zu in %zu: low even bands "
           "%.1e, all %.1e\n",
           softens[c], reaches[c], smooth.solve_count, smooth.iterations, grid.solve_count,
           grid.iterations, sqrt(low / all), sqrt(high / all));
    assert_true(smooth.iterations <= 15 && grid.iterations <= 15);
    assert_true(sqrt(low / all) <= 2e-4); /* what smooth.c promises */
    assert_true(sqrt(high / all) <= 2e-3);
    free(a);
    free(b);
    supine_projection_free(&smooth);
    supine_projection_free(&grid);
  }
}

static void test_smooth_route_refuses_what_no_polynomial_follows(void **state) {
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_projection projection;
  supine_error error;
  model.force.soften = 4.0;
  assert_int_equal(supine_projection_smooth_directions(&model), 0);
  assert_int_equal(supine_projection_smooth(*state, &model, 5, NULL, NULL, &projection, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_string_equal(error.message,
                      "soften 4 is too much for a polynomial: take the sampled route");
}

/* Singular values and reproduced fields against a dense decomposition of the weighted matrix. */
static void check_modes(const supine_projection *projection, const double *weight, size_t most) {
  const size_t n = projection->vertex_count;
  const size_t terms = supine_sh_count(projection->band);
  double *c = coefficients_of(projection);
  gsl_matrix *u = gsl_matrix_alloc(n, terms);
  gsl_matrix *v = gsl_matrix_alloc(terms, terms);
  gsl_vector *s = gsl_vector_alloc(terms);
  double energy = 0.0;
  for (size_t i = 0; i < n; ++i) {
    for (size_t t = 0; t < terms; ++t) {
      gsl_matrix_set(u, i, t, sqrt(weight[i]) * c[i * terms + t]);
      energy += weight[i] * c[i * terms + t] * c[i * terms + t];
    }
  }
  gsl_linalg_SV_decomp_jacobi(u, v, s);
  supine_compression modes;
  double singular[SUPINE_MODES_MADE_MAX] = {0.0};
  double total;
  assert_int_equal(
      supine_projection_compress_modes(projection, weight, most, &modes, singular, &total, NULL),
      SUPINE_OK);
  assert_close(total, energy, 1e-12 * energy);
  double tail = 0.0;
  for (size_t k = 0; k < terms; ++k) {
    const double should = gsl_vector_get(s, k);
    if (k < modes.mode_count) { /* the Gram matrix costs half the digits of small ones */
      assert_close(singular[k], should, 1e-7 * gsl_vector_get(s, 0));
    } else {
      tail += should * should;
    }
  }
  double error = 0.0; /* what the modes leave is what the best approximation of that rank leaves */
  for (size_t i = 0; i < n; ++i) {
    for (size_t t = 0; t < terms; ++t) {
      double is = 0.0;
      for (size_t k = 0; k < modes.mode_count; ++k) {
        is += (double)modes.coefficients[i * modes.mode_count + k] * modes.modes[k * terms + t];
      }
      error += weight[i] * (is - c[i * terms + t]) * (is - c[i * terms + t]);
    }
  }
  assert_close(sqrt(error / energy), sqrt(tail / energy), 1e-6);
  for (size_t a = 0; a < modes.mode_count; ++a) { /* orthonormal functions */
    for (size_t b = 0; b <= a; ++b) {
      double dot = 0.0;
      for (size_t t = 0; t < terms; ++t) {
        dot += modes.modes[a * terms + t] * modes.modes[b * terms + t];
      }
      assert_close(dot, a == b ? 1.0 : 0.0, 1e-6);
    }
  }
  supine_projection_compression_free(&modes);
  gsl_matrix_free(u);
  gsl_matrix_free(v);
  gsl_vector_free(s);
  free(c);
}

static void test_modes_equal_dense_decomposition(void **state) {
  const supine_lungs *lungs = *state;
  const size_t n = lungs->mesh.vertex_count;
  double *weight = calloc(n, sizeof *weight);
  for (size_t i = 0; i < n; ++i) {
    weight[i] = 1.0 + fabs(lungs->mesh.vertices[3 * i]);
  }
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_projection projection;
  assert_int_equal(supine_projection_linear(lungs, &model, 5, &projection, NULL), SUPINE_OK);
  check_modes(&projection, weight, 3);
  check_modes(&projection, weight, 16);
  supine_projection_free(&projection);
  model.force.soften = 1.0;
  assert_int_equal(supine_projection_sampled(lungs, &model, 5, NULL, NULL, &projection, NULL),
                   SUPINE_OK);
  check_modes(&projection, weight, 7);
  check_modes(&projection, weight, 16);
  supine_projection_free(&projection);
  assert_int_equal(supine_projection_smooth(lungs, &model, 5, NULL, NULL, &projection, NULL),
                   SUPINE_OK);
  check_modes(&projection, weight, 7);
  check_modes(&projection, weight, 16);
  supine_projection_free(&projection);
  free(weight);
}

static void test_modes_beat_harmonics_of_the_same_number(void **state) {
  const supine_lungs *lungs = *state;
  static const double softens[] = {0.0, 1.0};
  char path[] = "/tmp/supine-projection-XXXXXX";
  (void)close(mkstemp(path));
  for (size_t s = 0; s < 2; ++s) {
    double error[2];
    for (int k = 0; k < 2; ++k) {
      supine_precompute_options options = {.model = supine_physics_model(SUPINE_LAW_PAPER),
                                           .band = k == 0 ? 3 : 15,
                                           .modes = k == 0 ? 0 : 16};
      supine_precompute_report report;
      options.model.force.soften = softens[s];
      assert_int_equal(supine_precompute(lungs, &options, path, &report, NULL), SUPINE_OK);
      error[k] = report.accuracy.relative_rms;
    }
    printf("soften %g: 16 harmonics %.2f %%, 16 modes of band 15 %.2f %%\n", softens[s],
           100.0 * error[0], 100.0 * error[1]);
    assert_true(error[1] < 0.25 * error[0]);
  }
  (void)unlink(path);
}

/* Singular values of 3e-7 and 3e-8 of the first lie on either side of what the Gram matrix tells
 * from rounding. */
static void test_modes_end_where_rounding_begins(void **state) {
  (void)state;
  enum { ROWS = 7, TERMS = 4 };
  static const double sizes[TERMS] = {2.0, 0.5, 2.0 * 3e-7, 2.0 * 3e-8};
  double columns[ROWS * TERMS] = {0.0};
  for (size_t t = 0; t < TERMS; ++t) {
    columns[(t + 2) * TERMS + t] = sizes[t];
  }
  const supine_projection projection = {
      .vertex_count = ROWS, .band = 1, .rank = TERMS, .columns = columns};
  supine_compression modes;
  double singular[TERMS];
  assert_int_equal(
      supine_projection_compress_modes(&projection, NULL, TERMS, &modes, singular, NULL, NULL),
      SUPINE_OK);
  assert_int_equal(modes.mode_count, 3);
  assert_close(singular[2], 6e-7, 1e-9);
  assert_close(singular[3], 0.0, 0.0);
  supine_projection_compression_free(&modes);
}

/* Bins are 1/256 of a power of two wide, and a percentile is the upper edge of its bin. */
static void test_tally_percentile_is_the_edge_above(void **state) {
  (void)state;
  supine_tally *tally = calloc(1, sizeof *tally);
  supine_tally *other = calloc(1, sizeof *other);
  static const double low[] = {1.0, 1.001, 1.003};
  static const double high[] = {5.01};
  supine_accuracy_tally_add(tally, 3, low);
  supine_accuracy_tally_add(other, 1, high);
  supine_accuracy_tally_merge(tally, other);
  assert_close(supine_accuracy_tally_percentile(tally, 0.75), 1.0 + 1.0 / 256.0, 0.0);
  assert_close(supine_accuracy_tally_percentile(tally, 0.76), 5.015625, 0.0);
  assert_close(tally->largest, 5.01, 0.0);
  assert_close(tally->square_sum, 28.108110, 1e-12);
  free(tally);
  free(other);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_routes_agree_where_stiffness_does_not_turn),
      cmocka_unit_test(test_smooth_route_is_exact_where_stiffness_does_not_turn),
      cmocka_unit_test(test_smooth_route_agrees_with_a_grid),
      cmocka_unit_test(test_smooth_route_refuses_what_no_polynomial_follows),
      cmocka_unit_test(test_linear_rule_is_fine_enough_for_the_kinks),
      cmocka_unit_test(test_modes_equal_dense_decomposition),
      cmocka_unit_test(test_modes_end_where_rounding_begins),
      cmocka_unit_test(test_tally_percentile_is_the_edge_above),
      cmocka_unit_test(test_modes_beat_harmonics_of_the_same_number),
  };
  return cmocka_run_group_tests(tests, setup, teardown);
}
