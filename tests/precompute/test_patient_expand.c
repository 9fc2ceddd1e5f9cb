/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the expandability of tissue computed from its motion: a lesion and a gradient are recovered
 * from a noisy surface of another mesh, and uniform tissue is found to be uniform. */
#include "tests/helpers/test.h"

#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>
#include <gsl/gsl_statistics.h>

#include "precompute/lungs/disease.h"
#include "precompute/lungs/expandability.h"
#include "precompute/lungs/phantom.h"
#include "precompute/patient/matching.h"
#include "precompute/physics/solve.h"

#include "tests/helpers/patient_helpers.h"

static double *stiffness_of(const supine_lungs *lungs, const supine_lesion *lesion) {
  const size_t n = lungs->mesh.vertex_count;
  double *e = malloc(n * sizeof *e);
  for (size_t i = 0; i < n; ++i) {
    e[i] = 1.0;
  }
  if (lesion != NULL) {
    assert_int_equal(supine_lungs_add_lesion(lungs, lesion, e, &(size_t){0}, NULL), SUPINE_OK);
  }
  return e;
}

static double *gradient_of(const supine_lungs *lungs, const supine_expandability_law *law) {
  const size_t n = lungs->mesh.vertex_count;
  double *e = malloc(n * sizeof *e);
  supine_lungs_expandability_regional(lungs, law, e);
  for (size_t i = 0; i < n; ++i) {
    e[i] = 1.0 / e[i];
  }
  return e;
}

/* Return the vertices (malloc), displaced by the model of truth() with the stiffness e of each
 * vertex, plus Gaussian noise of `noise` mm in each coordinate. */
static double *moved_by_truth(const supine_lungs *lungs, const double *e, double noise) {
  supine_model model = truth();
  supine_solution solution = {0};
  supine_error error;
  double *positions = malloc(3 * lungs->mesh.vertex_count * sizeof *positions);
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  assert_int_equal(supine_physics_strain_create(lungs, e, NULL, &model.strain, &error), SUPINE_OK);
  assert_int_equal(supine_physics_solve(lungs, &model, supine_gravity, &solution, &error),
                   SUPINE_OK);
  supine_physics_solution_apply(&solution, &lungs->mesh, 1.0, positions);
  gsl_rng_set(random, 271);
  for (size_t i = 0; i < 3 * lungs->mesh.vertex_count; ++i) {
    positions[i] += gsl_ran_gaussian(random, noise);
  }
  gsl_rng_free(random);
  supine_physics_solution_free(&solution);
  supine_physics_strain_destroy(model.strain);
  return positions;
}

/* Return the stiffness found within half the radius of a lesion, relative to that outside the
 * lesion. Both are geometric means. */
static double contrast(const supine_lungs *lungs, const supine_patient_stiffness *found,
                       const supine_lesion *lesion) {
  const size_t n = lungs->mesh.vertex_count;
  double sum[2] = {0.0, 0.0};
  double count[2] = {0.0, 0.0};
  double *e = malloc(n * sizeof *e);
  supine_patient_stiffness_of(found, lungs, e);
  for (size_t i = 0; i < n; ++i) {
    const double *p = lungs->mesh.vertices + 3 * i;
    const double r =
        hypot(hypot(p[0] - lesion->centre[0], p[1] - lesion->centre[1]), p[2] - lesion->centre[2]) /
        lesion->radius;
    if (r < 0.5 || r > 1.0) {
      sum[r < 0.5] += log(e[i]);
      count[r < 0.5] += 1.0;
    }
  }
  free(e);
  return exp(sum[1] / count[1] - sum[0] / count[0]);
}

/* Compute the correlation of the found with the true log stiffness over all vertices, and the slope
 * of the regression of the found on the true. Free e, the true stiffness. */
static double agreement(const supine_lungs *lungs, const supine_patient_stiffness *found, double *e,
                        double *slope) {
  const size_t n = lungs->mesh.vertex_count;
  double *found_e = malloc(n * sizeof *found_e);
  supine_patient_stiffness_of(found, lungs, found_e);
  for (size_t i = 0; i < n; ++i) {
    e[i] = log(e[i]);
    found_e[i] = log(found_e[i]);
  }
  const double r = gsl_stats_correlation(e, 1, found_e, 1, n);
  *slope = gsl_stats_covariance(e, 1, found_e, 1, n) / gsl_stats_variance(e, 1, n);
  printf("stiffness found: correlation with the true one %.3f, slope %.3f\n", r, *slope);
  free(e);
  free(found_e);
  return r;
}

/* Fit `rest` to `other`, the same shape displaced by the model of truth() with the stiffness e of
 * each vertex. Free the array e. */
