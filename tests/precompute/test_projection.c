/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the projection onto harmonics against full solves and plain quadrature. Test the modes
 * against a dense singular value decomposition. */
#include "tests/helpers/test.h"

#include <gsl/gsl_linalg.h>

#include "precompute/lungs/phantom.h"
#include "precompute/physics/solve.h"
#include "precompute/projection/accuracy.h"
#include "precompute/projection/tally.h"
#include "sh/expansion.h"
#include <supine/sh.h>

static int setup(void **state) {
  supine_mesh mesh = {0};
  supine_lungs *lungs = calloc(1, sizeof *lungs);
  assert_int_equal(supine_lungs_phantom_create(700, 2500.0, &mesh, NULL), SUPINE_OK);
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

/* Return the product of a projection's factors (malloc): coefficients [N, number of harmonics]. */
static double *coefficients_of(const supine_expansion *expansion) {
  const size_t terms = supine_sh_count(expansion->band);
  double *c = calloc(expansion->row_count * terms + 1, sizeof *c);
  for (size_t i = 0; i < expansion->row_count; ++i) {
    for (size_t r = 0; r < expansion->rank; ++r) {
      for (size_t t = 0; t < terms; ++t) {
        c[i * terms + t] +=
            expansion->columns[i * expansion->rank + r] * expansion->functions[r * terms + t];
      }
    }
  }
  return c;
}

/* A projection writes the displacement as a sum of `rank` fixed fields, with weights that depend on
 * gravity. Return these weights [count, rank] for `count` directions of gravity (malloc). */
static double *weights_at(const supine_lungs *lungs, const supine_model *model,
                          const supine_span *span, size_t count, const double *g) {
  double *range = malloc(2 * count * sizeof *range);
  double *weights = malloc(count * span->rank * sizeof *weights);
  assert_int_equal(
      supine_physics_height_range(lungs, model->force.pair, count, g, range, range + count),
      SUPINE_OK);
  const supine_gravities gravities = {count, g, range, range + count};
  assert_int_equal(supine_projection_span_weights(lungs, &model->force, span, &gravities, weights),
                   SUPINE_OK);
  free(range);
  return weights;
}

/* A projection expands the weights of its fields in harmonics of the direction of gravity. On a
 * much finer grid of directions, the coefficients are nearly equal, although the weights have kinks
 * where another vertex becomes the lowest or the highest. */
TEST(test_projection_finer_grid_same_functions) {
  enum { LATITUDES = 512, LONGITUDES = 513 };
  static const size_t bands[] = {1, 15};
  static const double most[] = {5e-5, 2e-5};
  for (size_t b = 0; b < 2; ++b) {
    const supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
    const size_t terms = supine_sh_count(bands[b]);
    supine_projection made;
    supine_sh_grid *grid = NULL;
    assert_int_equal(supine_projection_create(*state, &model, bands[b], &made, NULL), SUPINE_OK);
    assert_int_equal(supine_sh_grid_create(LATITUDES, LONGITUDES, &grid), SUPINE_OK);
    double *fine = calloc(made.expansion.rank * terms, sizeof *fine);
    double *g = malloc(3 * LATITUDES * LONGITUDES * sizeof *g);
    double y[256];
    for (size_t d = 0; d < LATITUDES * LONGITUDES; ++d) {
      supine_sh_grid_direction(grid, d / LONGITUDES, d % LONGITUDES, g + 3 * d);
    }
    double *weights = weights_at(*state, &model, made.span, LATITUDES * LONGITUDES, g);
    for (size_t d = 0; d < LATITUDES * LONGITUDES; ++d) {
      const double share = grid->weight[d / LONGITUDES] * 2.0 * M_PI / LONGITUDES;
      assert_int_equal(supine_sh_evaluate(bands[b], g + 3 * d, y), SUPINE_OK);
      for (size_t r = 0; r < made.expansion.rank; ++r) {
        for (size_t t = 0; t < terms; ++t) {
          fine[r * terms + t] += share * weights[d * made.expansion.rank + r] * y[t];
        }
      }
    }
    double missed = 0.0;
    double all = 0.0;
    for (size_t i = 0; i < made.expansion.rank * terms; ++i) {
      missed += pow(made.expansion.functions[i] - fine[i], 2.0);
      all += pow(fine[i], 2.0);
    }
    printf("band %zu: functions differ by %.1e from those of the fine grid\n", bands[b],
           sqrt(missed / all));
    assert_true(sqrt(missed / all) < most[b]);
    supine_projection_free(&made);
    supine_sh_grid_destroy(grid);
    free(fine);
    free(g);
    free(weights);
  }
}

/* Check that the solve for any direction of gravity is a weighted sum of at most `rank_most`
 * solves, with a relative error below `most`. */
static void check_superposition(const supine_lungs *lungs, const supine_model *model,
                                size_t rank_most, double most) {
  enum { COUNT = 20 };
  const size_t n = lungs->mesh.vertex_count;
  supine_projection made;
  double g[3 * COUNT];
  double missed = 0.0;
  double all = 0.0;
  assert_int_equal(supine_projection_create(lungs, model, 3, &made, NULL), SUPINE_OK);
  supine_projection_held_out_directions(COUNT, g);
  double *weights = weights_at(lungs, model, made.span, COUNT, g);
  for (size_t d = 0; d < COUNT; ++d) {
    supine_solution solution = {0};
    assert_int_equal(supine_physics_solve(lungs, model, g + 3 * d, &solution, NULL), SUPINE_OK);
    for (size_t i = 0; i < n; ++i) {
      double sum = 0.0;
      for (size_t r = 0; r < made.expansion.rank; ++r) {
        sum += made.expansion.columns[i * made.expansion.rank + r] *
               weights[d * made.expansion.rank + r];
      }
      missed += pow(sum - solution.catch_[i], 2.0);
      all += pow(solution.catch_[i], 2.0);
    }
    supine_physics_solution_free(&solution);
  }
  printf("soften %g, reach %g: %zu solves, difference from the full solve %.1e RMS\n",
         model->force.soften, model->reach, made.expansion.rank, sqrt(missed / all));
  assert_true(made.expansion.rank <= rank_most);
  assert_true(sqrt(missed / all) < most);
  supine_projection_free(&made);
  free(weights);
}

TEST(test_projection_few_solves_sum_to_full_solve) {
  const supine_lungs *lungs = *state;
  const size_t n = lungs->mesh.vertex_count;
  static const double softens[] = {0.0, 0.5, 1.0, 2.0, 5.0};
  static const size_t ranks[] = {5, 28, 38, 58, 100};
  double *stiffness = malloc(n * sizeof *stiffness);
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  for (size_t i = 0; i < n; ++i) {
    stiffness[i] = exp(0.01 * lungs->mesh.vertices[3 * i + 2]);
  }
  model.stiffness = stiffness;
  check_superposition(lungs, &model, 4, 1e-12);
  model = supine_physics_model(SUPINE_LAW_DEEP);
  model.force.box[0] = 0.3;
  model.stiffness = stiffness;
  for (size_t k = 0; k < sizeof softens / sizeof *softens; ++k) {
    model.force.soften = softens[k];
    check_superposition(lungs, &model, ranks[k], softens[k] == 0.0 ? 1e-12 : 3e-4);
  }
  free(stiffness);
}

TEST(test_projection_impossible_softening_refused) {
  supine_mesh mesh = {0};
  supine_lungs lungs = {0};
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_projection made;
  supine_error error;
  assert_int_equal(supine_lungs_phantom_create(20000, 6000.0, &mesh, NULL), SUPINE_OK);
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, &lungs, NULL), SUPINE_OK);
  model.force.soften = 1.0;
  assert_int_equal(supine_projection_create(&lungs, &model, 5, &made, &error),
                   SUPINE_ERROR_ARGUMENT);
  supine_projection_free(&made);
  assert_string_equal(error.remedies[0].argument, "reach");
  model = supine_physics_model(SUPINE_LAW_DEEP);
  model.force.soften = 18.0;
  assert_int_equal(supine_projection_create(&lungs, &model, 5, &made, &error),
                   SUPINE_ERROR_ARGUMENT);
  supine_projection_free(&made);
  assert_says(error.message, "too large for a basis of these lungs");
  model.force = (supine_force_law){0};
  assert_int_equal(supine_projection_create(&lungs, &model, 5, &made, &error),
                   SUPINE_ERROR_NUMERICAL);
  supine_projection_free(&made);
  supine_lungs_free(&lungs);
  supine_mesh_free(&mesh);
}

