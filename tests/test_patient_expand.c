/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Expandability from motion: a lesion comes back from a surface of another meshing with noise, is
 * kept where it is there and not where it is not, and slopes are those of differences. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>
#include <gsl/gsl_statistics.h>

#include "precompute/lungs/disease.h"
#include "precompute/lungs/phantom.h"
#include "precompute/patient/patient_file.h"
#include "precompute/patient/surfaces.h"
#include "precompute/physics/solve.h"

#include "lungs_helpers.h"

static const double supine_gravity[3] = {0.0, 1.0, 0.0};

/* The truth: c1 to c6, and (18) as it is supine. */
static supine_model truth(void) {
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  model.reach = 10.0;
  model.force = (supine_force_law){.base = 0.9, .gain = 0.4, .box = {0.0, -0.2, 0.0}};
  model.direction =
      (supine_direction_law){.model = SUPINE_DIRECTION_BOX, .c = {6.0, 2.6, 15.0, 1.0, 26.0, 1.3}};
  return model;
}

static double *stiffness_of(const supine_lungs *lungs, const supine_lesion *lesion) {
  const size_t n = lungs->mesh.vertex_count;
  double *e = malloc(n * sizeof *e);
  for (size_t i = 0; i < n; ++i) {
    e[i] = 1.0;
  }
  if (lesion != NULL) {
    assert_int_equal(supine_tissue_add_lesion(lungs, lesion, e, NULL, NULL), SUPINE_OK);
  }
  return e;
}

/* The lungs as the truth with a lesion (NULL: none) moves them, with noise on every coordinate. */
static double *moved_by_truth(const supine_lungs *lungs, const supine_lesion *lesion,
                              double noise) {
  supine_model model = truth();
  supine_solution solution = {0};
  supine_error error;
  double *e = stiffness_of(lungs, lesion);
  double *positions = malloc(3 * lungs->mesh.vertex_count * sizeof *positions);
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  model.stiffness = e;
  assert_int_equal(supine_physics_solve(lungs, &model, supine_gravity, &solution, &error),
                   SUPINE_OK);
  supine_physics_solution_apply(&solution, &lungs->mesh, 1.0, positions);
  gsl_rng_set(random, 271);
  for (size_t i = 0; i < 3 * lungs->mesh.vertex_count; ++i) {
    positions[i] += gsl_ran_gaussian(random, noise);
  }
  gsl_rng_free(random);
  supine_physics_solution_free(&solution);
  free(e);
  return positions;
}

/* Of log E as found with that of the truth, over the vertices. */
static double correlation(const supine_lungs *lungs, const supine_patient_stiffness *found,
                          const supine_lesion *lesion) {
  const size_t n = lungs->mesh.vertex_count;
  double *expected = stiffness_of(lungs, lesion);
  double *e = malloc(n * sizeof *e);
  supine_patient_stiffness_of(found, lungs, e);
  for (size_t i = 0; i < n; ++i) {
    expected[i] = log(expected[i]);
    e[i] = log(e[i]);
  }
  const double r = gsl_stats_correlation(expected, 1, e, 1, n);
  free(expected);
  free(e);
  return r;
}

/* Fits the lungs at rest to others of the same shape, moved by the truth. */
static void fit(const supine_lungs *rest, const supine_lungs *other, const supine_lesion *lesion,
                supine_patient_surface_fit *found) {
  const supine_model model = truth(); /* its reach is known; the rest is found */
  supine_mesh state = other->mesh;
  const supine_patient_surface_task task = {.rest = rest,
                                            .state = &state,
                                            .model = &model,
                                            .gravity = {0.0, 1.0, 0.0},
                                            .expandability = true};
  supine_error error = {0};
  state.vertices = moved_by_truth(other, lesion, 0.5);
  if (supine_patient_fit_surface(&task, found, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  printf("fitted %.3f and %.3f mm without and with, held out %.3f and %.3f, E %.2f to %.2f\n",
         found->expand.fitted[0], found->expand.fitted[1], found->expand.held_out[0],
         found->expand.held_out[1], found->expand.softest, found->expand.stiffest);
  assert_true(found->expand.tried);
  free(state.vertices);
}

static void expect_lesion(const supine_lungs *rest, const supine_lungs *other,
                          const supine_lesion *lesion) {
  supine_patient_surface_fit found;
  fit(rest, other, lesion, &found);
  const double r = correlation(rest, &found.stiffness, lesion);
  printf("correlation of log stiffness %.4f\n", r);
  assert_true(r >= 0.9);
  assert_true(found.expand.kept);
  assert_true(found.expand.held_out[1] < 0.5 * found.expand.held_out[0]);
  assert_true(fabs(found.expand.stiffest / found.expand.softest - 3.0) < 0.3);
  /* What is said to be held out is what the regions had not seen. */
  assert_true(found.report.held_out.law[SUPINE_PATIENT_PAPER] == found.expand.held_out[1]);
}

static void test_lesion_of_a_real_lung_comes_back(void **state_) {
  (void)state_;
  static const char *const coarse[] = {"lungs/chaste_left_5k.obj"};
  static const char *const fine[] = {"lungs/chaste_left.ply"};
  supine_lungs rest = {0};
  supine_lungs other = {0};
  if (!helper_real_lungs(coarse, 1, SUPINE_AXES_LPS, &rest) ||
      !helper_real_lungs(fine, 1, SUPINE_AXES_LPS, &other)) {
    supine_lungs_free(&rest);
    skip();
  }
  const supine_lesion lesion = {{110.0, -200.0, -230.0}, 60.0, 3.0};
  expect_lesion(&rest, &other, &lesion);
  supine_lungs_free(&rest);
  supine_lungs_free(&other);
}

/* Made lungs, both: of other vertices, but of one shape as far as 0.2 mm go. */
static void made(size_t vertices, supine_lungs *lungs) {
  supine_mesh mesh = {0};
  supine_error error;
  assert_int_equal(supine_phantom_create(vertices, 6000.0, &mesh, &error), SUPINE_OK);
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, lungs, &error), SUPINE_OK);
  supine_mesh_free(&mesh);
}

