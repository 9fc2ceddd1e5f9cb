/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test fits to pressure-volume samples: published curves, noise, confidence intervals, refused
 * samples. */
#include "tests/helpers/test.h"

#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>

#include "program/options/pv.h"

enum { SAMPLES = 33, HELD_OUT = 211 };

/* A published curve, the volume at the pressure P:
 * - d > 0: Venegas' sigmoid a + b / (1 + exp(-(P - c) / d))
 * - d = 0: Salazar and Knowles' exponential b (1 - exp(-c P)) */
typedef struct truth {
  const char *name;
  double low, high; /* range of pressures, cmH2O */
  double a, b;      /* mL */
  double c, d;      /* cmH2O; if d = 0, c is in 1/cmH2O */
} truth;

/* Salazar-Knowles: c = ln 2 / h, with the pressure h at half inflation. The normal h is that of 20
 * subjects, 7.58 (SD 2.53) cmH2O [Salazar1964]. Emphysema (lost recoil) doubles or triples the
 * normal c, and fibrosis halves it. Venegas: b d is between 10^3.3 and 10^5 mL cmH2O, about the
 * range of published curves (Narusawa, J. Appl. Physiol. 91, 2001). */
static const truth truths[] = {
    {"Salazar-Knowles, normal mean", 0.0, 30.0, 0.0, 6413.0, 0.0914, 0.0},
    {"Salazar-Knowles, normal +1 SD", 0.0, 30.0, 0.0, 6413.0, 0.0686, 0.0},
    {"Salazar-Knowles, normal -1 SD", 0.0, 30.0, 0.0, 6413.0, 0.137, 0.0},
    {"Salazar-Knowles, normal +2 SD", 0.0, 30.0, 0.0, 6413.0, 0.0548, 0.0},
    {"Salazar-Knowles, emphysema", 0.0, 30.0, 0.0, 8100.0, 0.183, 0.0},
    {"Salazar-Knowles, severe emphysema", 0.0, 30.0, 0.0, 9300.0, 0.274, 0.0},
    {"Salazar-Knowles, fibrosis", 0.0, 40.0, 0.0, 3100.0, 0.0457, 0.0},
    {"Venegas, normal inhale", 0.0, 30.0, -1181.6, 7437.8, 10.0, 6.0},
    {"Venegas, normal exhale", -10.0, 35.0, 30.0, 3650.0, 6.3, 7.1},
    {"Venegas, emphysema", 0.0, 30.0, 400.0, 6800.0, 4.1, 3.9},
    {"Venegas, moderate ARDS", 0.0, 40.0, 55.0, 1900.0, 18.7, 5.9},
    {"Venegas, severe ARDS", 0.0, 45.0, 0.0, 1100.0, 24.3, 4.1},
    {"Venegas, severe ARDS, steep", 0.0, 45.0, 20.0, 800.0, 25.7, 2.6},
    {"Venegas, ARDS exhale", 0.0, 45.0, 20.0, 1100.0, 13.1, 5.3},
};
enum { TRUTHS = sizeof truths / sizeof *truths };

static double truth_volume(const truth *lung, double pressure) {
  return lung->d > 0.0 ? lung->a + lung->b / (1.0 + exp(-(pressure - lung->c) / lung->d))
                       : -lung->b * expm1(-lung->c * pressure);
}

/* Compute the true volumes at `count` unevenly spaced pressures. */
static void truth_sample(const truth *lung, size_t count, double *pressures, double *volumes) {
  for (size_t j = 0; j < count; ++j) {
    const double share = (double)j / (double)(count - 1);
    const double uneven = share + 0.02 * sin(2.0 * M_PI * share) * cos(9.0 * share);
    pressures[j] = lung->low + (lung->high - lung->low) * uneven;
    volumes[j] = truth_volume(lung, pressures[j]);
  }
}

static double truth_range(const truth *lung) {
  return truth_volume(lung, lung->high) - truth_volume(lung, lung->low);
}

