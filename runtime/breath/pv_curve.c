/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A limb forwards: volume and compliance at a pressure. */
#include <math.h>
#include <stdlib.h>

#include <gsl/gsl_sort.h>

#include "runtime/breath/pv_internal.h"

const char *supine_breath_limb_name(supine_pv_limb limb) {
  return limb == SUPINE_PV_INHALE ? "inhale" : limb == SUPINE_PV_EXHALE ? "exhale" : "unknown limb";
}

double supine_breath_normalise(const supine_pv_curve *curve, double pressure) {
  const double low = curve->pressure[0];
  const double high = curve->pressure[1];
  const double x = ((pressure - low) - (high - pressure)) / (high - low);
  return x < -1.0 ? -1.0 : x > 1.0 ? 1.0 : x;
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

/* The pressures' ranks in `order`, and their x, ascending and followed by 1. */
static supine_status curve_sort(const supine_pv_curve *curve, size_t count, const double *pressures,
                                size_t *order, double *x, supine_error *error) {
  for (size_t j = 0; j < count; ++j) {
    if (!(pressures[j] >= curve->pressure[0] && pressures[j] <= curve->pressure[1])) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "pressure %g cmH2O is outside the limb's range, %g to %g cmH2O",
                              pressures[j], curve->pressure[0], curve->pressure[1]);
    }
  }
  gsl_sort_index(order, pressures, 1, count);
  for (size_t j = 0; j < count; ++j) {
    x[j] = supine_breath_normalise(curve, pressures[order[j]]);
  }
  x[count] = 1.0;
  return SUPINE_OK;
}

supine_status supine_breath_curve_evaluate(const supine_pv_curve *curve, size_t count,
                                           const double *pressures, double *volumes,
                                           double *compliances, supine_error *error) {
  supine_status status = supine_breath_curve_check(curve, error);
  if (status != SUPINE_OK || count == 0) {
    return status;
  }
  size_t *order = calloc(count, sizeof *order);
  double *x = calloc(count + 1, sizeof *x);
  double *states = calloc(count + 1, PV_STATE * sizeof *states);
  if (order == NULL || x == NULL || states == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
    goto cleanup;
  }
  status = curve_sort(curve, count, pressures, order, x, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  status = supine_breath_integrate(curve->control, count + 1, x, PV_STATE, states);
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "cannot integrate the pressure-volume equation");
    goto cleanup;
  }
  /* The equation is linear in V: the solution from V = 0, V' = 1 scales to the volumes at the ends.
   */
  const double scale = (curve->volume[1] - curve->volume[0]) / states[PV_STATE * count];
  const double slope = 2.0 / (curve->pressure[1] - curve->pressure[0]);
  for (size_t j = 0; j < count; ++j) {
    if (volumes != NULL) {
      volumes[order[j]] = curve->volume[0] + scale * states[PV_STATE * j];
    }
    if (compliances != NULL) {
      compliances[order[j]] = scale * slope * states[PV_STATE * j + 1];
    }
  }
cleanup:
  free(states);
  free(x);
  free(order);
  return status;
}
