/* SPDX-License-Identifier: MIT */
/* Compute a breath: the course of pressure, and the volume that the limbs give it. */
#include <math.h>
#include <stdbool.h>

#include "runtime/limb.h"

const supine_pv *supine_breath_normal(void) {
  static const supine_pv normal = {
      /* Fitted to a + b / (1 + exp(-(P - 10) / 6)), a and b such that it spans 0 to 6000 mL. */
      {{{0.0, 30.0},
        {0.0, 6000.0},
        {-0.697448914, -2.22791741, 0.470886417, 0.269525392, -0.132010658}},
       /* c_1 = -k (P_high - P_low) / 2, k = ln 2 / 7.58 [Salazar1964] */
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
  if (!(breath->tidal > 0.0) || !isfinite(breath->tidal)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "tidal volume %g mL is not positive",
                            breath->tidal);
  }
  if (!(breath->rate > 0.0) || !isfinite(breath->rate)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "rate %g is not a positive number of breaths a minute", breath->rate);
  }
  if (!(breath->inhale_fraction > 0.0 && breath->inhale_fraction < 1.0)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "inhale fraction %g is not between 0 and 1", breath->inhale_fraction);
  }
  if ((int)breath->course < 0 || breath->course >= SUPINE_PV_COURSE_COUNT) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "unknown pressure course");
  }
  return SUPINE_OK;
}

/* Compute how far along its limb the breath is at a time, linear in time: 0 at rest, 1 at the peak.
 */
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

/* The P-V loop of one breath. */
typedef struct loop {
  double rest, peak; /* pressures, cmH2O */
  supine_limb limb[SUPINE_PV_LIMB_COUNT];
  double volume[SUPINE_PV_LIMB_COUNT]; /* volume at rest, mL */
  double gain[SUPINE_PV_LIMB_COUNT];   /* volume gained from rest to peak, mL */
} loop;

/* Check both limbs, and that their ranges hold a pressure, named `what` in messages. */
static supine_status limb_holds(const supine_pv *pv, const char *what, double pressure,
                                supine_error *error) {
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    const supine_pv_curve *curve = &pv->limb[limb];
    const supine_status status = supine_breath_curve_check(curve, error);
    if (status != SUPINE_OK) {
      return status;
    }
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
  supine_status status = limb_holds(pv, "rest", cycle->rest, error);
  if (status != SUPINE_OK) {
    return status;
  }
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    supine_limb_begin(&pv->limb[limb], &cycle->limb[limb]);
    cycle->volume[limb] = supine_limb_volume(&cycle->limb[limb], cycle->rest, NULL);
  }
  const double rest = cycle->volume[SUPINE_PV_INHALE];
  const double full = rest + breath->tidal;
  if (full > inhale->volume[1]) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "tidal volume %g mL is larger than the %g mL that the inhale limb "
                            "gains above %g cmH2O",
                            breath->tidal, inhale->volume[1] - rest, cycle->rest);
  }
  status = supine_limb_pressure(&cycle->limb[SUPINE_PV_INHALE], full, &cycle->peak);
  if (status != SUPINE_OK) {
    return supine_error_set(error, status, "no pressure found for %g mL on the inhale limb", full);
  }
  status = limb_holds(pv, "peak", cycle->peak, error);
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT && status == SUPINE_OK; ++limb) {
    cycle->gain[limb] =
        supine_limb_volume(&cycle->limb[limb], cycle->peak, NULL) - cycle->volume[limb];
    if (!(cycle->gain[limb] > 0.0)) {
      status = supine_error_set(
          error, SUPINE_ERROR_NUMERICAL, "the %s limb is too flat between %g and %g cmH2O",
          supine_breath_limb_name((supine_pv_limb)limb), cycle->rest, cycle->peak);
    }
  }
  return status;
}

static double between(double value, double low, double high) {
  return value < low ? low : value > high ? high : value;
}

/* Compute volume and pressure at a time: volume from pressure or, at constant flow, pressure from
 * volume. */
static supine_status follow(const supine_pv_breath *breath, const loop *cycle, double time,
                            double *volume, double *pressure, supine_error *error) {
  static const double pi = 3.14159265358979323846;
  supine_pv_limb of = SUPINE_PV_INHALE;
  double share = breath_share(breath, time, &of);
  const supine_limb *limb = &cycle->limb[of];
  if (breath->course == SUPINE_PV_CONSTANT_FLOW) {
    const double low = cycle->volume[of];
    const double high = low + cycle->gain[of];
    *volume = breath->tidal * share;
    const supine_status status =
        supine_limb_pressure(limb, between(low + share * cycle->gain[of], low, high), pressure);
    return status == SUPINE_OK ? status
                               : supine_error_set(error, status, "no pressure found at %g s", time);
  }
  if (breath->course == SUPINE_PV_COSINE) {
    share = 0.5 - 0.5 * cos(pi * share);
  }
  *pressure = between(cycle->rest + share * (cycle->peak - cycle->rest), cycle->rest, cycle->peak);
  const double gained = supine_limb_volume(limb, *pressure, NULL) - cycle->volume[of];
  *volume = breath->tidal * between(gained / cycle->gain[of], 0.0, 1.0);
  return SUPINE_OK;
}

supine_status supine_breath_evaluate(const supine_pv *pv, const supine_pv_breath *breath,
                                     size_t count, const double *times, double *volumes,
                                     double *pressures, supine_error *error) {
  supine_status status = breath_check(breath, error);
  for (size_t j = 0; j < count && status == SUPINE_OK; ++j) {
    if (!isfinite(times[j])) {
      status = supine_error_set(error, SUPINE_ERROR_ARGUMENT, "time %zu is not finite", j);
    }
  }
  if (status != SUPINE_OK || count == 0) {
    return status;
  }
  if (breath->course == SUPINE_PV_CONSTANT_FLOW && pressures == NULL) {
    for (size_t j = 0; j < count && volumes != NULL; ++j) {
      supine_pv_limb limb = SUPINE_PV_INHALE;
      volumes[j] = breath->tidal * breath_share(breath, times[j], &limb);
    }
    return SUPINE_OK;
  }
  if (pv == NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "this breath needs a pressure-volume relation: pass pv");
  }
  loop cycle;
  status = loop_begin(pv, breath, &cycle, error);
  for (size_t j = 0; j < count && status == SUPINE_OK; ++j) {
    double volume = 0.0;
    double pressure = 0.0;
    status = follow(breath, &cycle, times[j], &volume, &pressure, error);
    if (volumes != NULL) {
      volumes[j] = volume;
    }
    if (pressures != NULL) {
      pressures[j] = pressure;
    }
  }
  return status;
}
