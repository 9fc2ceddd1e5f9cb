/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the equation of one limb of the pressure-volume curve (inhale or exhale), and the built-in
 * normal lung. */
#include <float.h>

#include "tests/helpers/test.h"

#include <supine/breath.h>

enum { COUNT = 61 };

/* Error of quadrature and rounding, divided by the range of volumes; about 450 DBL_EPSILON. */
static const double integration = 1e-13;

static const supine_pv_curve sigmoid = {
    {-4.3, 38.7}, {130.0, 3517.0}, {0.37, -5.1, -1.2, 3.3, 0.8}};

static void spread(double low, double high, double *at) {
  for (size_t j = 0; j < COUNT; ++j) {
    at[j] = low + (high - low) * (double)j / (COUNT - 1);
  }
  at[COUNT - 1] = high;
}

TEST(test_evaluate_constant_control_gives_salazar_knowles) {
  /* Rates k, 1/cmH2O, from emphysema to fibrosis, of the volume V = Vmax (1 - exp(-k P)) at the
   * pressure P. */
  static const double k[] = {0.31, 0.0914, 0.043};
  for (size_t i = 0; i < sizeof k / sizeof *k; ++i) {
    const double most = 6413.0;
    const double low = 1.7;
    const double high = 33.1;
    const supine_pv_curve curve = {{low, high},
                                   {-most * expm1(-k[i] * low), -most * expm1(-k[i] * high)},
                                   {-0.5 * k[i] * (high - low), 0.0, 0.0, 0.0, 0.0}};
    double pressures[COUNT];
    double volumes[COUNT];
    double compliances[COUNT];
    spread(low, high, pressures);
    assert_int_equal(
        supine_breath_curve_evaluate(&curve, COUNT, pressures, volumes, compliances, NULL),
        SUPINE_OK);
    for (size_t j = 0; j < COUNT; ++j) {
      assert_close(volumes[j], -most * expm1(-k[i] * pressures[j]), integration * most);
      assert_close(compliances[j], k[i] * most * exp(-k[i] * pressures[j]), integration * most);
    }
  }
}

TEST(test_evaluate_second_control_gives_gaussian_compliance) {
  /* If only the second control parameter c2 differs from 0, compliance is a Gaussian function of
   * pressure, and its integral, the volume, is an error function. */
  const double c2 = -7.3;
  const double root = sqrt(-c2 / 2.0);
  const supine_pv_curve curve = {{0.0, 40.0}, {0.0, 1000.0}, {0.0, c2, 0.0, 0.0, 0.0}};
  double pressures[COUNT];
  double volumes[COUNT];
  spread(0.0, 40.0, pressures);
  assert_int_equal(supine_breath_curve_evaluate(&curve, COUNT, pressures, volumes, NULL, NULL),
                   SUPINE_OK);
  for (size_t j = 0; j < COUNT; ++j) {
    const double x = pressures[j] / 20.0 - 1.0;
    assert_close(volumes[j], 500.0 * (1.0 + erf(root * x) / erf(root)), integration * 1000.0);
  }
}

/* Let x be the pressure, scaled to -1 to 1 over the range of the curve. For any coefficients, the
 * derivative of the logarithm of the compliance with respect to x, by finite differences, equals
 * the sum u(x) of Legendre polynomials. */
TEST(test_evaluate_any_controls_satisfy_equation) {
  const double half = 0.5 * (sigmoid.pressure[1] - sigmoid.pressure[0]);
  const double step = 1e-4;
  for (int j = 0; j < 12; ++j) {
    const double x = -0.93 + 0.17 * j;
    const double middle = sigmoid.pressure[0] + half * (1.0 + x);
    const double pressures[2] = {middle - half * step, middle + half * step};
    double compliances[2];
    assert_int_equal(supine_breath_curve_evaluate(&sigmoid, 2, pressures, NULL, compliances, NULL),
                     SUPINE_OK);
    const double *c = sigmoid.control;
    const double u = c[0] + c[1] * x + c[2] * (3.0 * x * x - 1.0) / 2.0 +
                     c[3] * (5.0 * x * x * x - 3.0 * x) / 2.0 +
                     c[4] * (35.0 * pow(x, 4) - 30.0 * x * x + 3.0) / 8.0;
    /* The error of the difference quotient is of order step^2. */
    assert_close(log(compliances[1] / compliances[0]) / (2.0 * step), u, 100 * step * step);
  }
}