/* Compare the modes' singular values, error and functions of gravity with a dense SVD. Decompose
 * the matrix of the projection's coefficients, with row i multiplied by sqrt(weight[i]). */
static void check_modes(const supine_expansion *expansion, const double *weight, size_t most) {
  const size_t n = expansion->row_count;
  const size_t terms = supine_sh_count(expansion->band);
  double *c = coefficients_of(expansion);
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
      supine_sh_compress_modes(expansion, weight, most, &modes, singular, &total, NULL), SUPINE_OK);
  assert_close(total, energy, 1e-12 * energy);
  double tail = 0.0;
  for (size_t k = 0; k < terms; ++k) {
    const double expected = gsl_vector_get(s, k);
    /* The Gram matrix loses half the digits of small singular values. */
    if (k < modes.mode_count) {
      assert_close(singular[k], expected, 1e-7 * gsl_vector_get(s, 0));
    } else {
      tail += expected * expected;
    }
  }
  double error = 0.0; /* squared error, the least possible with so many modes */
  for (size_t i = 0; i < n; ++i) {
    for (size_t t = 0; t < terms; ++t) {
      double approximation = 0.0;
      for (size_t k = 0; k < modes.mode_count; ++k) {
        approximation +=
            (double)modes.coefficients[i * modes.mode_count + k] * modes.modes[k * terms + t];
      }
      error += weight[i] * (approximation - c[i * terms + t]) * (approximation - c[i * terms + t]);
    }
  }
  assert_close(sqrt(error / energy), sqrt(tail / energy), 1e-6);
  for (size_t a = 0; a < modes.mode_count; ++a) { /* modes are orthonormal */
    for (size_t b = 0; b <= a; ++b) {
      double dot = 0.0;
      for (size_t t = 0; t < terms; ++t) {
        dot += modes.modes[a * terms + t] * modes.modes[b * terms + t];
      }
      assert_close(dot, a == b ? 1.0 : 0.0, 1e-6);
    }
  }
  supine_sh_compression_free(&modes);
  gsl_matrix_free(u);
  gsl_matrix_free(v);
  gsl_vector_free(s);
  free(c);
}

