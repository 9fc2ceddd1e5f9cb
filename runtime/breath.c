/* SPDX-License-Identifier: MIT */
/* Compute volume, compliance and pressure along a limb of the P-V loop, and over a breath. */
#include <math.h>
#include <stdbool.h>

#include <supine/breath.h>
#include <supine/inputs.h>

#include "base/arena.h"

/* Number of equal intervals of pressure for the integration of a pressure-volume limb. Over one
 * interval, the compliance changes by a factor of at most e^16, so that a Gauss-Legendre rule of 16
 * points is accurate to 1e-15. */
enum { LIMB_PARTS = 32 };

typedef struct integrated {
  supine_pv_curve curve;
  double sum[LIMB_PARTS + 1]; /* integral of slope() from x = -1 to the beginning of each part */
} integrated;

const char *supine_breath_limb_name(supine_pv_limb limb) {
  switch (limb) {
  case SUPINE_PV_INHALE:
    return "inhale";
  case SUPINE_PV_EXHALE:
    return "exhale";
  default:
    return "unknown limb";
  }
}

supine_status supine_breath_curve_check(const supine_pv_curve *curve, supine_error *error) {
  const double pressures = curve->pressure[1] - curve->pressure[0];
  const double volumes = curve->volume[1] - curve->volume[0];
  if (!(pressures > 0.0) || !isfinite(pressures)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the limb's pressures must rise, but go from %g to %g cmH2O",
                            curve->pressure[0], curve->pressure[1]);
  }
  if (!(volumes > 0.0) || !isfinite(volumes)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the limb's volumes must rise, but go from %g to %g mL",
                            curve->volume[0], curve->volume[1]);
  }
  for (int i = 0; i < SUPINE_PV_CONTROLS; ++i) {
    if (!(fabs(curve->control[i]) <= SUPINE_PV_CONTROL_MAX)) {
      return supine_error_set(
          error, SUPINE_ERROR_ARGUMENT, "control parameter c%d is %g: give a number from -%d to %d",
          i + 1, curve->control[i], (int)SUPINE_PV_CONTROL_MAX, (int)SUPINE_PV_CONTROL_MAX);
    }
  }
  return SUPINE_OK;
}

/* Compute exp(U(x)) for the function U that supine_breath_curve_evaluate defines. In step n of the
 * loop, `before`, `here` and `next` are the Legendre polynomials of degrees n - 1, n and n + 1. */
static double slope(const supine_pv_curve *curve, double x) {
  double before = 1.0;
  double here = x;
  double sum = curve->control[0] * (x + 1.0);
  for (int n = 1; n < SUPINE_PV_CONTROLS; ++n) {
    const double next = ((2 * n + 1) * x * here - n * before) / (n + 1);
    sum += curve->control[n] * (next - before) / (2 * n + 1);
    before = here;
    here = next;
  }
  return exp(sum);
}

/* Integrate slope() by the Gauss-Legendre rule of 16 points [Abramowitz and Stegun, 25.4]. */
static double integrate(const supine_pv_curve *curve, double from, double to) {
  static const double point[8] = {
      0.0950125098376374402, 0.2816035507792589132, 0.4580167776572273863, 0.6178762444026437484,
      0.7554044083550030339, 0.8656312023878317439, 0.9445750230732325761, 0.9894009349916499326};
  static const double weight[8] = {
      0.1894506104550684963, 0.1826034150449235888, 0.1691565193950025382, 0.1495959888165767321,
      0.1246289712555338720, 0.0951585116824927848, 0.0622535239386478929, 0.0271524594117540949};
  const double middle = 0.5 * (from + to);
  const double half = 0.5 * (to - from);
  double sum = 0.0;
  for (int i = 0; i < 8; ++i) {
    sum += weight[i] *
           (slope(curve, middle - half * point[i]) + slope(curve, middle + half * point[i]));
  }
  return half * sum;
}

static double part_begin(int part) {
  return -1.0 + 2.0 * part / LIMB_PARTS;
}

static void limb_begin(const supine_pv_curve *curve, integrated *of) {
  of->curve = *curve;
  of->sum[0] = 0.0;
  for (int part = 0; part < LIMB_PARTS; ++part) {
    of->sum[part + 1] = of->sum[part] + integrate(curve, part_begin(part), part_begin(part + 1));
  }
}

static double between(double value, double low, double high) {
  if (value < low) {
    return low;
  }
  return value > high ? high : value;
}

/* Return the volume of a limb at a pressure, mL. Write the compliance, mL/cmH2O, unless it is NULL.
 * Replace a pressure outside the range of the limb by the nearest end of the range. */
static double limb_volume(const integrated *of, double pressure, double *compliance) {
  const supine_pv_curve *curve = &of->curve;
  const double low = curve->pressure[0];
  const double high = curve->pressure[1];
  const double gain = (curve->volume[1] - curve->volume[0]) / of->sum[LIMB_PARTS];
  const double raw = ((pressure - low) - (high - pressure)) / (high - low);
  const double x = between(raw, -1.0, 1.0);
  if (compliance != NULL) {
    *compliance = 2.0 * gain / (high - low) * slope(curve, x);
  }
  const int part = (int)(0.5 * (x + 1.0) * LIMB_PARTS);
  if (part == LIMB_PARTS) {
    return curve->volume[1];
  }
  const double within = x > part_begin(part) ? integrate(curve, part_begin(part), x) : 0.0;
  return curve->volume[0] + gain * (of->sum[part] + within);
}