static void test_lesion_of_made_lungs_comes_back(void **state_) {
  (void)state_;
  const supine_lesion lesion = {{-108.0, -139.0, -195.0}, 64.0, 3.0};
  supine_lungs rest = {0};
  supine_lungs other = {0};
  made(1600, &rest);
  made(6000, &other);
  expect_lesion(&rest, &other, &lesion);
  supine_lungs_free(&rest);
  supine_lungs_free(&other);
}

static void test_even_lungs_keep_no_stiffness(void **state_) {
  (void)state_;
  supine_lungs rest = {0};
  supine_lungs other = {0};
  supine_patient_surface_fit found;
  made(1600, &rest);
  made(6000, &other);
  fit(&rest, &other, NULL, &found);
  assert_false(found.expand.kept);
  assert_true(found.stiffness.count[0] == 0 && found.stiffness.count[1] == 0);
  assert_true(found.report.held_out.law[SUPINE_PATIENT_PAPER] < 1.0);
  supine_lungs_free(&rest);
  supine_lungs_free(&other);
}

/* By central differences of fourth order, of every value, centre and radius. */
static void test_slopes_are_those_of_differences(void **state_) {
  (void)state_;
  static const double weights[4] = {1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0};
  const supine_lesion lesion = {{-108.0, -139.0, -195.0}, 64.0, 3.0};
  const supine_model model = truth();
  supine_lungs rest = {0};
  made(900, &rest);
  supine_mesh state = rest.mesh;
  state.vertices = moved_by_truth(&rest, &lesion, 0.5);
  supine_patient_matching m = {0};
  supine_error error;
  double rms;
  assert_int_equal(supine_patient_matching_create(&rest, &state, &model, 700, 0, &m, &error),
                   SUPINE_OK);
  supine_patient_matching_find(&m);
  (void)supine_patient_matching_weigh(&m, 0.0, &rms);
  supine_patient_stiffness at = {
      .count = {1, 2},
      .mode = {{{0.7, {101.3, -120.9, -60.2}, 71.3}},
               {{-0.4, {-97.2, -155.7, -171.4}, 58.1}, {0.9, {-118.3, -90.1, -40.7}, 66.6}}}};
  supine_patient_power begin;
  double cost;
  double unused[15];
  double slopes[15];
  assert_int_equal(supine_patient_power_fit(m.rows, m.count, SUPINE_PATIENT_TRANSLATION,
                                            supine_patient_starts[0], 200, 1e-12, &begin, &error),
                   SUPINE_OK);
  supine_patient_power power = begin;
  assert_int_equal(supine_patient_expand_cost(&m, SUPINE_PATIENT_TRANSLATION, &at, &power, &cost,
                                              slopes, &error),
                   SUPINE_OK);
  double *unknown[15];
  for (size_t k = 0; k < 3; ++k) {
    supine_patient_mode *mode = k == 0 ? &at.mode[0][0] : &at.mode[1][k - 1];
    double *of[5] = {&mode->value, &mode->centre[0], &mode->centre[1], &mode->centre[2],
                     &mode->radius};
    memcpy(unknown + 5 * k, of, sizeof of);
  }
  for (size_t j = 0; j < 15; ++j) {
    /* As large as a step may be that few vertices cross the regions' rims in: kinks of the third
     * derivative. */
    const double step = j % 5 == 0 ? 1e-3 : 2e-2;
    const double kept = *unknown[j];
    double difference = 0.0;
    for (int k = 0; k < 4; ++k) {
      double varied = 0.0;
      supine_patient_power from = power;
      *unknown[j] = kept + step * (k < 2 ? k - 2 : k - 1);
      assert_int_equal(supine_patient_expand_cost(&m, SUPINE_PATIENT_TRANSLATION, &at, &from,
                                                  &varied, unused, &error),
                       SUPINE_OK);
      difference += weights[k] * varied / step;
    }
    *unknown[j] = kept;
    printf("%2zu: %14.9f by the adjoint, %14.9f by differences\n", j, slopes[j], difference);
    assert_true(fabs(slopes[j] - difference) < 1e-6 * helper_largest(15, slopes));
  }
  supine_patient_matching_free(&m);
  free(state.vertices);
  supine_lungs_free(&rest);
}

int main(void) {
  static const struct CMUnitTest tests[] = {cmocka_unit_test(test_lesion_of_a_real_lung_comes_back),
                                            cmocka_unit_test(test_lesion_of_made_lungs_comes_back),
                                            cmocka_unit_test(test_even_lungs_keep_no_stiffness),
                                            cmocka_unit_test(test_slopes_are_those_of_differences)};
  (void)gsl_set_error_handler_off();
  return cmocka_run_group_tests(tests, NULL, NULL);
}
