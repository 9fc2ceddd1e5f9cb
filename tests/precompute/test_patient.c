/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the fit of a displacement law to a patient's landmarks: held-out errors, recovery of known
 * constants, files of fitted laws, refused input. */
#include "tests/helpers/test.h"
#include "tests/helpers/sh_helpers.h"

#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>

#include <supine/volume.h>

#include "base/vec3.h"
#include "precompute/lungs/phantom.h"
#include "precompute/lungs/surface.h"
#include "precompute/patient/krige.h"
#include "precompute/patient/patient_file.h"
#include "precompute/validation/validation.h"

/* Fit a displacement law to pairs of points, as `supine fit` does. */
static void fit_pairs(const supine_patient_pairs *pairs, supine_patient_law law,
                      supine_patient_scan_motion moved, supine_patient *patient,
                      supine_patient_fit_report *report) {
  const supine_patient_fit_options options = {.law = law, .scan_motion = moved};
  supine_patient_row *rows = malloc(3 * pairs->count * sizeof *rows);
  supine_error error;
  assert_non_null(rows);
  patient->frame = supine_patient_frame_of_points(pairs->count, pairs->from, NULL);
  supine_patient_rows_of_pairs(&patient->frame, pairs, rows);
  if (supine_patient_fit(&options, rows, 0, pairs->count, patient, report, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  free(rows);
}

/* Draw random points in two lungs, in a box of about 230 x 150 x 240 mm. */
static supine_patient_pairs scatter(size_t count, unsigned long seed) {
  supine_patient_pairs pairs = {count, malloc(3 * count * sizeof(double)),
                                malloc(3 * count * sizeof(double)), NULL};
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  gsl_rng_set(random, seed);
  for (size_t i = 0; i < count; ++i) {
    double *p = pairs.from + 3 * i;
    p[0] = (i % 2 == 0 ? 1.0 : -1.0) * (17.3 + 97.1 * gsl_rng_uniform(random));
    p[1] = -151.7 + 149.3 * gsl_rng_uniform(random);
    p[2] = -203.1 + 241.9 * gsl_rng_uniform(random);
  }
  gsl_rng_free(random);
  return pairs;
}

/* Compute the displacement u, mm, of a point by the displacement law of `patient`. The point
 * belongs to the lung on its side of the midline. */
static void displace(const supine_patient *patient, const double point[3], double u[3]) {
  const supine_patient_place place = supine_patient_find(&patient->frame, point, 0.0);
  supine_patient_displacement(patient, &place, 1.0, u);
}

/* Displace points by the displacement law of `truth`, and add Gaussian noise with a standard
 * deviation of `noise` mm to each coordinate. */
static void move(supine_patient_pairs *pairs, const supine_patient *truth, double noise,
                 unsigned long seed) {
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  gsl_rng_set(random, seed);
  for (size_t i = 0; i < pairs->count; ++i) {
    double u[3];
    displace(truth, pairs->from + 3 * i, u);
    for (size_t k = 0; k < 3; ++k) {
      pairs->to[3 * i + k] = pairs->from[3 * i + k] + u[k] + gsl_ran_gaussian(random, noise);
    }
  }
  gsl_rng_free(random);
}

static supine_patient known(const supine_patient_pairs *pairs) {
  return (supine_patient){.law = SUPINE_PATIENT_PAPER,
                          .frame = supine_patient_frame_of_points(pairs->count, pairs->from, NULL),
                          .power = {.c = {7.3, 2.1, 5.9, 1.3, 21.7, 1.6, 0.2, -0.7, 0.3}}};
}

static supine_patient_record record_of(const supine_patient *patient) {
  supine_patient_record record = {
      .patient = *patient,
      .state = {{.gravity = {0.0, 1.0, 0.0}, .volume = {SUPINE_VOLUME_FULL, 0.0}},
                {.gravity = {0.0, 1.0, 0.0}, .volume = {SUPINE_VOLUME_REST, 0.0}}},
      .volume = {5321.5, 2410.25},
      .emptier = {{-100.0, -150.0, -200.0}, {100.5, 5.0, 40.0}},
      .report = {.points = 300,
                 .held_out = {10.5, 9.5, 6.5, 5.5, 4.25},
                 .baseline = 10.5,
                 .error = {0.5},
                 .has_errors = true,
                 .explained = 81.0},
      .expand = {.tried = true, .fitted = {0.75, 0.5}}};
  record.force = supine_patient_force(&patient->power, 0.4, record.state[1].gravity);
  return record;
}

/* The covariances are those of the formula in kriging.h. */
TEST(test_covariances_any_distance_equal_formula) {
  supine_patient_centre centre[200];
  double covariance[200];
  const supine_patient_centre here = {.side = 1, .size = 3.0};
  for (size_t i = 0; i < 200; ++i) {
    centre[i] = (supine_patient_centre){.side = i % 3 == 0 ? -1 : 1, .size = 0.17 * (double)i};
    centre[i].offset[i % 3] = 0.0137 * (double)(i * i * i) * (i % 2 == 0 ? 1.0 : -1.0);
  }
  supine_patient_covariances(&here, 200, centre, covariance);
  for (size_t i = 0; i < 200; ++i) {
    const double a = sqrt(3.0) * 0.0137 * (double)(i * i * i) / 90.0;
    const double q = i % 3 == 0 ? 1.0 / 3.0 : 1.0;
    const double sizes = sqrt(3.0 * fmax(2.0, 0.17 * (double)i));
    assert_close(covariance[i], 2.0 * sizes * q * (1.0 + a) * exp(-a), 1e-12);
  }
}

/* Five public pairs of images are each fitted in both directions. The cross-validated errors are
 * below those of a quadratic law on the same folds of points (`quadratic_rms`, commit 220ee0d). */
TEST_FULL(test_fit_public_landmarks_err_less_than_quadratic_law) {
  static const struct {
    const char *name;
    double quadratic_rms[2]; /* RMS error of the quadratic law, mm: inhaled to exhaled image, and
                                the reverse */
  } cases[] = {{"054", {3.01, 3.30}},
               {"055", {8.07, 9.83}},
               {"056", {3.83, 4.44}},
               {"094", {6.49, 7.02}},
               {"097", {6.75, 8.03}}};
  double mean[2] = {0.0};
  double band = 0.0;
  double stated = 0.0;
  for (size_t c = 0; c < 10; ++c) {
    const bool exhaled = c % 2 == 1;
    char path[512];
    supine_patient_pairs pairs = {0};
    supine_patient patient;
    supine_patient_fit_report report;
    supine_error error;
    (void)snprintf(path, sizeof path, "%s/landmarks/case%s_landmarks_mm.csv", SUPINE_TEST_DATA,
                   cases[c / 2].name);
    if (access(path, R_OK) != 0) {
      printf("skipped: the landmarks are missing\n");
      skip();
    }
    assert_int_equal(supine_patient_pairs_load(path, !exhaled, &pairs, &error), SUPINE_OK);
    assert_int_equal(supine_patient_pairs_check(&pairs, true, &error), SUPINE_OK);
    assert_true((supine_patient_pairs_growth(&pairs) > 1.0) == exhaled);
    fit_pairs(&pairs, SUPINE_PATIENT_DEEP, SUPINE_PATIENT_TRANSLATION, &patient, &report);
    const double *held = report.held_out;
    const double kept = held[SUPINE_PATIENT_SCORE_CORRECTED];
    printf("%s from %s: translation %.2f, affine %.2f, deep %.2f, with kriging %.2f mm, expected "
           "%.2f mm, %.1f %% within the band, explained %.0f %%, ratio %.3f\n",
           cases[c / 2].name, exhaled ? "exhaled" : "inhaled",
           held[SUPINE_PATIENT_SCORE_TRANSLATION], held[SUPINE_PATIENT_SCORE_AFFINE],
           held[SUPINE_PATIENT_SCORE_LAW], kept, report.expected_point, report.band,
           report.explained, report.stretch);
    assert_true(kept < cases[c / 2].quadratic_rms[exhaled]);
    assert_true(kept < held[SUPINE_PATIENT_SCORE_LAW] && kept < held[SUPINE_PATIENT_SCORE_AFFINE]);
    assert_true(kept > report.fitted[SUPINE_PATIENT_SCORE_CORRECTED]);
    assert_true(report.band > 87.0 && report.band < 99.0);
    /* The error stated in the first scan is that found on held-out blocks, where tissue is longer,
     * or shorter if the first scan is the exhaled one, by `stretch`. */
    assert_true(exhaled ? report.stretch < 1.0 : report.stretch > 1.03 && report.stretch < 1.35);
    assert_true(fabs(report.expected_point / (report.stretch * kept) - 1.0) < 0.1);
    /* The fit from the exhaled scan finds the error that the fit from the inhaled scan stated. */
    assert_true(!exhaled || fabs(stated / kept - 1.0) < 0.1);
    stated = report.expected_point;
    mean[exhaled] += kept / 5.0;
    band += report.band / 10.0;
    supine_patient_pairs_free(&pairs);
  }
  printf("mean error: %.2f and %.2f mm, %.1f %% within the band\n", mean[0], mean[1], band);
  assert_true(mean[0] <= 5.25 && mean[1] <= 5.95);
  assert_true(band > 92.0 && band < 98.0);
}

TEST(test_validation_points_states_expected_error_and_share_in_band) {
  enum { N = 4 };
  double from[3 * N] = {0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 60.0, 0.0, 0.0, 0.0, 70.0};
  double to[3 * N];
  double predicted[3 * N];
  const double squares[N] = {1.0, 2.25, 1.0, 4.0}; /* expected errors 1, 1.5, 1 and 2 mm */
  supine_patient_pairs pairs = {N, from, to, NULL};
  supine_validation_distance distance[SUPINE_PATIENT_MAP_COUNT];
  for (size_t i = 0; i < 3 * N; ++i) {
    to[i] = from[i] + 5.0;
    predicted[i] = to[i] + (i % 3 == 0 ? 1.0 + (double)(i / 3) : 0.0); /* 1, 2, 3 and 4 mm off */
  }
  assert_int_equal(
      supine_validation_points(&pairs, predicted, squares, SUPINE_PATIENT_STILL, distance, NULL),
      SUPINE_OK);
  const supine_validation_distance *of = &distance[SUPINE_PATIENT_MAP_PREDICTED];
  assert_true(fabs(of->rms - sqrt(7.5)) < 1e-12);
  assert_true(fabs(of->expected - sqrt(8.25 / 4.0)) < 1e-12);
  /* 1 < 1.8 x 1 and 2 < 1.8 x 1.5, but 3 > 1.8 x 1 and 4 > 1.8 x 2. */
  assert_true(fabs(of->within - 0.5) < 1e-12);
  assert_true(distance[SUPINE_PATIENT_MAP_AFFINE].expected == 0.0);
}

/* The error at the fitted points, after correction by kriging, equals the reported error. */
TEST(test_correct_fitted_points_leave_reported_residual) {
  supine_patient_pairs pairs = scatter(150, 8);
  supine_patient truth = known(&pairs);
  supine_patient found;
  supine_patient_fit_report report;
  double square = 0.0;
  move(&pairs, &truth, 0.4, 5);
  /* Add a motion that the displacement law cannot describe. */
  for (size_t i = 0; i < pairs.count; ++i) {
    pairs.to[3 * i] += 6.0 * sin(pairs.from[3 * i + 2] / 30.0);
  }
  fit_pairs(&pairs, SUPINE_PATIENT_DEEP, SUPINE_PATIENT_RIGID, &found, &report);
  for (size_t i = 0; i < pairs.count; ++i) {
    double u[3];
    double motion[3];
    displace(&found, pairs.from + 3 * i, u);
    const supine_patient_place place = supine_patient_find(&found.frame, pairs.from + 3 * i, 0.0);
    supine_patient_motion(&found.power, &place, motion);
    for (size_t k = 0; k < 3; ++k) {
      const double residual = pairs.from[3 * i + k] + u[k] + motion[k] - pairs.to[3 * i + k];
      square += residual * residual / (double)pairs.count;
    }
  }
  assert_true(found.centre_count == pairs.count);
  assert_true(fabs(sqrt(square) - report.fitted[SUPINE_PATIENT_SCORE_CORRECTED]) < 1e-6);
  assert_true(report.fitted[SUPINE_PATIENT_SCORE_CORRECTED] <
              0.5 * report.fitted[SUPINE_PATIENT_SCORE_LAW]);
  supine_patient_pairs_free(&pairs);
}

/* A point beyond the midline moves with the lung to which it is assigned. */
TEST(test_find_side_given_overrides_midline) {
  supine_patient_pairs pairs = scatter(30, 2);
  const supine_patient patient = known(&pairs);
  const double point[3] = {patient.frame.midline - 3.0, -70.0, -50.0};
  assert_true(supine_patient_find(&patient.frame, point, 0).side == -1);
  const supine_patient_place place = supine_patient_find(&patient.frame, point, 1.0);
  assert_true(place.side == 1 && place.box[0] < 0.0);
  double u[3];
  supine_patient_displacement(&patient, &place, 1.0, u);
  /* At or beyond the midline (box[0] <= 0), the displacement formula gives no x component. */
  assert_true(u[0] == 0.0);
  supine_patient_pairs_free(&pairs);
}

/* A point of the right lung beyond the middle of the points' box belongs to the right lung. */
TEST(test_frame_of_points_lung_beyond_middle_keeps_side) {
  double points[3 * 40] = {0.0};
  for (size_t i = 0; i < 20; ++i) {
    points[3 * i] = -110.0 + 113.0 * (double)i / 19.0; /* right lung: -110 to 3 mm */
    points[60 + 3 * i] = 25.0 + 79.0 * (double)i / 19.0;
  }
  const supine_patient_frame frame = supine_patient_frame_of_points(40, points, NULL);
  for (size_t i = 0; i < 40; ++i) {
    assert_true(supine_patient_find(&frame, points + 3 * i, 0).side == (i < 20 ? -1 : 1));
  }
  const double given = -3.0;
  assert_true(supine_patient_frame_of_points(40, points, &given).midline == -3.0);
}

/* Points of the emptier state are mapped back to the fuller state. */
TEST(test_points_to_fuller_moved_points_mapped_back) {
  supine_patient_pairs pairs = scatter(60, 12);
  supine_patient truth = known(&pairs);
  for (size_t k = 0; k < 3; ++k) {
    truth.power.c[2 * k] = -truth.power.c[2 * k];
  }
  truth.power.motion[1] = 12.0;
  move(&pairs, &truth, 0.0, 1);
  for (size_t i = 0; i < 3 * pairs.count; ++i) {
    pairs.to[i] += truth.power.motion[i % 3];
  }
  supine_patient_points_to_fuller(&truth, pairs.count, pairs.to);
  for (size_t i = 0; i < 3 * pairs.count; ++i) {
    assert_true(fabs(pairs.to[i] - pairs.from[i]) < 1e-3);
  }
  supine_patient_pairs_free(&pairs);
}

TEST(test_fit_noisy_landmarks_recover_constants) {
  supine_patient_pairs pairs = scatter(300, 4241);
  const supine_patient truth = known(&pairs);
  supine_patient found;
  supine_patient_fit_report report;
  const double *expected = truth.power.c;
  const double *c = found.power.c;
  move(&pairs, &truth, 0.5, 917);
  fit_pairs(&pairs, SUPINE_PATIENT_PAPER, SUPINE_PATIENT_STILL, &found, &report);
  for (size_t k = 0; k < SUPINE_PATIENT_CONSTANTS; ++k) {
    printf("c%zu: true value %8.4f, found %8.4f +- %.4f\n", k + 1, expected[k], c[k],
           report.error[k]);
    assert_true(fabs(c[k] - expected[k]) <= 3.0 * report.error[k]);
    assert_true(report.error[k] < 0.2 * (1.0 + fabs(expected[k])));
  }
  double worst = 0.0;
  for (size_t i = 0; i < pairs.count; ++i) {
    double u[3];
    double v[3];
    displace(&truth, pairs.from + 3 * i, u);
    displace(&found, pairs.from + 3 * i, v);
    worst = fmax(worst, hypot(hypot(u[0] - v[0], u[1] - v[1]), u[2] - v[2]));
  }
  assert_true(worst < 0.5);
  supine_patient_pairs_free(&pairs);
}

/* Each entry of a row of the design matrix is the derivative of a displacement with respect to one
 * constant of the displacement law. It equals a difference quotient. */
TEST(test_power_design_each_unknown_matches_difference_quotient) {
  supine_patient_pairs pairs = scatter(20, 3);
  const supine_patient truth = known(&pairs);
  supine_patient_row rows[60];
  static const double step = 1e-6;
  move(&pairs, &truth, 0.5, 1);
  supine_patient_rows_of_pairs(&truth.frame, &pairs, rows);
  for (size_t i = 0; i < 60; ++i) {
    double x[SUPINE_PATIENT_TERMS];
    supine_patient_power law = truth.power;
    static const double motion[6] = {1.5, -2.5, 3.5, 0.1, 0.2, -0.3};
    law.c[2] = -law.c[2];
    memcpy(law.motion, motion, sizeof motion);
    const double residual = supine_patient_power_design(&law, &rows[i], x);
    for (size_t t = 0; t < SUPINE_PATIENT_TERMS; ++t) {
      supine_patient_power other = law;
      for (size_t a = 0; a < 3; ++a) {
        other.c[2 * a] += t == a ? step : t == 15 ? step * law.c[2 * a] : 0.0;
        other.c[2 * a + 1] *= t == 3 + a ? exp(step) : 1.0;
        other.c[6 + a] += t == 6 + a ? step : 0.0;
        other.motion[a] += t == 9 + a ? step : 0.0;
        other.motion[3 + a] += t == 12 + a ? step : 0.0;
      }
      double unused[SUPINE_PATIENT_TERMS];
      const double difference =
          (supine_patient_power_design(&other, &rows[i], unused) - residual) / step;
      assert_true(fabs(x[t] - difference) < 1e-4 * (1.0 + fabs(difference)));
    }
  }
  supine_patient_pairs_free(&pairs);
}

TEST(test_fit_more_points_than_kept_refused) {
  supine_patient_pairs pairs = scatter(SUPINE_PATIENT_CENTRES_MAX + 1, 6);
  const supine_patient truth = known(&pairs);
  supine_patient found = {.frame = truth.frame};
  supine_patient_fit_report report;
  const supine_patient_fit_options options = {0};
  supine_error error;
  supine_patient_row *rows = malloc(3 * pairs.count * sizeof *rows);
  assert_non_null(rows);
  move(&pairs, &truth, 0.2, 8);
  supine_patient_rows_of_pairs(&truth.frame, &pairs, rows);
  assert_int_equal(supine_patient_fit(&options, rows, 0, pairs.count, &found, &report, &error),
                   SUPINE_ERROR_FORMAT);
  assert_says(error.message, "901 points to fit, more than 900");
  free(rows);
  supine_patient_pairs_free(&pairs);
}

/* Pairs that are thinned stay in order, and lie farther apart than pairs taken at random. */
TEST(test_pairs_thin_many_spread_evenly) {
  enum { MANY = 2000, FEW = 60 };
  uint64_t seed = 5;
  supine_patient_pairs pairs = {.count = MANY,
                                .from = malloc(3 * MANY * sizeof(double)),
                                .to = malloc(3 * MANY * sizeof(double))};
  for (size_t i = 0; i < 3 * MANY; ++i) { /* dense near 0 */
    pairs.from[i] = pow(random_signed(&seed), 3.0) * 100.0;
    pairs.to[i] = pairs.from[i] + (double)(i / 3);
  }
  assert_int_equal(supine_patient_pairs_thin(&pairs, MANY, NULL), SUPINE_OK);
  assert_int_equal(pairs.count, MANY);
  assert_int_equal(supine_patient_pairs_thin(&pairs, FEW, NULL), SUPINE_OK);
  assert_int_equal(pairs.count, FEW);
  double nearest = INFINITY;
  for (size_t i = 0; i < FEW; ++i) {
    assert_true(i == 0 || pairs.to[3 * i] - pairs.from[3 * i] >
                              pairs.to[3 * i - 3] - pairs.from[3 * i - 3] + 0.5);
    for (size_t j = 0; j < i; ++j) {
      nearest = fmin(nearest, supine_distance(pairs.from + 3 * i, pairs.from + 3 * j));
    }
  }
  assert_true(nearest > 30.0); /* of 60 pairs at random, the nearest are about 1 mm apart */
  supine_patient_pairs_free(&pairs);
}

TEST(test_fit_shifted_scan_separates_shift_from_law) {
  supine_patient_pairs pairs = scatter(250, 5);
  const supine_patient truth = known(&pairs);
  supine_patient found;
  supine_patient_fit_report report;
  move(&pairs, &truth, 0.2, 8);
  static const double shift[3] = {31.7, -12.3, 88.1};
  for (size_t i = 0; i < 3 * pairs.count; ++i) {
    pairs.to[i] += shift[i % 3];
  }
  fit_pairs(&pairs, SUPINE_PATIENT_PAPER, SUPINE_PATIENT_TRANSLATION, &found, &report);
  for (size_t k = 0; k < 3; ++k) {
    assert_true(fabs(found.power.motion[k] - shift[k]) < 0.5);
  }
  supine_patient_pairs_free(&pairs);
}

static supine_status load_text(const char *text, bool reverse, supine_patient_pairs *pairs,
                               supine_error *error) {
  char path[] = "/tmp/supine-pairs-XXXXXX";
  const int file = mkstemp(path);
  assert_true(file >= 0);
  assert_int_equal(write(file, text, strlen(text)), (ssize_t)strlen(text));
  assert_int_equal(close(file), 0);
  const supine_status status = supine_patient_pairs_load(path, reverse, pairs, error);
  (void)unlink(path);
  return status;
}

/* An affine map needs points whose RMS distance from a plane is 1 mm at least. */
TEST(test_map_fit_nearly_flat_points_limit_is_one_millimetre) {
  enum { N = 16 };
  for (int below = 0; below < 2; ++below) {
    double from[3 * N];
    supine_patient_affinity map;
    for (int i = 0; i < N; ++i) { /* uncorrelated coordinates, so that the RMS in z is exact */
      from[3 * i] = i & 1 ? 64.0 : -64.0;
      from[3 * i + 1] = i & 2 ? 32.0 : -32.0;
      from[3 * i + 2] = (i & 4 ? 1.0 : -1.0) * (below == 0 ? 1.0 : 1.0 - 1e-9);
    }
    assert_int_equal(supine_patient_map_fit(SUPINE_PATIENT_MAP_AFFINE, N, from, from, &map),
                     below == 0);
  }
}

TEST(test_pairs_load_bad_files_message_names_fault) {
  static const struct {
    const char *text, *words;
  } bad[] = {{"im1_x,im1_y,im1_z,im2_x,im2_y\n1,2,3,4,5\n", "no column \"im2_z\""}, {"", "empty"}};
  supine_patient_pairs pairs = {0};
  supine_error error;
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    assert_int_equal(load_text(bad[i].text, false, &pairs, &error), SUPINE_ERROR_FORMAT);
    assert_says(error.message, bad[i].words);
    assert_null(pairs.from);
  }
  assert_int_equal(supine_patient_pairs_load("/no/such.csv", false, &pairs, &error),
                   SUPINE_ERROR_READ);
}

TEST(test_pairs_load_image_columns_start_at_second_image) {
  static const char images[] = "im1_x,im1_y,im1_z,im2_x,im2_y,im2_z\n1,2,3,4,5,6\n";
  static const char plain[] = "x,y,z,to_x,to_y,to_z\n1,2,3,4,5,6\n";
  supine_patient_pairs pairs = {0};
  supine_error error;
  for (int reverse = 0; reverse < 2; ++reverse) {
    /* im1: landmarks in the inhaled image; im2: the same at rest. Pairs go from im2 to im1. */
    for (int file = 0; file < 2; ++file) {
      assert_int_equal(load_text(file == 0 ? plain : images, reverse == 1, &pairs, &error),
                       SUPINE_OK);
      assert_int_equal((int)pairs.count, 1);
      assert_true(pairs.from[0] == (reverse == file ? 1.0 : 4.0));
      assert_true(pairs.to[2] == (reverse == file ? 6.0 : 3.0));
      supine_patient_pairs_free(&pairs);
    }
  }
}

TEST(test_record_written_then_read_same) {
  static const char path[] = "test_patient_record.json";
  supine_patient_pairs pairs = scatter(30, 2);
  supine_patient patient = known(&pairs);
  patient.power.motion[1] = 1.0 / 7.0;
  patient.centre_count = 2;
  patient.centre[0] =
      (supine_patient_centre){{1.0 / 3.0, -2.0, 5.0}, 1, 12.5, {0.1, -1.0 / 9.0, 0.3}};
  patient.centre[1] = (supine_patient_centre){{-70.0, -20.0, 15.0}, -1, 7.5, {-0.2, 0.0, 1e-5}};
  supine_patient_record before = record_of(&patient);
  before.measured_lung[0][0] = 2410.5;
  before.measured_lung[0][1] = 2911.0;
  before.stiffness =
      (supine_patient_stiffness){.count = 2,
                                 .region = {{1, 1.0 / 3.0, {1.0, -2.0, 0.1}, 61.7, 0.0},
                                            {-1, 0.2, {7.0, 8.0, 9.0}, 40.0, 1.0}}};
  static supine_patient_record after;
  supine_error error;
  assert_int_equal(supine_patient_write(path, &before, "test", &error), SUPINE_OK);
  assert_int_equal(supine_patient_read(path, &after, &error), SUPINE_OK);
  assert_int_equal(after.patient.law, before.patient.law);
  assert_memory_equal(&before.patient.frame, &after.patient.frame, 7 * sizeof(double));
  assert_memory_equal(&before.patient.power, &after.patient.power, sizeof before.patient.power);
  assert_int_equal(after.patient.centre_count, 2);
  for (size_t k = 0; k < 2; ++k) {
    const supine_patient_centre *a = &before.patient.centre[k];
    const supine_patient_centre *b = &after.patient.centre[k];
    assert_true(a->side == b->side && a->size == b->size);
    assert_memory_equal(a->offset, b->offset, sizeof a->offset);
    assert_memory_equal(a->weight, b->weight, sizeof a->weight);
  }
  assert_memory_equal(&before.force, &after.force, offsetof(supine_force_law, soften));
  assert_int_equal(after.stiffness.count, 2);
  for (size_t k = 0; k < 2; ++k) {
    const supine_patient_region *a = &before.stiffness.region[k];
    const supine_patient_region *b = &after.stiffness.region[k];
    assert_true(a->side == b->side && a->expandability == b->expandability);
    assert_true(a->radius == b->radius && a->determined == b->determined);
    assert_memory_equal(a->centre, b->centre, sizeof a->centre);
  }
  assert_memory_equal(before.state, after.state, sizeof before.state);
  assert_memory_equal(before.volume, after.volume, sizeof before.volume);
  assert_memory_equal(before.measured_lung, after.measured_lung, sizeof before.measured_lung);
  assert_memory_equal(before.emptier, after.emptier, sizeof before.emptier);
  assert_memory_equal(before.report.held_out, after.report.held_out, sizeof before.report.held_out);
  assert_memory_equal(before.report.error, after.report.error, sizeof before.report.error);
  assert_true(after.report.baseline == 10.5 && after.report.points == 300);
  assert_true(after.expand.fitted[0] == 0.75 && after.applied.blocks == 0);
  /* A file that lacks one of these keys is refused. */
  static const char *const parts[] = {"frame",      "law",     "force",         "fuller",
                                      "emptier",    "motion",  "format",        "centres",
                                      "correction", "version", "emptier_frame", "c1_to_c9"};
  char *text = supine_patient_text(&before, "test");
  assert_non_null(text);
  for (size_t i = 0; i < sizeof parts / sizeof *parts; ++i) {
    char key[32];
    char *spoiled = strdup(text);
    (void)snprintf(key, sizeof key, "\"%s\"", parts[i]);
    char *at = strstr(spoiled, key);
    assert_non_null(at);
    at[1] = '#';
    test_write(path, spoiled);
    assert_int_equal(supine_patient_read(path, &after, &error), SUPINE_ERROR_FORMAT);
    free(spoiled);
  }
  test_write(path, "{\"format\"");
  assert_int_equal(supine_patient_read(path, &after, &error), SUPINE_ERROR_FORMAT);
  assert_int_equal(supine_patient_read("/no/such.json", &after, &error), SUPINE_ERROR_READ);
  (void)remove(path);
  free(text);
  supine_patient_pairs_free(&pairs);
}

/* Replace the first `old` in `text`, and read the result as a file. Return its status. */
static supine_status decode_changed(const char *text, const char *old, const char *new,
                                    supine_error *error) {
  static supine_patient_record record;
  const char *at = strstr(text, old);
  assert_non_null(at);
  const size_t size = strlen(text) + strlen(new) + 1;
  char *changed = malloc(size);
  (void)snprintf(changed, size, "%.*s%s%s", (int)(at - text), text, new, at + strlen(old));
  const supine_status status = supine_patient_decode("a.json", changed, &record, error);
  free(changed);
  return status;
}

/* Counts are integers, sides and states are words, flags are booleans. Other values are refused by
 * their key. */
TEST(test_decode_value_of_wrong_type_names_key) {
  static const struct {
    const char *old, *new, *key;
  } wrong[] = {
      {"\"points\": 300", "\"points\": 300.5", "\"points\""},
      {"\"points\": 300", "\"points\": -1", "\"points\""},
      {"\"scan\": \"emptier\"", "\"scan\": \"empty\"", "\"basis.scan\""},
      {"\"scan\": \"emptier\"", "\"scan\": 1", "\"basis.scan\""},
      {"\"kept\": true", "\"kept\": 1", "\"expandability.kept\""},
      {"\"unseen_regions\": 1", "\"unseen_regions\": 1.0", "\"expandability.unseen_regions\""},
      {"\"lung\": \"left\"", "\"lung\": \"both\"", "\"centres.lung\""},
      {"\"lung\": \"right\"", "\"lung\": -1.0", "\"regions.lung\""},
      {"\"radius_mm\": 40", "\"radius_mm\": -40", "\"regions.radius_mm\""},
      {"\"displacement_mm\": 12.5", "\"displacement\": 12.5", "\"centres.displacement_mm\""},
      {"\"lungs\": \"both\"", "\"lungs\": \"left lung\"", "\"frame.lungs\""},
      {"\"state\": \"supine:full\"", "\"state\": \"full of air\"", "\"fuller.state\""}};
  supine_patient_pairs pairs = scatter(30, 2);
  supine_patient patient = known(&pairs);
  patient.centre_count = 1;
  patient.centre[0] = (supine_patient_centre){{1.0, -2.0, 5.0}, 1, 12.5, {0.1, 0.2, 0.3}};
  supine_patient_record record = record_of(&patient);
  record.in_basis = true;
  record.shown = 1;
  record.expand.kept = true;
  record.expand.undetermined = 1;
  record.stiffness = (supine_patient_stiffness){
      .count = 1, .region = {{-1, 1.0 / 3.0, {1.0, -2.0, 0.1}, 40.0, 0.0}}};
  char *text = supine_patient_text(&record, NULL);
  supine_error error;
  assert_int_equal(decode_changed(text, "\"points\": 300", "\"points\": 301", &error), SUPINE_OK);
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
    assert_int_equal(decode_changed(text, wrong[i].old, wrong[i].new, &error), SUPINE_ERROR_FORMAT);
    assert_says(error.message, wrong[i].key);
  }
  assert_int_equal(decode_changed(text, "\"version\": 5", "\"version\": 4", &error),
                   SUPINE_ERROR_FORMAT);
  assert_says(error.message, "version 4");
  assert_int_equal(decode_changed(text, "supine-patient", "supine-basis", &error),
                   SUPINE_ERROR_FORMAT);
  assert_says(error.message, "not a patient file");
  free(text);
  supine_patient_pairs_free(&pairs);
}

