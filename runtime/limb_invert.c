/* SPDX-License-Identifier: MIT */
/* Compute the pressure of a limb at a volume. */
#include <math.h>
#include <stdbool.h>

#include "runtime/limb.h"

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

supine_status supine_breath_invert(const supine_pv_curve *curve, size_t count,
                                   const double *volumes, double *pressures, supine_error *error) {
  supine_status status = supine_breath_curve_check(curve, error);
  if (status != SUPINE_OK || count == 0) {
    return status;
  }
  supine_limb limb;
  supine_limb_begin(curve, &limb);
  for (size_t j = 0; j < count && status == SUPINE_OK; ++j) {
    if (!(volumes[j] >= curve->volume[0] && volumes[j] <= curve->volume[1])) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "volume %g mL is outside the limb's range, %g to %g mL", volumes[j],
                              curve->volume[0], curve->volume[1]);
    }
    status = supine_limb_pressure(&limb, volumes[j], &pressures[j]);
    if (status != SUPINE_OK) {
      (void)supine_error_set(error, status, "no pressure found for %g mL on the limb", volumes[j]);
    }
  }
  return status;
}