/* Find the pressure, cmH2O, at which a limb of a P-V loop has the given volume, mL, by bisection
 * down to the spacing of doubles. */
static double limb_pressure(const integrated *of, double volume) {
  double low = of->curve.pressure[0];
  double high = of->curve.pressure[1];
  for (int step = 0; step < 60; ++step) {
    const double middle = low + 0.5 * (high - low);
    if (limb_volume(of, middle, NULL) < volume) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return high;
}

supine_status supine_breath_curve_evaluate(const supine_pv_curve *curve, size_t count,
                                           const double *pressures, double *volumes,
                                           double *compliances, supine_error *error) {
  const supine_status status = supine_breath_curve_check(curve, error);
  if (status != SUPINE_OK || count == 0) {
    return status;
  }
  integrated of;
  limb_begin(curve, &of);
  for (size_t j = 0; j < count; ++j) {
    if (!(pressures[j] >= curve->pressure[0] && pressures[j] <= curve->pressure[1])) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "pressure %g cmH2O is outside the limb's range: give %g to %g cmH2O",
                              pressures[j], curve->pressure[0], curve->pressure[1]);
    }
    const double volume =
        limb_volume(&of, pressures[j], compliances == NULL ? NULL : &compliances[j]);
    if (volumes != NULL) {
      volumes[j] = volume;
    }
  }
  return SUPINE_OK;
}

const supine_pv *supine_breath_normal(void) {
  static const supine_pv normal = {
      /* Curve of inhalation: pressures at its ends, cmH2O, volumes at its ends, mL, and control
       * parameters of an approximate sigmoid 1 / (1 + exp(-(P - 10) / 6)) of the pressure P. */
      {{{0.0, 30.0},
        {0.0, 6000.0},
        {-0.697448914, -2.22791741, 0.470886417, 0.269525392, -0.132010658}},
       /* Curve of exhalation: an exponential (supine_breath_normal). The first control parameter is
        * minus half of the pressure range, 15 cmH2O, times ln 2 / (7.58 cmH2O). */
       {{0.0, 30.0}, {0.0, 6000.0}, {-1.3716632861, 0.0, 0.0, 0.0, 0.0}}}};
  return &normal;
}

supine_pv_breath supine_breath_default(void) {
  return (supine_pv_breath){.tidal = 500.0,
                            .rate = 12.0,
                            .inhale_fraction = 1.0 / 3.0,
                            .rest_pressure = 5.0,
                            .course = SUPINE_PV_COSINE};
}

static supine_status breath_check(const supine_pv_breath *breath, supine_error *error) {
  if (!isfinite(breath->tidal) ||
      supine_input_judge(SUPINE_INPUT_BREATH_LEAST, breath->tidal) == SUPINE_INPUT_REFUSED) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the tidal volume is %g mL: give %g mL or more, such as 500 mL",
                            breath->tidal, supine_input_get(SUPINE_INPUT_BREATH_LEAST)->refused);
  }
  if (!(breath->rate > 0.0) || !isfinite(breath->rate)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the rate is %g breaths a minute: give a rate above 0", breath->rate);
  }
  if (!(breath->inhale_fraction > 0.0 && breath->inhale_fraction < 1.0)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the inhale fraction is %g: give a fraction between 0 and 1",
                            breath->inhale_fraction);
  }
  if (!isfinite(breath->rest_pressure)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the rest pressure is %g cmH2O: give a finite pressure",
                            breath->rest_pressure);
  }
  if ((int)breath->course < 0 || breath->course >= SUPINE_PV_COURSE_COUNT) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "course %d is unknown: use a value of supine_pv_course",
                            (int)breath->course);
  }
  return SUPINE_OK;
}

/* Write whether the breath inhales or exhales at `time`, s. Return a number that rises linearly in
 * time from 0 at rest to 1 at the peak of the breath, and then falls linearly to 0. */
static double breath_share(const supine_pv_breath *breath, double time, supine_pv_limb *limb) {
  const double turns = time * (breath->rate / 60.0);
  const double phase = turns - floor(turns);
  if (phase < breath->inhale_fraction) {
    *limb = SUPINE_PV_INHALE;
    return phase / breath->inhale_fraction;
  }
  *limb = SUPINE_PV_EXHALE;
  return (1.0 - phase) / (1.0 - breath->inhale_fraction);
}

typedef struct loop {
  double rest, peak; /* pressures at rest and at the peak, cmH2O */
  integrated limbs[SUPINE_PV_LIMB_COUNT];
  double volume[SUPINE_PV_LIMB_COUNT]; /* volume of each limb at the rest pressure, mL */
  double gain[SUPINE_PV_LIMB_COUNT];   /* volume that each limb gains from rest to the peak, mL */
} loop;