TEST(test_evaluate_limb_ends_exact_in_any_order) {
  const double middle = 11.3;
  const double pressures[5] = {sigmoid.pressure[1], middle, sigmoid.pressure[0], middle,
                               sigmoid.pressure[1]};
  double volumes[5];
  assert_int_equal(supine_breath_curve_evaluate(&sigmoid, 5, pressures, volumes, NULL, NULL),
                   SUPINE_OK);
  assert_close(volumes[2], sigmoid.volume[0], 0.0);
  assert_close(volumes[0], sigmoid.volume[1], 4.0 * DBL_EPSILON * sigmoid.volume[1]);
  assert_true(volumes[0] == volumes[4]);
  assert_true(volumes[1] == volumes[3]);
  assert_true(volumes[1] > volumes[2] && volumes[1] < volumes[0]);
  assert_int_equal(supine_breath_curve_evaluate(&sigmoid, 0, NULL, NULL, NULL, NULL), SUPINE_OK);
}

TEST(test_evaluate_extreme_controls_volume_rises) {
  const supine_pv_curve wild = {{0.0, 20.0}, {0.0, 1.0}, {9.1, -17.3, 21.7, 14.9, -11.3}};
  double pressures[COUNT];
  double volumes[COUNT];
  double compliances[COUNT];
  spread(0.0, 20.0, pressures);
  assert_int_equal(
      supine_breath_curve_evaluate(&wild, COUNT, pressures, volumes, compliances, NULL), SUPINE_OK);
  for (size_t j = 0; j < COUNT; ++j) {
    assert_true(compliances[j] > 0.0);
    assert_true(j == 0 || volumes[j] > volumes[j - 1]);
  }
}

TEST(test_evaluate_outside_range_or_bad_curve_refused) {
  supine_error error = {0};
  double out = 0.0;
  const double beyond[] = {-4.4, 38.8, NAN, INFINITY};
  for (size_t j = 0; j < 4; ++j) {
    assert_int_equal(supine_breath_curve_evaluate(&sigmoid, 1, &beyond[j], &out, NULL, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, "-4.3 to 38.7 cmH2O");
  }
  supine_pv_curve bad[6] = {sigmoid, sigmoid, sigmoid, sigmoid, sigmoid, sigmoid};
  bad[0].pressure[1] = bad[0].pressure[0];
  bad[1].volume[1] = bad[1].volume[0] - 1.0;
  bad[2].control[3] = NAN;
  bad[3].control[4] = -50.5;
  bad[4].pressure[0] = -INFINITY;
  bad[5].volume[1] = INFINITY;
  for (size_t j = 0; j < 6; ++j) {
    const double pressure = 5.0;
    assert_int_equal(supine_breath_curve_check(&bad[j], &error), SUPINE_ERROR_ARGUMENT);
    assert_int_equal(supine_breath_curve_evaluate(&bad[j], 1, &pressure, &out, NULL, NULL),
                     SUPINE_ERROR_ARGUMENT);
  }
}

TEST(test_normal_lung_has_stated_curves) {
  const double k = log(2.0) / 7.58; /* [Salazar1964]: half-inflation pressure 7.58 cmH2O */
  const double rise = 1.0 / (1.0 + exp(-20.0 / 6.0)) - 1.0 / (1.0 + exp(10.0 / 6.0));
  double pressures[COUNT];
  double inhale[COUNT];
  double exhale[COUNT];
  spread(0.0, 30.0, pressures);
  const supine_pv *normal = supine_breath_normal();
  assert_int_equal(
      supine_breath_curve_evaluate(&normal->limb[0], COUNT, pressures, inhale, NULL, NULL),
      SUPINE_OK);
  assert_int_equal(
      supine_breath_curve_evaluate(&normal->limb[1], COUNT, pressures, exhale, NULL, NULL),
      SUPINE_OK);
  for (size_t j = 0; j < COUNT; ++j) {
    const double p = pressures[j];
    assert_close(exhale[j], 6000.0 * expm1(-k * p) / expm1(-30.0 * k), 1e-4);
    const double share =
        (1.0 / (1.0 + exp(-(p - 10.0) / 6.0)) - 1.0 / (1.0 + exp(10.0 / 6.0))) / rise;
    assert_close(inhale[j], 6000.0 * share, 2.0); /* within 0.03 % of the range */
    assert_true(exhale[j] >= inhale[j] - 1e-9);   /* hysteresis: more volume on the exhale limb */
  }
}

TEST(test_limb_name_any_value_not_null) {
  assert_string_equal(supine_breath_limb_name(SUPINE_PV_INHALE), "inhale");
  assert_string_equal(supine_breath_limb_name(SUPINE_PV_EXHALE), "exhale");
  assert_non_null(supine_breath_limb_name(SUPINE_PV_LIMB_COUNT));
}