TEST(test_modes_equal_dense_decomposition) {
  const supine_lungs *lungs = *state;
  const size_t n = lungs->mesh.vertex_count;
  double *weight = calloc(n, sizeof *weight);
  for (size_t i = 0; i < n; ++i) {
    weight[i] = 1.0 + fabs(lungs->mesh.vertices[3 * i]);
  }
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_projection projection;
  assert_int_equal(supine_projection_create(lungs, &model, 5, &projection, NULL), SUPINE_OK);
  check_modes(&projection.expansion, weight, 3);
  check_modes(&projection.expansion, weight, 16);
  supine_projection_free(&projection);
  model.force.soften = 1.0;
  model.reach = 10.0;
  assert_int_equal(supine_projection_create(lungs, &model, 5, &projection, NULL), SUPINE_OK);
  check_modes(&projection.expansion, weight, 7);
  check_modes(&projection.expansion, weight, 16);
  supine_projection_free(&projection);
  free(weight);
}

/* Modes with singular values of 3e-7 of the largest are kept. Modes of 3e-8, which is below the
 * rounding error of the Gram matrix, are dropped. */
TEST(test_modes_below_rounding_dropped) {
  enum { ROWS = 7, TERMS = 4 };
  static const double sizes[TERMS] = {2.0, 0.5, 2.0 * 3e-7, 2.0 * 3e-8};
  double columns[ROWS * TERMS] = {0.0};
  double functions[TERMS * TERMS] = {0.0};
  for (size_t t = 0; t < TERMS; ++t) {
    columns[(t + 2) * TERMS + t] = sizes[t];
    functions[t * TERMS + t] = 1.0;
  }
  const supine_expansion expansion = {
      .row_count = ROWS, .band = 1, .rank = TERMS, .columns = columns, .functions = functions};
  supine_compression modes;
  double singular[TERMS];
  assert_int_equal(supine_sh_compress_modes(&expansion, NULL, TERMS, &modes, singular, NULL, NULL),
                   SUPINE_OK);
  assert_int_equal(modes.mode_count, 3);
  assert_close(singular[2], 6e-7, 1e-9);
  assert_close(singular[3], 0.0, 0.0);
  assert_close(fabs(modes.modes[2 * TERMS + 2]), 1.0, 1e-3);
  supine_sh_compression_free(&modes);
}

/* A percentile is the upper edge of its bin. From 2^k to 2^(k + 1), bins are 2^k / 256 wide. */
TEST(test_tally_percentile_is_upper_edge_of_bin) {
  supine_tally *tally = calloc(1, sizeof *tally);
  supine_tally *other = calloc(1, sizeof *other);
  static const double low[] = {1.0, 1.001, 1.003};
  static const double high[] = {5.01};
  supine_projection_tally_add(tally, 3, low);
  supine_projection_tally_add(other, 1, high);
  supine_projection_tally_merge(tally, other);
  assert_close(supine_projection_tally_percentile(tally, 0.75), 1.0 + 1.0 / 256.0, 0.0);
  assert_close(supine_projection_tally_percentile(tally, 0.76), 5.015625, 0.0);
  assert_close(tally->largest, 5.01, 0.0);
  assert_close(tally->square_sum, 28.108110, 1e-12);
  free(tally);
  free(other);
}

TEST_GROUP(setup, teardown)