/* Return the RMS error of a curve at held-out pressures, % of the range of volumes. */
static double held_out_percent(const truth *lung, const supine_pv_curve *curve) {
  double pressures[HELD_OUT];
  double volumes[HELD_OUT];
  for (size_t j = 0; j < HELD_OUT; ++j) {
    pressures[j] = curve->pressure[0] +
                   (curve->pressure[1] - curve->pressure[0]) * ((double)j + 0.37) / HELD_OUT;
  }
  assert_int_equal(supine_breath_curve_evaluate(curve, HELD_OUT, pressures, volumes, NULL, NULL),
                   SUPINE_OK);
  double sum = 0.0;
  for (size_t j = 0; j < HELD_OUT; ++j) {
    sum += pow(volumes[j] - truth_volume(lung, pressures[j]), 2);
  }
  return 100.0 * sqrt(sum / HELD_OUT) / truth_range(lung);
}

/* Fit samples as if they were lines 100, 101, ... of a file s.csv. */
static supine_status fit(size_t count, const double *pressures, const double *volumes,
                         double confidence, supine_pv_curve *curve, supine_pv_report *report,
                         supine_error *error) {
  supine_pv_sample samples[SAMPLES];
  supine_pv_report ignored;
  for (size_t j = 0; j < count; ++j) {
    samples[j] = (supine_pv_sample){pressures[j], volumes[j], 100 + j};
  }
  return supine_breath_fit("s.csv", count, samples, confidence, curve,
                           report != NULL ? report : &ignored, error);
}

TEST(test_fit_published_curves_error_below_one_percent) {
  for (size_t i = 0; i < TRUTHS; ++i) {
    double pressures[SAMPLES];
    double volumes[SAMPLES];
    truth_sample(&truths[i], SAMPLES, pressures, volumes);
    supine_pv_curve curve;
    supine_pv_report report;
    assert_int_equal(fit(SAMPLES, pressures, volumes, 0.95, &curve, &report, NULL), SUPINE_OK);
    const double held_out = held_out_percent(&truths[i], &curve);
    print_message("%-34s error %.4f %% RMS, held out %.4f %%\n", truths[i].name, report.rms_percent,
                  held_out);
    assert_true(report.rms_percent < 1.0);
    assert_true(held_out < 0.3);
    assert_close(report.rms, 0.01 * report.rms_percent * truth_range(&truths[i]),
                 1e-9 * report.rms + 1e-12);
    assert_true(curve.pressure[0] == truths[i].low && curve.pressure[1] == truths[i].high);
    /* If d = 0, the logarithm of the compliance has the constant slope -c. Of the control
     * parameters, only the first, the mean of this slope, is not 0. */
    if (truths[i].d == 0.0) {
      assert_close(curve.control[0], -0.5 * truths[i].c * truths[i].high, 1e-6);
      for (size_t c = 1; c < SUPINE_PV_CONTROLS; ++c) {
        assert_close(curve.control[c], 0.0, 1e-6);
      }
    }
  }
}

TEST(test_fit_one_percent_noise_error_below_one_percent) {
  enum { SEEDS = 20 };
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  assert_non_null(random);
  gsl_rng_set(random, 20080317);
  for (size_t i = 0; i < TRUTHS; ++i) {
    double worst = 0.0;
    for (int seed = 0; seed < SEEDS; ++seed) {
      double pressures[SAMPLES];
      double volumes[SAMPLES];
      truth_sample(&truths[i], SAMPLES, pressures, volumes);
      for (size_t j = 0; j < SAMPLES; ++j) {
        volumes[j] += gsl_ran_gaussian(random, 0.01 * truth_range(&truths[i]));
      }
      supine_pv_curve curve;
      supine_error error = {0};
      if (fit(SAMPLES, pressures, volumes, 0.95, &curve, NULL, &error) != SUPINE_OK) {
        fail_msg("%s", error.message);
      }
      worst = fmax(worst, held_out_percent(&truths[i], &curve));
    }
    print_message("%-34s 1 %% noise: largest of %d errors %.3f %%\n", truths[i].name, (int)SEEDS,
                  worst);
    assert_true(worst < 1.0);
  }
  gsl_rng_free(random);
}

