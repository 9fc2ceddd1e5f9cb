/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the volume and pressure of a breath over time. */
#include <float.h>

#include "tests/helpers/test.h"

#include <supine/breath.h>

enum { FRAMES = 401 };

/* Tolerance of volumes, relative to the tidal volume: a time of up to about 10 breaths is rounded
 * by a few epsilon, and the volume changes by a few tidal volumes per breath. */
static const double rounding = 256.0 * DBL_EPSILON;

static supine_pv_breath breath_of(supine_pv_course course) {
  return (supine_pv_breath){.tidal = 637.0,
                            .rate = 13.7,
                            .inhale_fraction = 0.37,
                            .rest_pressure = 5.3,
                            .course = course};
}

TEST(test_breath_each_course_starts_at_rest_and_reaches_tidal_volume) {
  for (int course = 0; course < SUPINE_PV_COURSE_COUNT; ++course) {
    const supine_pv_breath breath = breath_of((supine_pv_course)course);
    const double period = 60.0 / breath.rate;
    for (int n = -2; n <= 3; ++n) {
      const double times[2] = {n * period, (n + breath.inhale_fraction) * period};
      double volumes[2];
      double pressures[2];
      assert_int_equal(supine_breath_evaluate(supine_breath_normal(), &breath, 2, times, volumes,
                                              pressures, NULL),
                       SUPINE_OK);
      assert_close(volumes[0], 0.0, rounding * breath.tidal);
      assert_close(volumes[1], breath.tidal, rounding * breath.tidal);
      assert_close(pressures[0], breath.rest_pressure, 1e-9);
      double limb_volumes[2];
      const double limb[2] = {breath.rest_pressure, pressures[1]};
      assert_int_equal(supine_breath_curve_evaluate(&supine_breath_normal()->limb[0], 2, limb,
                                                    limb_volumes, NULL, NULL),
                       SUPINE_OK);
      assert_close(limb_volumes[1] - limb_volumes[0], breath.tidal, 1e-6);
    }
  }
}

TEST(test_breath_each_course_rises_then_falls_and_repeats) {
  for (int course = 0; course < SUPINE_PV_COURSE_COUNT; ++course) {
    const supine_pv_breath breath = breath_of((supine_pv_course)course);
    const double period = 60.0 / breath.rate;
    double times[2 * FRAMES];
    double volumes[2 * FRAMES];
    double pressures[2 * FRAMES];
    for (size_t j = 0; j < FRAMES; ++j) {
      times[j] = period * ((double)j + 0.5) / FRAMES;
      times[FRAMES + j] = times[j] + 3.0 * period;
    }
    assert_int_equal(supine_breath_evaluate(supine_breath_normal(), &breath, 2 * FRAMES, times,
                                            volumes, pressures, NULL),
                     SUPINE_OK);
    for (size_t j = 0; j < FRAMES; ++j) {
      assert_true(volumes[j] >= 0.0 && volumes[j] <= breath.tidal);
      assert_close(volumes[FRAMES + j], volumes[j], 16.0 * rounding * breath.tidal + 1e-8);
      if (j == 0) {
        continue;
      }
      const bool inhaling = times[j] < breath.inhale_fraction * period;
      const bool turned = !inhaling && times[j - 1] < breath.inhale_fraction * period;
      if (!turned) {
        assert_true(inhaling == (volumes[j] > volumes[j - 1]));
        assert_true(inhaling == (pressures[j] > pressures[j - 1]));
      }
    }
  }
}

/* Pressure follows the course of the breath. The inhale or exhale limb of the pressure-volume
 * curve, scaled to the tidal volume, gives the volume. */
TEST(test_breath_volume_follows_scaled_limbs) {
  const supine_pv *normal = supine_breath_normal();
  for (int course = 0; course < SUPINE_PV_COURSE_COUNT; ++course) {
    const supine_pv_breath breath = breath_of((supine_pv_course)course);
    const double period = 60.0 / breath.rate;
    const double shares[] = {0.13, 0.31, 0.44, 0.83};
    for (size_t j = 0; j < 4; ++j) {
      const double times[2] = {period * shares[j], period * breath.inhale_fraction};
      double v[2];
      double p[2];
      assert_int_equal(supine_breath_evaluate(normal, &breath, 2, times, v, p, NULL), SUPINE_OK);
      const double f = breath.inhale_fraction;
      const bool inhaling = shares[j] < f;
      const double way = inhaling ? shares[j] / f : (1.0 - shares[j]) / (1.0 - f);
      const double rise = (p[0] - breath.rest_pressure) / (p[1] - breath.rest_pressure);
      if (course == SUPINE_PV_COSINE) {
        assert_close(rise, pow(sin(0.5 * M_PI * way), 2), 1e-9);
      } else if (course == SUPINE_PV_RAMP) {
        assert_close(rise, way, 1e-9);
      } else {
        assert_close(v[0], breath.tidal * way, rounding * breath.tidal);
      }
      const double at[3] = {breath.rest_pressure, p[0], p[1]};
      double limb[3];
      assert_int_equal(
          supine_breath_curve_evaluate(&normal->limb[inhaling ? 0 : 1], 3, at, limb, NULL, NULL),
          SUPINE_OK);
      assert_close(v[0], breath.tidal * (limb[1] - limb[0]) / (limb[2] - limb[0]), 1e-6);
    }
  }
}