/* The volumes of the two fitted states determine the volume at rest. If a scan is in one of these
 * states, --scanned may be omitted. */
TEST(test_scan_fitted_states_known_without_option) {
  supine_patient_pairs pairs = scatter(30, 2);
  const supine_patient patient = known(&pairs);
  supine_patient_record record = record_of(&patient);
  supine_resting resting = supine_physics_resting_default();
  static const double supine[3] = {0.0, 1.0, 0.0};
  supine_patient_resting(&record, &resting);
  assert_true(fabs(supine_physics_resting_total(&resting, supine) - 2410.25 / 5321.5) < 1e-12);
  supine_scan scan = supine_patient_scan(&record, 0, 5321.5, &resting);
  assert_true(scan.known && scan.state.volume.kind == SUPINE_VOLUME_FULL);
  scan = supine_patient_scan(&record, 1, 2410.25, &resting);
  assert_true(scan.known && scan.state.volume.kind == SUPINE_VOLUME_REST);
  double gains[2][3];
  supine_patient_path(&record, gains);
  /* Gains, the factors on the displacement, are 0 at full inflation and 1 at rest. */
  for (size_t k = 0; k < 3; ++k) {
    assert_true(gains[0][k] == 0.0 && fabs(gains[1][k] - 1.0) < 1e-12);
  }
  /* If the fuller state is rest + 500 mL, full inflation follows from the default ratio of the
   * volume at rest to that at full inflation. */
  record.state[0].volume = (supine_volume){SUPINE_VOLUME_REST, 500.0};
  record.volume[0] = 2910.25;
  resting = supine_physics_resting_default();
  const double full = 2410.25 / supine_physics_resting_total(&resting, supine);
  scan = supine_patient_scan(&record, 0, 2910.25, &resting);
  assert_true(scan.known && scan.state.volume.kind == SUPINE_VOLUME_REST);
  assert_true(scan.state.volume.ml == 500.0);
  supine_patient_path(&record, gains);
  const double sigma = (cbrt(full) - cbrt(2910.25)) / (cbrt(full) - cbrt(2410.25));
  const supine_model deep = supine_physics_model(SUPINE_LAW_DEEP);
  double expected[3];
  supine_volume_bend(deep.bend, sigma, expected);
  for (size_t k = 0; k < 3; ++k) {
    assert_true(fabs(gains[0][k] - expected[k]) < 1e-9 && fabs(gains[1][k] - 1.0) < 1e-12);
  }
  /* From two absolute volumes, the volume at rest cannot be computed. */
  record.state[0].volume = (supine_volume){SUPINE_VOLUME_ABSOLUTE, 2910.25};
  record.state[1].volume = (supine_volume){SUPINE_VOLUME_ABSOLUTE, 2410.25};
  assert_false(supine_patient_scan(&record, 1, 2410.25, &resting).known);
  supine_patient_pairs_free(&pairs);
}