/* Check both limbs (inhale and exhale) of a pressure-volume relation, and that each contains the
 * pressure, cmH2O, which messages call `what`. */
static supine_status limb_holds(const supine_pv *pv, const char *what, double pressure,
                                supine_error *error) {
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    const supine_pv_curve *curve = &pv->limb[limb];
    SUPINE_TRY(supine_breath_curve_check(curve, error));
    if (!(pressure >= curve->pressure[0] && pressure <= curve->pressure[1])) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "%s pressure %g cmH2O is outside the %s limb's range, %g to %g cmH2O",
                              what, pressure, supine_breath_limb_name((supine_pv_limb)limb),
                              curve->pressure[0], curve->pressure[1]);
    }
  }
  return SUPINE_OK;
}

static supine_status loop_begin(const supine_pv *pv, const supine_pv_breath *breath, loop *cycle,
                                supine_error *error) {
  const supine_pv_curve *inhale = &pv->limb[SUPINE_PV_INHALE];
  cycle->rest = breath->rest_pressure;
  SUPINE_TRY(limb_holds(pv, "rest", cycle->rest, error));
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    limb_begin(&pv->limb[limb], &cycle->limbs[limb]);
    cycle->volume[limb] = limb_volume(&cycle->limbs[limb], cycle->rest, NULL);
  }
  const double rest = cycle->volume[SUPINE_PV_INHALE];
  const double full = rest + breath->tidal;
  if (full > inhale->volume[1]) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "tidal volume %g mL is larger than the %g mL that the inhale limb "
                            "gains above %g cmH2O: give a smaller volume",
                            breath->tidal, inhale->volume[1] - rest, cycle->rest);
  }
  cycle->peak = limb_pressure(&cycle->limbs[SUPINE_PV_INHALE], full);
  SUPINE_TRY(limb_holds(pv, "peak", cycle->peak, error));
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    cycle->gain[limb] = limb_volume(&cycle->limbs[limb], cycle->peak, NULL) - cycle->volume[limb];
    if (!(cycle->gain[limb] > 0.0)) {
      return supine_error_set(
          error, SUPINE_ERROR_NUMERICAL,
          "the %s limb is too flat between %g and %g cmH2O: check the pressure-volume relation",
          supine_breath_limb_name((supine_pv_limb)limb), cycle->rest, cycle->peak);
    }
  }
  return SUPINE_OK;
}

/* Compute the volume, mL, and the pressure, cmH2O, of a breath at a time, s. If the flow is
 * constant, find the pressure from the volume. Otherwise, find the volume from the pressure. */
static void follow(const supine_pv_breath *breath, const loop *cycle, double time, double *volume,
                   double *pressure) {
  static const double pi = 3.14159265358979323846;
  supine_pv_limb of = SUPINE_PV_INHALE;
  double share = breath_share(breath, time, &of);
  const integrated *here = &cycle->limbs[of];
  if (breath->course == SUPINE_PV_CONSTANT_FLOW) {
    const double low = cycle->volume[of];
    const double high = low + cycle->gain[of];
    *volume = breath->tidal * share;
    *pressure = limb_pressure(here, between(low + share * cycle->gain[of], low, high));
    return;
  }
  if (breath->course == SUPINE_PV_COSINE) {
    share = 0.5 - 0.5 * cos(pi * share);
  }
  *pressure = between(cycle->rest + share * (cycle->peak - cycle->rest), cycle->rest, cycle->peak);
  const double gained = limb_volume(here, *pressure, NULL) - cycle->volume[of];
  *volume = breath->tidal * between(gained / cycle->gain[of], 0.0, 1.0);
}

supine_status supine_breath_evaluate(const supine_pv *pv, const supine_pv_breath *breath,
                                     size_t count, const double *times, double *volumes,
                                     double *pressures, supine_error *error) {
  SUPINE_TRY(breath_check(breath, error));
  for (size_t j = 0; j < count; ++j) {
    if (!isfinite(times[j] * (breath->rate / 60.0))) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "times[%zu] is not finite, or its number of breaths is not: give a "
                              "time in s",
                              j);
    }
  }
  if (count == 0) {
    return SUPINE_OK;
  }
  if (breath->course == SUPINE_PV_CONSTANT_FLOW && pressures == NULL) {
    if (volumes != NULL) {
      for (size_t j = 0; j < count; ++j) {
        supine_pv_limb limb = SUPINE_PV_INHALE;
        volumes[j] = breath->tidal * breath_share(breath, times[j], &limb);
      }
    }
    return SUPINE_OK;
  }
  if (pv == NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "this breath needs a pressure-volume relation: pass pv");
  }
  loop cycle;
  SUPINE_TRY(loop_begin(pv, breath, &cycle, error));
  for (size_t j = 0; j < count; ++j) {
    double volume = 0.0;
    double pressure = 0.0;
    follow(breath, &cycle, times[j], &volume, &pressure);
    if (volumes != NULL) {
      volumes[j] = volume;
    }
    if (pressures != NULL) {
      pressures[j] = pressure;
    }
  }
  return SUPINE_OK;
}
