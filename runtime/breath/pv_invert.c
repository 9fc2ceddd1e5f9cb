/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A limb backwards: the pressure that holds a volume. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "runtime/breath/pv_internal.h"

/* A root that Newton's method seeks inside a shrinking bracket. */
typedef struct root {
  double low, high; /* pressures on either side */
  double miss;      /* |V - target| of the last pressure tried */
  bool found;
} root;

/* Judges the pressure just tried and moves on: a Newton step, or the bracket's middle where Newton
 * leaves the bracket or does not halve the miss. */
static void root_step(root *search, double target, double volume, double compliance, double within,
                      double *pressure) {
  const double miss = fabs(volume - target);
  double next = *pressure + (target - volume) / compliance;
  if (volume < target) {
    search->low = *pressure;
  } else {
    search->high = *pressure;
  }
  const bool inside = next >= search->low && next <= search->high;
  search->found = miss <= within || search->high - search->low <= 1e-15 * fabs(*pressure);
  if (!inside || (!search->found && miss > 0.5 * search->miss)) {
    next = search->found ? *pressure : search->low + 0.5 * (search->high - search->low);
  }
  search->miss = miss;
  *pressure = next;
}

static supine_status invert_check(const supine_pv_curve *curve, size_t count, const double *volumes,
                                  supine_error *error) {
  const supine_status status = supine_breath_curve_check(curve, error);
  if (status != SUPINE_OK) {
    return status;
  }
  for (size_t j = 0; j < count; ++j) {
    if (!(volumes[j] >= curve->volume[0] && volumes[j] <= curve->volume[1])) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "volume %g mL is outside the limb's range, %g to %g mL", volumes[j],
                              curve->volume[0], curve->volume[1]);
    }
  }
  return SUPINE_OK;
}

supine_status supine_breath_invert(const supine_pv_curve *curve, size_t count,
                                   const double *volumes, double *pressures, supine_error *error) {
  enum { STEPS_MAX = 200 };
  supine_status status = invert_check(curve, count, volumes, error);
  if (status != SUPINE_OK || count == 0) {
    return status;
  }
  const double span = curve->volume[1] - curve->volume[0];
  const double within = 1e-11 * span;
  root *search = calloc(count, sizeof *search);
  double *volume = calloc(count, sizeof *volume);
  double *compliance = calloc(count, sizeof *compliance);
  if (search == NULL || volume == NULL || compliance == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
    goto cleanup;
  }
  for (size_t j = 0; j < count; ++j) {
    search[j] = (root){curve->pressure[0], curve->pressure[1], HUGE_VAL, false};
    const double share = (volumes[j] - curve->volume[0]) / span;
    pressures[j] = (1.0 - share) * curve->pressure[0] + share * curve->pressure[1];
  }
  /* All pressures together, so that each step is one integration along the limb. */
  for (int step = 0, left = 1; left != 0; ++step) {
    status = step < STEPS_MAX
                 ? supine_breath_curve_evaluate(curve, count, pressures, volume, compliance, error)
                 : supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                    "no pressure found for a volume of the limb");
    if (status != SUPINE_OK) {
      goto cleanup;
    }
    left = 0;
    for (size_t j = 0; j < count; ++j) {
      if (!search[j].found) {
        root_step(&search[j], volumes[j], volume[j], compliance[j], within, &pressures[j]);
        left |= !search[j].found;
      }
    }
  }
cleanup:
  free(compliance);
  free(volume);
  free(search);
  return status;
}
