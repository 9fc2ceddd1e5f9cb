/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the fit of a displacement law to a patient's surfaces: recovery of known constants, expected
 * errors, and refused input. */
#include "tests/helpers/test.h"

#include <gsl/gsl_cdf.h>
#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>

#include "base/vec3.h"
#include "precompute/patient/matching.h"
#include "precompute/patient/patient_file.h"
#include "precompute/physics/solve.h"

#include "tests/helpers/patient_helpers.h"

static const supine_patient_pairs no_landmarks;

/* Return the vertices (malloc), displaced by the model of truth(). Set `largest` to the largest
 * displacement, mm. */
static double *moved_by_truth(const supine_lungs *lungs, double *largest) {
  const supine_model model = truth();
  supine_solution solution = {0};
  supine_error error;
  double *positions = malloc(3 * lungs->mesh.vertex_count * sizeof *positions);
  assert_int_equal(supine_physics_solve(lungs, &model, supine_gravity, &solution, &error),
                   SUPINE_OK);
  supine_physics_solution_apply(&solution, &lungs->mesh, 1.0, positions);
  *largest = supine_physics_solution_largest(&solution);
  supine_physics_solution_free(&solution);
  return positions;
}

TEST_FULL(test_fit_surface_known_law_recovered_on_another_mesh) {
  supine_lungs rest = {0};
  supine_lungs other = {0};
  if (!helper_real_left_lung(&rest, &other)) {
    skip();
  }
  double largest = 0.0;
  double *expected = moved_by_truth(&rest, &largest);
  double *target = moved_by_truth(&other, &largest);
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  gsl_rng_set(random, 271);
  supine_mesh moved = other.mesh;
  for (size_t i = 0; i < 3 * moved.vertex_count; ++i) {
    target[i] += gsl_ran_gaussian(random, 0.5);
  }
  gsl_rng_free(random);
  moved.vertices = target;

  const supine_patient_fit_options options = {.law = SUPINE_PATIENT_PAPER,
                                              .gravity = {0.0, 1.0, 0.0}};
  static supine_patient_record fit;
  supine_error error = {0};
  if (supine_patient_fit_surface(&rest, &moved, &no_landmarks, &options, false, &fit, &error) !=
      SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  const supine_patient patient = fit.patient;
  const supine_patient_surface_report surface = fit.surface;
  supine_patient_record record = {.patient = patient, .from_surface = true};
  memcpy(record.state[1].gravity, supine_gravity, sizeof supine_gravity);
  record.force = supine_patient_force(&patient.power, 0.4, supine_gravity);
  supine_model found = truth();
  supine_resting resting = supine_physics_resting_default();
  supine_scan scan;
  double *directions = malloc(4 * rest.mesh.vertex_count * sizeof *directions);
  assert_int_equal(
      supine_patient_model(&record, &rest, &resting, &scan, directions, &found, &error), SUPINE_OK);
  supine_solution solution = {0};
  assert_int_equal(supine_physics_solve(&rest, &found, supine_gravity, &solution, &error),
                   SUPINE_OK);
  double *positions = malloc(3 * rest.mesh.vertex_count * sizeof *positions);
  supine_physics_solution_apply(&solution, &rest.mesh, -1.0, positions);
  double square = 0.0;
  for (size_t i = 0; i < 3 * rest.mesh.vertex_count; ++i) {
    square += pow(positions[i] - expected[i], 2.0) / (double)rest.mesh.vertex_count;
  }
  const double *c = patient.power.c;
  printf(
      "largest displacement %.1f mm; points off by %.3f mm RMS; distance of the surfaces %.2f mm, "
      "after the fit %.2f mm\n",
      largest, sqrt(square), surface.before, surface.after);
  for (size_t k = 0; k < SUPINE_PATIENT_CONSTANTS; ++k) {
    printf(" c%zu %.3f +- %.3f", k + 1, c[k], fit.report.error[k]);
  }
  printf("\n");
  assert_true(sqrt(square) <= 0.15);
  /* Y is the y coordinate in the lungs' bounding box, 0 to 1. The supine height is 1 - Y, and the
   * force has the terms 0.4 (1 - Y) - 0.2 Y, so its slope along Y is -0.6. */
  const supine_patient_applied *applied = &fit.applied;
  printf(
      "force: correlation with height %.3f, c7 to c9 %.3f %.3f %.3f, spread %.3f, residual %.3f, "
      "%zu blocks\n",
      applied->correlation, applied->slopes[0], applied->slopes[1], applied->slopes[2],
      applied->spread, applied->residual, applied->blocks);
  assert_true(applied->correlation > 0.9);
  static const double slopes[3] = {0.0, -0.6, 0.0};
  for (size_t k = 0; k < 3; ++k) {
    assert_true(fabs(applied->slopes[k] - slopes[k]) < 0.15);
  }
  assert_true(applied->residual < 0.3 * applied->spread);
  assert_true(fit.surface.matched > 0.95 && applied->blocks > 20);
  supine_physics_solution_free(&solution);
  free(directions);
  free(positions);
  free(expected);
  free(target);
  supine_lungs_free(&rest);
  supine_lungs_free(&other);
}

/* Displace a surface by a law other than `deep`, the default. Fit `deep` with kriging to the
 * displaced surface, on a coarser mesh. The fit reproduces the surface and its volume, because the
 * displacement along the normal determines the volume change. */
TEST(test_fit_surface_other_law_reaches_state_and_volume) {
  supine_mesh coarse = helper_lump(9, 70.3, 5);
  supine_mesh fine = helper_lump(15, 70.3, 5);
  supine_lungs rest = {0};
  supine_lungs other = {0};
  supine_error error;
  assert_int_equal(supine_lungs_create(&coarse, 1, NULL, &rest, &error), SUPINE_OK);
  assert_int_equal(supine_lungs_create(&fine, 1, NULL, &other, &error), SUPINE_OK);
  double largest = 0.0;
  supine_mesh moved = other.mesh;
  moved.vertices = moved_by_truth(&other, &largest);
  const supine_patient_fit_options options = {.gravity = {0.0, 1.0, 0.0}};
  static supine_patient_record fit;
  assert_int_equal(
      supine_patient_fit_surface(&rest, &moved, &no_landmarks, &options, false, &fit, &error),
      SUPINE_OK);
  printf("largest displacement %.1f mm; distance of the surfaces %.2f mm, after the fit %.3f; held "
         "out: deep %.2f, with kriging %.3f mm\n",
         largest, fit.surface.before, fit.surface.after,
         fit.report.held_out[SUPINE_PATIENT_SCORE_LAW],
         fit.report.held_out[SUPINE_PATIENT_SCORE_CORRECTED]);
  assert_true(fit.report.held_out[SUPINE_PATIENT_SCORE_LAW] >
              4.0 * fit.report.held_out[SUPINE_PATIENT_SCORE_CORRECTED]);
  assert_true(fit.surface.before > 3.0 && fit.surface.after < 0.2);
  /* A close surface does not show sliding: the expected error is that of other patients' fits. */
  assert_true(fit.report.expected_constant > 4.5 && fit.report.expected_point > 3.0);
  assert_true(fit.report.held_out[SUPINE_PATIENT_SCORE_CORRECTED] < 0.4);
  const double change = supine_mesh_volume(&moved) - supine_mesh_volume(&other.mesh);
  const double before = supine_mesh_volume(&rest.mesh);
  for (size_t i = 0; i < rest.mesh.vertex_count; ++i) {
    const supine_patient_place place = supine_patient_find_vertex(&rest, i);
    double u[3];
    supine_patient_displacement(&fit.patient, &place, 1.0, u);
    for (size_t k = 0; k < 3; ++k) {
      rest.mesh.vertices[3 * i + k] += u[k];
    }
  }
  const double share = (supine_mesh_volume(&rest.mesh) - before) / change;
  printf("volume change %.0f mL; the change by the fit is %.3f of it\n", 1e-3 * change, share);
  assert_true(fabs(share - 1.0) < 0.03);
  free(moved.vertices);
  supine_mesh_free(&coarse);
  supine_mesh_free(&fine);
  supine_lungs_free(&rest);
  supine_lungs_free(&other);
}

/* Make a model of either of two scans from a law whose displacement misses the measured volumes by
 * 5
 * %. The displaced surface holds exactly what was measured: `measured` of each lung, or of all. */
static void check_held(const supine_patient_record *fit, const supine_lungs *scan, size_t shown,
                       double other_ml, bool each) {
  static supine_patient_record record;
  supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  supine_resting resting = supine_physics_resting_default();
  supine_scan state;
  supine_error error = {0};
  char text[512];
  double *arrays = malloc(4 * scan->mesh.vertex_count * sizeof *arrays);
  record = *fit;
  record.volume[shown] = scan->volume[0];
  record.volume[1 - shown] = other_ml;
  memset(record.measured_lung, 0, sizeof record.measured_lung);
  record.measured_lung[1 - shown][0] = each ? other_ml : 0.0;
  if (supine_patient_model(&record, scan, &resting, &state, arrays, &model, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  const double *held = record.lung_volume[1 - shown];
  printf("scan %zu: held %.6f of %.6f mL, moved by %.2f mm\n", shown, held[0], other_ml,
         record.offset[0]);
  assert_int_equal(record.shown, shown);
  assert_true(record.holds_measured && fabs(held[0] + held[1] - other_ml) < 1e-9 * other_ml);
  assert_true(fabs(record.offset[0]) > 0.2 && fabs(record.offset[0]) < 3.0);
  assert_false(supine_patient_describe_volume(&record, text, sizeof text));
  assert_says(text, "as measured");
  free(arrays);
}

TEST(test_model_measured_volume_held_exactly) {
  supine_mesh lump = helper_lump(9, 70.3, 5);
  supine_lungs fuller = {0};
  supine_lungs emptier = {0};
  supine_error error;
  double largest = 0.0;
  assert_int_equal(supine_lungs_create(&lump, 1, NULL, &emptier, &error), SUPINE_OK);
  supine_mesh moved = emptier.mesh;
  moved.vertices = moved_by_truth(&emptier, &largest);
  assert_int_equal(supine_lungs_create(&moved, 1, &emptier.midline, &fuller, &error), SUPINE_OK);
  const supine_patient_fit_options options = {.gravity = {0.0, 1.0, 0.0}};
  static supine_patient_record fit;
  assert_int_equal(supine_patient_fit_surface(&fuller, &emptier.mesh, &no_landmarks, &options,
                                              false, &fit, &error),
                   SUPINE_OK);
  fit.from_surface = true;
  fit.state[0] = (supine_state){.gravity = {0.0, 1.0, 0.0}, .volume = {SUPINE_VOLUME_FULL, 0.0}};
  fit.state[1] = (supine_state){.gravity = {0.0, 1.0, 0.0}, .volume = {SUPINE_VOLUME_REST, 0.0}};
  memcpy(fit.emptier[0], emptier.minimum, sizeof emptier.minimum);
  memcpy(fit.emptier[1], emptier.maximum, sizeof emptier.maximum);
  fit.force = supine_patient_force(&fit.patient.power, 0.4, supine_gravity);
  check_held(&fit, &fuller, 0, 1.05 * emptier.volume[0], true);
  check_held(&fit, &fuller, 0, 1.05 * emptier.volume[0], false);
  check_held(&fit, &emptier, 1, 0.95 * fuller.volume[0], true);
  free(moved.vertices);
  supine_mesh_free(&lump);
  supine_lungs_free(&fuller);
  supine_lungs_free(&emptier);
}

/* The correlation of the force with height is low for a force fixed to the body, high for a force
 * along gravity, and negative if gravity is reversed. */
TEST(test_fit_surface_force_fixed_to_body_low_correlation) {
  supine_mesh lump = helper_lump(9, 70.3, 5);
  supine_lungs rest = {0};
  supine_error error;
  assert_int_equal(supine_lungs_create(&lump, 1, NULL, &rest, &error), SUPINE_OK);
  supine_model model = truth();
  double found[3];
  for (int k = 0; k < 3; ++k) {
    supine_solution solution = {0};
    supine_mesh moved = rest.mesh;
    static supine_patient_record fit;
    model.force = k == 0 ? (supine_force_law){.base = 0.5, .box = {0.9, 0.0, 0.1}}
                         : (supine_force_law){.base = 0.6, .gain = 0.8};
    assert_int_equal(supine_physics_solve(&rest, &model, supine_gravity, &solution, &error),
                     SUPINE_OK);
    moved.vertices = malloc(3 * moved.vertex_count * sizeof(double));
    supine_physics_solution_apply(&solution, &rest.mesh, 1.0, moved.vertices);
    const supine_patient_fit_options options = {.law = SUPINE_PATIENT_PAPER,
                                                .gravity = {0.0, k == 2 ? -1.0 : 1.0, 0.0}};
    assert_int_equal(
        supine_patient_fit_surface(&rest, &moved, &no_landmarks, &options, false, &fit, &error),
        SUPINE_OK);
    found[k] = fit.applied.correlation;
    printf("correlation %.3f, c7 to c9 %.3f %.3f %.3f, spread %.3f, residual %.3f\n",
           fit.applied.correlation, fit.applied.slopes[0], fit.applied.slopes[1],
           fit.applied.slopes[2], fit.applied.spread, fit.applied.residual);
    assert_true(fit.applied.residual < 0.1 * fit.applied.spread);
    assert_true(fabs(fit.applied.slopes[0] - (k == 0 ? 0.9 : 0.0)) < 0.05);
    assert_true(fabs(fit.applied.slopes[1] - (k == 0 ? 0.0 : -0.8)) < 0.05);
    free(moved.vertices);
    supine_physics_solution_free(&solution);
  }
  assert_true(fabs(found[0]) < 0.5);
  assert_true(found[1] > 0.95);
  assert_true(fabs(found[1] + found[2]) < 1e-6);
  supine_mesh_free(&lump);
  supine_lungs_free(&rest);
}

/* The weights are Tukey's biweight, which is 0 beyond 4.685 standard deviations (95 % efficiency).
 * The standard deviation is estimated as 1.4826 times the median distance, which outliers hardly
 * change. */
TEST(test_matching_weigh_beyond_4_685_sigma_no_weight) {
  enum { NORMAL = 2000, CHECKED = 4, OUTLIERS = 100, COUNT = NORMAL + CHECKED + OUTLIERS };
  static const double sigma = 0.37;
  static const double checked_sigmas[CHECKED] = {1.5, -3.0, 4.5, -4.9};
  supine_patient_matching m = {.count = COUNT};
  m.rows = calloc(COUNT, sizeof *m.rows);
  m.match = malloc(COUNT * sizeof *m.match);
  m.space = malloc(COUNT * sizeof *m.space);
  for (size_t i = 0; i < COUNT; ++i) {
    m.rows[i].weight = 1.0;
    m.match[i].distance = i < NORMAL ? sigma * gsl_cdf_ugaussian_Pinv(((double)i + 0.5) / NORMAL)
                          : i < NORMAL + CHECKED ? sigma * checked_sigmas[i - NORMAL]
                                                 : 40.0 + 0.1 * (double)i;
  }
  assert_int_equal(supine_patient_matching_weigh(&m, 0.0, NULL), SUPINE_OK);
  assert_true(m.matched == 1.0);
  for (size_t k = 0; k < CHECKED; ++k) {
    const double t = checked_sigmas[k] / 4.685;
    const double expected = fabs(t) < 1.0 ? pow(1.0 - t * t, 2.0) : 0.0;
    /* The outliers, 5 % of all rows, raise the median distance, and so the weights. */
    assert_true(fabs(m.rows[NORMAL + k].weight - expected) < 0.07);
    assert_true(k > 1 || m.rows[NORMAL + k].weight >= expected);
  }
  assert_true(m.rows[NORMAL + 2].weight > 0.0 && m.rows[NORMAL + 3].weight < 0.01);
  assert_true(m.rows[COUNT - 1].weight == 0.0);
  assert_true(m.rms > 0.8 * sigma && m.rms < sigma);
  free(m.rows);
  free(m.match);
  free(m.space);
}

static void refused(const supine_lungs *rest, const supine_mesh *moved, const char *words) {
  const supine_patient_fit_options options = {.gravity = {0.0, 1.0, 0.0}};
  static supine_patient_record fit;
  supine_error error = {0};
  assert_int_equal(
      supine_patient_fit_surface(rest, moved, &no_landmarks, &options, false, &fit, &error),
      SUPINE_ERROR_MESH);
  assert_says(error.message, words);
}

TEST(test_fit_surface_wrong_frame_unit_or_side_refused) {
  supine_mesh lump = helper_lump(7, 70.3, 5);
  supine_lungs rest = {0};
  supine_error error;
  assert_int_equal(supine_lungs_create(&lump, 1, NULL, &rest, &error), SUPINE_OK);
  supine_mesh moved = rest.mesh;
  moved.vertices = malloc(3 * moved.vertex_count * sizeof(double));
  const size_t n = 3 * moved.vertex_count;
  memcpy(moved.vertices, rest.mesh.vertices, n * sizeof(double));
  refused(&rest, &moved, "the two surfaces are the same");
  for (size_t i = 0; i < n; ++i) {
    moved.vertices[i] = 0.1 * rest.mesh.vertices[i];
  }
  refused(&rest, &moved, "overlap too little along");
  for (size_t i = 0; i < n; ++i) {
    moved.vertices[i] = rest.mesh.vertices[i] + (i % 3 == 2 ? 400.0 : 0.0);
  }
  refused(&rest, &moved, "overlap too little along z");
  for (size_t i = 0; i < n; ++i) { /* move to the other side of the chest */
    moved.vertices[i] = rest.mesh.vertices[i] - (i % 3 == 0 ? 150.0 : 0.0);
  }
  refused(&rest, &moved, "overlap too little along x");
  uint32_t *inwards = malloc(3 * moved.triangle_count * sizeof *inwards);
  for (size_t t = 0; t < moved.triangle_count; ++t) {
    inwards[3 * t] = moved.triangles[3 * t];
    inwards[3 * t + 1] = moved.triangles[3 * t + 2];
    inwards[3 * t + 2] = moved.triangles[3 * t + 1];
  }
  for (size_t i = 0; i < n; ++i) {
    moved.vertices[i] = 1.05 * rest.mesh.vertices[i];
  }
  moved.triangles = inwards;
  refused(&rest, &moved, "have a normal like that of the nearest point");
  free(inwards);
  free(moved.vertices);
  supine_mesh_free(&lump);
  supine_lungs_free(&rest);
}
