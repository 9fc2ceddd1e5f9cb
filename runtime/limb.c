/* SPDX-License-Identifier: MIT */
/* Compute volume and compliance of a limb at a pressure, and the pressure at a volume. */
#include <math.h>
#include <stdbool.h>

#include "runtime/limb.h"

const char *supine_breath_limb_name(supine_pv_limb limb) {
  return limb == SUPINE_PV_INHALE ? "inhale" : limb == SUPINE_PV_EXHALE ? "exhale" : "unknown limb";
}

supine_status supine_breath_curve_check(const supine_pv_curve *curve, supine_error *error) {
  const double pressures = curve->pressure[1] - curve->pressure[0];
  const double volumes = curve->volume[1] - curve->volume[0];
  if (!(pressures > 0.0) || !isfinite(pressures)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the limb's pressures must rise from %g to %g cmH2O",
                            curve->pressure[0], curve->pressure[1]);
  }
  if (!(volumes > 0.0) || !isfinite(volumes)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the limb's volumes must rise from %g to %g mL", curve->volume[0],
                            curve->volume[1]);
  }
  for (int i = 0; i < SUPINE_PV_CONTROLS; ++i) {
    if (!(fabs(curve->control[i]) <= SUPINE_PV_CONTROL_MAX)) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "control parameter c%d is %g; it must be within +-%d", i + 1,
                              curve->control[i], (int)SUPINE_PV_CONTROL_MAX);
    }
  }
  return SUPINE_OK;
}

/* Compute exp(U(x)), the slope of I. U's terms are integrals of Legendre polynomials,
 * (P_n+1 - P_n-1) / (2 n + 1) from -1 to x. */
static double slope(const supine_pv_curve *curve, double x) {
  double before = 1.0;
  double here = x;
  double sum = curve->control[0] * (x + 1.0);
  for (int n = 1; n < SUPINE_PV_CONTROLS; ++n) {
    const double next = ((2 * n + 1) * x * here - n * before) / (n + 1); /* P_n+1 */
    sum += curve->control[n] * (next - before) / (2 * n + 1);
    before = here;
    here = next;
  }
  return exp(sum);
}

/* Integrate the slope between two x by the Gauss-Legendre rule of 16 points [Abramowitz and Stegun,
 * table 25.4]. */
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

void supine_limb_begin(const supine_pv_curve *curve, supine_limb *limb) {
  limb->curve = *curve;
  limb->sum[0] = 0.0;
  for (int part = 0; part < LIMB_PARTS; ++part) {
    limb->sum[part + 1] =
        limb->sum[part] + integrate(curve, part_begin(part), part_begin(part + 1));
  }
}

double supine_limb_volume(const supine_limb *limb, double pressure, double *compliance) {
  const supine_pv_curve *curve = &limb->curve;
  const double low = curve->pressure[0];
  const double high = curve->pressure[1];
  const double gain = (curve->volume[1] - curve->volume[0]) / limb->sum[LIMB_PARTS];
  const double raw = ((pressure - low) - (high - pressure)) / (high - low);
  const double x = raw < -1.0 ? -1.0 : raw > 1.0 ? 1.0 : raw;
  if (compliance != NULL) {
    *compliance = 2.0 * gain / (high - low) * slope(curve, x);
  }
  const int part = (int)(0.5 * (x + 1.0) * LIMB_PARTS);
  if (part == LIMB_PARTS) {
    return curve->volume[1];
  }
  const double within = x > part_begin(part) ? integrate(curve, part_begin(part), x) : 0.0;
  return curve->volume[0] + gain * (limb->sum[part] + within);
}

supine_status supine_limb_pressure(const supine_limb *limb, double volume, double *pressure) {
  enum { STEPS_MAX = 200 };
  const supine_pv_curve *curve = &limb->curve;
  const double span = curve->volume[1] - curve->volume[0];
  const double within = 1e-11 * span;
  const double share = (volume - curve->volume[0]) / span;
  double low = curve->pressure[0];
  double high = curve->pressure[1];
  double before = HUGE_VAL; /* |V - volume| at the pressure before, mL */
  double at = (1.0 - share) * low + share * high;
  for (int step = 0; step < STEPS_MAX; ++step) {
    double compliance = 0.0;
    const double held = supine_limb_volume(limb, at, &compliance);
    const double miss = fabs(held - volume);
    if (held < volume) {
      low = at;
    } else {
      high = at;
    }
    double next = at + (volume - held) / compliance;
    const bool inside = next >= low && next <= high;
    if (miss <= within || high - low <= 1e-15 * fabs(at)) {
      *pressure = inside ? next : at; /* Newton's last step costs nothing */
      return SUPINE_OK;
    }
    /* Take the Newton step, or the middle of the bracket if the step leaves it or if the last step
     * did not halve the error. */
    if (!inside || miss > 0.5 * before) {
      next = low + 0.5 * (high - low);
    }
    before = miss;
    at = next;
  }
  return SUPINE_ERROR_NUMERICAL;
}

supine_status supine_breath_curve_evaluate(const supine_pv_curve *curve, size_t count,
                                           const double *pressures, double *volumes,
                                           double *compliances, supine_error *error) {
  const supine_status status = supine_breath_curve_check(curve, error);
  if (status != SUPINE_OK || count == 0) {
    return status;
  }
  supine_limb limb;
  supine_limb_begin(curve, &limb);
  for (size_t j = 0; j < count; ++j) {
    if (!(pressures[j] >= curve->pressure[0] && pressures[j] <= curve->pressure[1])) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "pressure %g cmH2O is outside the limb's range, %g to %g cmH2O",
                              pressures[j], curve->pressure[0], curve->pressure[1]);
    }
    const double volume =
        supine_limb_volume(&limb, pressures[j], compliances == NULL ? NULL : &compliances[j]);
    if (volumes != NULL) {
      volumes[j] = volume;
    }
  }
  return SUPINE_OK;
}