static const supine_pv_curve model = {
    {-3.7, 36.1}, {310.0, 4170.0}, {-0.83, -3.9, 0.61, 0.74, -0.29}};

static void model_sample(size_t count, double *pressures, double *volumes) {
  for (size_t j = 0; j < count; ++j) {
    pressures[j] = model.pressure[0] +
                   (model.pressure[1] - model.pressure[0]) * (double)j / (double)(count - 1);
  }
  pressures[count - 1] = model.pressure[1];
  assert_int_equal(supine_breath_curve_evaluate(&model, count, pressures, volumes, NULL, NULL),
                   SUPINE_OK);
}

TEST(test_fit_data_of_model_recovers_parameters) {
  static const size_t counts[] = {8, 9, 13, 33};
  for (size_t n = 0; n < sizeof counts / sizeof *counts; ++n) {
    for (int reversed = 0; reversed <= 1; ++reversed) {
      double pressures[SAMPLES];
      double volumes[SAMPLES];
      model_sample(counts[n], pressures, volumes);
      for (size_t j = 0; reversed && j < counts[n] / 2; ++j) {
        const size_t k = counts[n] - 1 - j;
        const double p = pressures[j];
        const double v = volumes[j];
        pressures[j] = pressures[k];
        volumes[j] = volumes[k];
        pressures[k] = p;
        volumes[k] = v;
      }
      supine_pv_curve curve;
      supine_pv_report report;
      assert_int_equal(fit(counts[n], pressures, volumes, 0.95, &curve, &report, NULL), SUPINE_OK);
      assert_int_equal(report.samples, counts[n]);
      for (size_t c = 0; c < SUPINE_PV_CONTROLS; ++c) {
        assert_close(curve.control[c], model.control[c], 1e-6);
      }
      assert_close(curve.volume[0], model.volume[0], 1e-5);
      assert_close(curve.volume[1], model.volume[1], 1e-5);
    }
  }
}

/* If the rate is 0.95, 380 of 400 fits have an interval that contains the true parameter (binomial,
 * SD 4.4). A difference of five deviations is allowed. */
TEST(test_fit_intervals_cover_truth_at_nominal_rate) {
  enum { SEEDS = 400, COUNT = 21 };
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  assert_non_null(random);
  gsl_rng_set(random, 7919);
  double pressures[COUNT];
  double exact[COUNT];
  model_sample(COUNT, pressures, exact);
  static const double levels[] = {0.95, 0.8};
  int covered[2][SUPINE_PV_UNKNOWNS] = {{0}};
  for (int seed = 0; seed < SEEDS; ++seed) {
    double volumes[COUNT];
    for (size_t j = 0; j < COUNT; ++j) {
      volumes[j] = exact[j] + gsl_ran_gaussian(random, 0.005 * (exact[COUNT - 1] - exact[0]));
    }
    for (size_t level = 0; level < 2; ++level) {
      supine_pv_curve curve;
      supine_pv_report report;
      assert_int_equal(fit(COUNT, pressures, volumes, levels[level], &curve, &report, NULL),
                       SUPINE_OK);
      for (size_t i = 0; i < SUPINE_PV_CONTROLS; ++i) {
        covered[level][i] +=
            fabs(curve.control[i] - model.control[i]) <= report.control_interval[i];
      }
      for (size_t i = 0; i < 2; ++i) {
        covered[level][SUPINE_PV_CONTROLS + i] +=
            fabs(curve.volume[i] - model.volume[i]) <= report.volume_interval[i];
      }
    }
  }
  gsl_rng_free(random);
  for (size_t level = 0; level < 2; ++level) {
    const double deviation = sqrt(SEEDS * levels[level] * (1.0 - levels[level]));
    for (size_t i = 0; i < SUPINE_PV_UNKNOWNS; ++i) {
      print_message("unknown %zu: %.1f %% of the %.0f %% intervals contain the true value\n", i,
                    100.0 * covered[level][i] / SEEDS, 100.0 * levels[level]);
      assert_close(covered[level][i], SEEDS * levels[level], 5.0 * deviation);
    }
  }
}