TEST(test_force_in_fitted_posture_linear_in_box) {
  supine_patient_pairs pairs = scatter(30, 2);
  const supine_patient patient = known(&pairs);
  static const double postures[4][3] = {{0, 1, 0}, {0, -1, 0}, {0, 0, -1}, {0, 0, 1}};
  for (size_t p = 0; p < 4; ++p) {
    const double *g = postures[p];
    const supine_force_law law = supine_patient_force(&patient.power, 0.37, g);
    for (int corner = 0; corner < 8; ++corner) {
      const double box[3] = {corner & 1, corner >> 1 & 1, corner >> 2};
      const double height = g[1] > 0.0   ? 1.0 - box[1]
                            : g[1] < 0.0 ? box[1]
                            : g[2] < 0.0 ? box[2]
                                         : 1.0 - box[2];
      const double force = law.base + law.gain * height + law.box[0] * box[0] +
                           law.box[1] * box[1] + law.box[2] * box[2];
      const double *c = patient.power.c + 6;
      const double expected =
          1.0 + c[0] * (box[0] - 0.5) + c[1] * (box[1] - 0.5) + c[2] * (box[2] - 0.5);
      assert_true(fabs(force - expected) < 1e-14);
    }
  }
  /* The force of the default law (`deep`) in the supine posture is 0.875 + 0.4 h - 0.15 Y. h is the
   * height, and Y the y coordinate, both 0 to 1 in the lungs' bounding box. */
  const supine_patient_power shape = supine_patient_deep(postures[0], (const double[3]){0});
  const supine_force_law deep = supine_patient_force(&shape, 0.4, postures[0]);
  assert_true(fabs(deep.base - 0.875) < 1e-14 && fabs(deep.box[1] + 0.15) < 1e-14);
  supine_patient_pairs_free(&pairs);
}