/* Each pressure and volume of a breath with constant flow lie on the pressure-volume curve, even if
 * the curve has two steep parts. */
TEST(test_breath_constant_flow_stiff_limb_pressures_give_volumes) {
  enum { COUNT = 61 };
  const supine_pv_curve stiff = {{0.0, 45.0}, {0.0, 800.0}, {0.5, -4.5, -2.3, 12.0, 2.7}};
  const supine_pv pv = {{stiff, stiff}};
  supine_pv_breath breath = breath_of(SUPINE_PV_CONSTANT_FLOW);
  double times[COUNT];
  double v[COUNT];
  double p[COUNT];
  double limb[COUNT];
  breath.rest_pressure = 0.0;
  breath.tidal = 799.0;
  for (size_t j = 0; j < COUNT; ++j) {
    times[j] = 60.0 / breath.rate * (double)j / (COUNT - 1);
  }
  assert_int_equal(supine_breath_evaluate(&pv, &breath, COUNT, times, v, p, NULL), SUPINE_OK);
  assert_int_equal(supine_breath_curve_evaluate(&stiff, COUNT, p, limb, NULL, NULL), SUPINE_OK);
  for (size_t j = 0; j < COUNT; ++j) {
    assert_close(limb[j], v[j], 1e-7);
  }
}

/* Inhaling 500 mL in 5 s adds 1.5 mL in each step of 15 ms, as in [Santhanam2008] V. */
TEST(test_breath_constant_flow_has_volume_step_of_paper) {
  const supine_pv_breath breath = {
      .tidal = 500.0, .rate = 6.0, .inhale_fraction = 0.5, .course = SUPINE_PV_CONSTANT_FLOW};
  double times[334];
  double volumes[334];
  for (size_t j = 0; j < 334; ++j) {
    times[j] = 0.015 * (double)j;
  }
  times[333] = 5.0;
  assert_int_equal(supine_breath_evaluate(NULL, &breath, 334, times, volumes, NULL, NULL),
                   SUPINE_OK);
  for (size_t j = 1; j < 333; ++j) {
    assert_close(volumes[j] - volumes[j - 1], 1.5, rounding * 500.0);
  }
  assert_close(volumes[333], 500.0, rounding * 500.0);
}

TEST(test_breath_default_is_quiet_breathing) {
  const supine_pv_breath breath = supine_breath_default();
  assert_true(breath.tidal == 500.0 && breath.rate == 12.0);
  const double times[2] = {0.0, 5.0 / 3.0};
  double volumes[2];
  double pressures[2];
  assert_int_equal(
      supine_breath_evaluate(supine_breath_normal(), &breath, 2, times, volumes, pressures, NULL),
      SUPINE_OK);
  assert_close(volumes[1], 500.0, 500.0 * rounding);
  /* The compliance of the built-in sigmoid rises from 262 mL/cmH2O at 5 cmH2O to 310 at 10
   * cmH2O. */
  assert_true(pressures[1] - pressures[0] > 500.0 / 310.0 &&
              pressures[1] - pressures[0] < 500.0 / 262.0);
}

static void expect_argument(const supine_pv *pv, const supine_pv_breath *breath, double time,
                            const char *text) {
  supine_error error = {0};
  double volume = 0.0;
  assert_int_equal(supine_breath_evaluate(pv, breath, 1, &time, &volume, NULL, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, text);
}

TEST(test_breath_out_of_range_refused) {
  const supine_pv *normal = supine_breath_normal();
  const double bad[] = {0.0, -3.0, NAN, INFINITY};
  for (size_t i = 0; i < 4; ++i) {
    for (int course = 0; course < SUPINE_PV_COURSE_COUNT; ++course) {
      supine_pv_breath breath = breath_of((supine_pv_course)course);
      breath.rate = bad[i];
      expect_argument(normal, &breath, 1.0, "rate");
      breath = breath_of((supine_pv_course)course);
      breath.tidal = bad[i];
      expect_argument(normal, &breath, 1.0, "tidal volume");
      breath = breath_of((supine_pv_course)course);
      breath.inhale_fraction = bad[i];
      expect_argument(normal, &breath, 1.0, "inhale fraction");
    }
  }
  supine_pv_breath breath = breath_of(SUPINE_PV_COSINE);
  expect_argument(normal, &breath, NAN, "times[0] is not finite");
  expect_argument(NULL, &breath, 1.0, "needs a pressure-volume relation");
  breath.rest_pressure = -0.1;
  expect_argument(normal, &breath, 1.0, "rest pressure -0.1");
  breath = breath_of(SUPINE_PV_COSINE);
  breath.tidal = 5000.0;
  expect_argument(normal, &breath, 1.0, "tidal volume 5000 mL is larger than");
  breath = breath_of(SUPINE_PV_COURSE_COUNT);
  expect_argument(normal, &breath, 1.0, "course 3 is unknown");
  supine_pv narrow = *normal; /* an exhale limb that ends below the peak pressure */
  narrow.limb[SUPINE_PV_EXHALE].pressure[1] = 6.0;
  breath = breath_of(SUPINE_PV_COSINE);
  expect_argument(&narrow, &breath, 1.0, "outside the exhale limb's range");
  assert_int_equal(supine_breath_evaluate(normal, &breath, 0, NULL, NULL, NULL, NULL), SUPINE_OK);
}