/* The fit is a minimum: a small change of any parameter increases the residual. */
TEST(test_fit_result_at_minimum) {
  double pressures[SAMPLES];
  double volumes[SAMPLES];
  truth_sample(&truths[11], SAMPLES, pressures, volumes);
  supine_pv_curve curve;
  supine_pv_report report;
  assert_int_equal(fit(SAMPLES, pressures, volumes, 0.95, &curve, &report, NULL), SUPINE_OK);
  for (int move = 0; move < 2 * SUPINE_PV_UNKNOWNS; ++move) {
    supine_pv_curve moved = curve;
    const int i = move / 2;
    const double sign = move % 2 == 0 ? 1.0 : -1.0;
    if (i < SUPINE_PV_CONTROLS) {
      moved.control[i] += sign * 1e-2;
    } else {
      moved.volume[i - SUPINE_PV_CONTROLS] += sign * 0.5;
    }
    double fitted[SAMPLES];
    assert_int_equal(supine_breath_curve_evaluate(&moved, SAMPLES, pressures, fitted, NULL, NULL),
                     SUPINE_OK);
    double sum = 0.0;
    for (size_t j = 0; j < SAMPLES; ++j) {
      sum += pow(fitted[j] - volumes[j], 2);
    }
    assert_true(sqrt(sum / SAMPLES) > report.rms);
  }
}

static void expect_format(size_t count, const double *pressures, const double *volumes,
                          const char *text, const char *more) {
  supine_pv_curve curve;
  supine_error error = {0};
  assert_int_equal(fit(count, pressures, volumes, 0.95, &curve, NULL, &error), SUPINE_ERROR_FORMAT);
  assert_says(error.message, text);
  assert_says(error.message, more);
}

TEST(test_fit_bad_samples_message_names_line) {
  double p[SAMPLES];
  double v[SAMPLES];
  model_sample(SAMPLES, p, v);
  expect_format(0, p, v, "0 samples", "at least 8");
  expect_format(7, p, v, "7 samples", "at least 8");
  for (size_t count = 8; count <= SAMPLES; count += 25) { /* 8 and 33 samples */
    model_sample(count, p, v);
    p[5] = p[4];
    expect_format(count, p, v, "s.csv:105", "repeats the one before");
    model_sample(count, p, v);
    p[5] = p[3];
    expect_format(count, p, v, "s.csv:105", "changes direction");
    model_sample(count, p, v);
    v[5] = v[4] - 0.12 * (v[count - 1] - v[0]);
    expect_format(count, p, v, "s.csv:105", "volume must rise");
    model_sample(count, p, v);
    for (size_t j = 0; j < count; ++j) {
      v[j] = -v[j];
    }
    expect_format(count, p, v, count == 8 ? "s.csv:107" : "s.csv:132", "volume must rise");
    for (size_t j = 0; j < count; ++j) {
      v[j] = 2000.0;
    }
    expect_format(count, p, v, count == 8 ? "s.csv:107" : "s.csv:132", "volume must rise");
  }
}

TEST(test_fit_curve_falling_over_a_tenth_of_range_refused) {
  double p[SAMPLES];
  double v[SAMPLES];
  model_sample(SAMPLES, p, v);
  const double span = v[SAMPLES - 1] - v[0];
  supine_pv_curve curve;
  v[20] = v[19] - 0.0999 * span;
  assert_int_equal(fit(SAMPLES, p, v, 0.95, &curve, NULL, NULL), SUPINE_OK);
  v[20] = v[19] - 0.1001 * span;
  expect_format(SAMPLES, p, v, "s.csv:120", "volume must rise");
}