/* Fit a third scan, prone or upright. It determines a factor on the displacement of each lung. It
 * also determines the gain, the coefficient of height in the force, within three standard errors. A
 * third scan in the posture of the other two does not determine the gain. */
TEST(test_gain_fit_third_scan_recovers_gain) {
  static const double postures[2][3] = {{0.0, -1.0, 0.0}, {0.0, 0.0, -1.0}};
  static const double gains[2] = {0.23, 0.71};
  supine_patient_pairs pairs = scatter(200, 55);
  const supine_patient patient = known(&pairs);
  supine_patient_record record = record_of(&patient);
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  supine_patient_further *other = record.further;
  supine_error error;
  record.further_count = 1;
  gsl_rng_set(random, 19);
  for (size_t c = 0; c < 4; ++c) {
    const double *g = postures[c % 2];
    const double gain = gains[c / 2];
    const bool moved = c % 2 == 1;
    const double scale[2] = {0.8, 0.63}; /* factors on the displacement: left, right lung */
    const supine_force_law law =
        supine_patient_force(&patient.power, gain, record.state[1].gravity);
    for (size_t i = 0; i < pairs.count; ++i) {
      double u[3];
      const supine_patient_place at = supine_patient_find(&patient.frame, pairs.from + 3 * i, 0.0);
      const double *b = at.box;
      const double fixed = law.base + law.box[0] * b[0] + law.box[1] * b[1] + law.box[2] * b[2];
      const double supine_force = fixed + gain * (1.0 - b[1]);
      const double other_force = fixed + gain * (c % 2 == 0 ? b[1] : b[2]);
      displace(&patient, pairs.from + 3 * i, u);
      for (size_t k = 0; k < 3; ++k) {
        pairs.to[3 * i + k] = pairs.from[3 * i + k] +
                              scale[at.side > 0.0 ? 0 : 1] * other_force / supine_force * u[k] +
                              (moved ? 20.0 : 0.0) + gsl_ran_gaussian(random, 0.3);
      }
    }
    memcpy(other->state.gravity, g, sizeof other->state.gravity);
    assert_int_equal(supine_patient_gain_fit_landmarks(&record, &pairs, moved, other, &error),
                     SUPINE_OK);
    supine_patient_gain_set(&record);
    printf("gain: true value %.2f, found %.3f +- %.3f; scales %.3f %.3f, residual %.2f mm, %.2f mm "
           "without the gain\n",
           gain, record.force.gain, record.gain_error, other->scale[0], other->scale[1],
           other->residual, other->residual_without_gain);
    assert_false(record.gain_undetermined);
    assert_true(fabs(record.force.gain - gain) <= 3.0 * record.gain_error);
    assert_true(record.gain_error < 0.1);
    assert_true(fabs(other->scale[0] - scale[0]) < 0.03);
    assert_true(fabs(other->scale[1] - scale[1]) < 0.03);
    assert_true(other->residual < 0.3 * sqrt(3.0) * 1.1 &&
                other->residual < other->residual_without_gain);
  }
  gsl_rng_free(random);
  const double kept = record.force.gain;
  memcpy(other->state.gravity, record.state[1].gravity, sizeof other->state.gravity);
  assert_int_equal(supine_patient_gain_fit_landmarks(&record, &pairs, false, other, &error),
                   SUPINE_OK);
  assert_false(other->fits_gain);
  supine_patient_gain_set(&record);
  assert_true(record.force.gain == kept);
  supine_patient_pairs_free(&pairs);
}