static void fit_uneven(const supine_lungs *rest, const supine_lungs *other, double *e,
                       supine_patient_record *found) {
  supine_mesh state = other->mesh;
  const supine_patient_pairs no_landmarks = {0};
  const supine_patient_fit_options options = {.gravity = {0.0, 1.0, 0.0}};
  supine_error error = {0};
  state.vertices = moved_by_truth(other, e, 0.5);
  if (supine_patient_fit_surface(rest, &state, &no_landmarks, &options, true, found, &error) !=
      SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  printf("error without and with regions: fitted %.3f and %.3f mm, held out %.3f and %.3f mm\n",
         found->expand.fitted[0], found->expand.fitted[1], found->expand.held_out[0],
         found->expand.held_out[1]);
  assert_true(found->expand.tried);
  free(state.vertices);
  free(e);
}

static void fit(const supine_lungs *rest, const supine_lungs *other, const supine_lesion *lesion,
                supine_patient_record *found) {
  fit_uneven(rest, other, stiffness_of(other, lesion), found);
}

static void expect_lesion(const supine_lungs *rest, const supine_lungs *other,
                          const supine_lesion *lesion, double least) {
  static supine_patient_record found;
  fit(rest, other, lesion, &found);
  const double times = contrast(rest, &found.stiffness, lesion);
  double slope;
  assert_true(agreement(rest, &found.stiffness, stiffness_of(rest, lesion), &slope) > least);
  printf("lesion found %.2f times as stiff, true value %.0f\n", times, lesion->factor);
  /* Regions are wider than the edge of the lesion. */
  assert_true(times > 1.9 && times < 1.2 * lesion->factor);
  assert_true(found.expand.kept);
  assert_true(found.expand.held_out[1] < 0.9 * found.expand.held_out[0]);
  /* The reported held-out error is that of the final fit, in which regions differ in stiffness. */
  assert_true(found.report.held_out[SUPINE_PATIENT_SCORE_CORRECTED] == found.expand.held_out[1]);
}

TEST_FULL(test_fit_real_lung_with_lesion_recovers_stiffness) {
  supine_lungs rest = {0};
  supine_lungs other = {0};
  if (!helper_real_left_lung(&rest, &other)) {
    skip();
  }
  const supine_lesion lesion = {{110.0, -200.0, -230.0}, 60.0, 3.0};
  expect_lesion(&rest, &other, &lesion, 0.85);
  supine_lungs_free(&rest);
  supine_lungs_free(&other);
}

/* Make synthetic lungs. Lungs with different numbers of vertices differ by at most 0.2 mm. */
static void make_lungs(size_t vertices, supine_lungs *lungs) {
  supine_mesh mesh = {0};
  supine_error error;
  assert_int_equal(supine_lungs_phantom_create(vertices, 6000.0, &mesh, &error), SUPINE_OK);
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, lungs, &error), SUPINE_OK);
  supine_mesh_free(&mesh);
}

TEST(test_fit_synthetic_lungs_with_lesion_recovers_stiffness) {
  const supine_lesion lesion = {{-108.0, -139.0, -195.0}, 64.0, 3.0};
  supine_lungs rest = {0};
  supine_lungs other = {0};
  make_lungs(1600, &rest);
  make_lungs(6000, &other);
  expect_lesion(&rest, &other, &lesion, 0.75);
  supine_lungs_free(&rest);
  supine_lungs_free(&other);
}

TEST(test_fit_uniform_lungs_keeps_no_region) {
  supine_lungs rest = {0};
  supine_lungs other = {0};
  static supine_patient_record found;
  make_lungs(1600, &rest);
  make_lungs(6000, &other);
  fit(&rest, &other, NULL, &found);
  assert_false(found.expand.kept);
  assert_true(found.stiffness.count == 0);
  assert_true(found.report.held_out[SUPINE_PATIENT_SCORE_CORRECTED] < 1.0);
  supine_lungs_free(&rest);
  supine_lungs_free(&other);
}

/* Check that an expandability that triples from apex to base is recovered. */
static void check_gradient(const supine_lungs *rest, const supine_lungs *other, double least) {
  const supine_expandability_law law = {SUPINE_EXPANDABILITY_LINEAR, 2, 0.5, 1.5};
  static supine_patient_record found;
  double slope;
  fit_uneven(rest, other, gradient_of(other, &law), &found);
  assert_true(found.expand.kept);
  assert_true(found.expand.held_out[1] < 0.5 * found.expand.held_out[0]);
  assert_true(agreement(rest, &found.stiffness, gradient_of(rest, &law), &slope) > least);
  assert_true(slope > 0.8 && slope < 1.2);
}

TEST(test_fit_synthetic_lungs_with_gradient_recovers_stiffness) {
  supine_lungs rest = {0};
  supine_lungs other = {0};
  make_lungs(1600, &rest);
  make_lungs(6000, &other);
  check_gradient(&rest, &other, 0.95);
  supine_lungs_free(&rest);
  supine_lungs_free(&other);
}

TEST_FULL(test_fit_real_lung_with_gradient_recovers_stiffness) {
  supine_lungs rest = {0};
  supine_lungs other = {0};
  if (!helper_real_left_lung(&rest, &other)) {
    skip();
  }
  check_gradient(&rest, &other, 0.97);
  supine_lungs_free(&rest);
  supine_lungs_free(&other);
}