TEST(test_compare_points_each_map_explains_its_motions) {
  supine_patient_pairs pairs = scatter(80, 21);
  supine_validation_distance distance[SUPINE_PATIENT_MAP_COUNT];
  supine_error error;
  static const double turned[3][3] = {/* a rotation by 10 degrees about z, times 1.1 */
                                      {1.08329, -0.19101, 0.0},
                                      {0.19101, 1.08329, 0.0},
                                      {0.0, 0.0, 1.1}};
  for (size_t i = 0; i < pairs.count; ++i) {
    for (size_t a = 0; a < 3; ++a) {
      pairs.to[3 * i + a] = 3.0 + (double)a;
      for (size_t b = 0; b < 3; ++b) {
        pairs.to[3 * i + a] += turned[a][b] * pairs.from[3 * i + b];
      }
    }
  }
  assert_int_equal(
      supine_validation_points(&pairs, pairs.to, NULL, SUPINE_PATIENT_STILL, distance, &error),
      SUPINE_OK);
  const double none = distance[SUPINE_PATIENT_MAP_NONE].rms;
  assert_true(none > 10.0);
  assert_true(distance[SUPINE_PATIENT_MAP_PREDICTED].largest == 0.0);
  assert_true(distance[SUPINE_PATIENT_MAP_PREDICTED].explained == 1.0);
  assert_true(distance[SUPINE_PATIENT_MAP_TRANSLATION].rms > 0.3 * none);
  assert_true(distance[SUPINE_PATIENT_MAP_AFFINE].largest < 1e-9 * none);
  for (size_t i = 0; i < pairs.count; ++i) {
    pairs.to[3 * i] += 0.2 * pairs.from[3 * i + 1]; /* a shear */
  }
  assert_int_equal(
      supine_validation_points(&pairs, pairs.from, NULL, SUPINE_PATIENT_STILL, distance, &error),
      SUPINE_OK);
  assert_true(distance[SUPINE_PATIENT_MAP_AFFINE].largest < 1e-9 * none);
  /* If the predicted displacement is 0, the error equals that without a prediction. */
  assert_true(distance[SUPINE_PATIENT_MAP_PREDICTED].rms == distance[SUPINE_PATIENT_MAP_NONE].rms);
  assert_true(distance[SUPINE_PATIENT_MAP_PREDICTED].explained == 0.0);
  /* SUPINE_PATIENT_RIGID removes a rotation and a shift between the scans;
   * SUPINE_PATIENT_TRANSLATION leaves the rotation. */
  double *turned_by = malloc(3 * pairs.count * sizeof *turned_by);
  for (size_t i = 0; i < pairs.count; ++i) { /* a rotation by 90 degrees about z, and a shift */
    turned_by[3 * i] = -pairs.to[3 * i + 1] + 40.0;
    turned_by[3 * i + 1] = pairs.to[3 * i];
    turned_by[3 * i + 2] = pairs.to[3 * i + 2] - 7.0;
  }
  assert_int_equal(
      supine_validation_points(&pairs, turned_by, NULL, SUPINE_PATIENT_RIGID, distance, &error),
      SUPINE_OK);
  assert_true(distance[SUPINE_PATIENT_MAP_PREDICTED].largest < 1e-9);
  assert_int_equal(supine_validation_points(&pairs, turned_by, NULL, SUPINE_PATIENT_TRANSLATION,
                                            distance, &error),
                   SUPINE_OK);
  assert_true(distance[SUPINE_PATIENT_MAP_PREDICTED].rms > 10.0);
  assert_true(distance[SUPINE_PATIENT_MAP_TRANSLATION].explained == 0.0);
  /* Without motion, the explained fraction of the motion is undefined. */
  memcpy(pairs.to, pairs.from, 3 * pairs.count * sizeof *pairs.to);
  assert_int_equal(
      supine_validation_points(&pairs, turned_by, NULL, SUPINE_PATIENT_STILL, distance, &error),
      SUPINE_OK);
  assert_true(isnan(distance[SUPINE_PATIENT_MAP_PREDICTED].explained));
  free(turned_by);
  supine_patient_pairs_free(&pairs);
}

/* The distances of fitted maps are measured at 20,000 vertices of larger surfaces. Their mean is
 * near that of all vertices. */
TEST(test_compare_surfaces_sampled_vertices_keep_statistics) {
  supine_mesh start = {0};
  assert_int_equal(supine_lungs_phantom_create(30000, 3000.0, &start, NULL), SUPINE_OK);
  const size_t n = start.vertex_count;
  supine_mesh end = start;
  end.vertices = malloc(3 * n * sizeof(double));
  double *predicted = malloc(3 * n * sizeof *predicted);
  double *nearest = malloc(3 * n * sizeof *nearest);
  double mean = 0.0;
  for (size_t i = 0; i < 3 * n; ++i) {
    predicted[i] = end.vertices[i] = 1.1 * start.vertices[i] + 4.0 * (i % 3 == 1);
  }
  for (int way = 0; way < 2; ++way) {
    const supine_mesh *mesh = way == 0 ? &start : &end;
    supine_lungs_surface *tree;
    assert_int_equal(supine_lungs_surface_create(mesh->vertices, mesh->triangle_count,
                                                 mesh->triangles, false, &tree, NULL),
                     SUPINE_OK);
    double *distance = malloc(n * sizeof *distance);
    supine_lungs_surface_distances(tree, n, (way == 0 ? &end : &start)->vertices, distance, NULL);
    for (size_t i = 0; i < n; ++i) {
      mean += 0.5 * distance[i] / (double)n;
    }
    supine_lungs_surface_destroy(tree);
    free(distance);
  }
  supine_validation_distance of[SUPINE_PATIENT_MAP_COUNT];
  assert_int_equal(
      supine_validation_surfaces(&start, SUPINE_PATIENT_STILL, predicted, &end, nearest, of, NULL),
      SUPINE_OK);
  print_message("without motion: mean %.4f mm, of all vertices %.4f mm\n",
                of[SUPINE_PATIENT_MAP_NONE].mean, mean);
  assert_true(of[SUPINE_PATIENT_MAP_PREDICTED].largest < 1e-6);
  assert_true(fabs(of[SUPINE_PATIENT_MAP_NONE].mean - mean) < 0.01 * mean);
  assert_true(of[SUPINE_PATIENT_MAP_NONE].mean != mean);
  supine_mesh_free(&start);
  free(end.vertices);
  free(predicted);
  free(nearest);
}
