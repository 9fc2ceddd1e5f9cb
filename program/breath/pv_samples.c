/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Check the samples of a limb, and name the one at fault. */
#include <math.h>

#include "program/breath/pv_internal.h"

/* Report sample j of the caller's order: "FILE:LINE: " or "samples: sample 3: ", then the
 * reason. */
static supine_status sample_fail(const pv_origin *origin, size_t j, supine_error *error,
                                 const char *why) {
  const char *name = origin->name != NULL ? origin->name : "samples";
  if (origin->lines != NULL) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT, "%.200s:%zu: %s", name, origin->lines[j],
                            why);
  }
  return supine_error_set(error, SUPINE_ERROR_FORMAT, "%.200s: sample %zu: %s", name, j + 1, why);
}

static supine_status sample_fail_fall(const pv_origin *origin, size_t j, double greater,
                                      supine_error *error) {
  char why[160];
  (void)snprintf(why, sizeof why,
                 "volume %g mL where a lower pressure already has %g mL: volume must rise with "
                 "pressure, but for noise",
                 origin->volumes[j], greater);
  return sample_fail(origin, j, error, why);
}

supine_status supine_breath_samples_check(const pv_origin *origin, supine_error *error) {
  const char *name = origin->name != NULL ? origin->name : "samples";
  if (origin->count <= SUPINE_PV_UNKNOWNS) {
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: %zu samples in a limb are too few for %d unknowns: give at least %d", name,
        origin->count, (int)SUPINE_PV_UNKNOWNS, (int)SUPINE_PV_UNKNOWNS + 1);
  }
  const double *p = origin->pressures;
  for (size_t j = 0; j < origin->count; ++j) {
    if (!isfinite(p[j]) || !isfinite(origin->volumes[j])) {
      return sample_fail(origin, j, error, "pressure or volume is not finite: remove the sample");
    }
  }
  for (size_t j = 1; j < origin->count; ++j) {
    if (p[j] == p[j - 1]) {
      return sample_fail(origin, j, error,
                         "the pressure repeats the one before: keep one of the samples, or "
                         "their mean");
    }
    if ((p[j] > p[j - 1]) != (p[1] > p[0])) {
      return sample_fail(origin, j, error,
                         "pressure turns back: within a limb it must keep rising or keep falling; "
                         "sort the samples, or name the limbs in a column \"limb\"");
    }
  }
  const size_t last = origin->count - 1;
  const size_t low = p[0] < p[last] ? 0 : last;
  if (!(origin->volumes[last - low] > origin->volumes[low])) {
    return sample_fail_fall(origin, last - low, origin->volumes[low], error);
  }
  return SUPINE_OK;
}

void supine_breath_samples_range(const pv_origin *origin, supine_pv_curve *curve, double *span) {
  const size_t last = origin->count - 1;
  const size_t low = origin->pressures[0] < origin->pressures[last] ? 0 : last;
  double least = origin->volumes[0];
  double greatest = origin->volumes[0];
  for (size_t j = 1; j <= last; ++j) {
    least = fmin(least, origin->volumes[j]);
    greatest = fmax(greatest, origin->volumes[j]);
  }
  curve->pressure[0] = origin->pressures[low];
  curve->pressure[1] = origin->pressures[last - low];
  curve->volume[0] = origin->volumes[low];
  curve->volume[1] = origin->volumes[last - low];
  *span = greatest - least;
}

supine_status supine_breath_check_falls(const pv_origin *origin, const double *v, double allowed,
                                        supine_error *error) {
  const size_t last = origin->count - 1;
  const bool falling = origin->pressures[last] < origin->pressures[0];
  double peak = v[0];
  size_t seen = falling ? last : 0; /* which sample that is */
  for (size_t j = 1; j <= last; ++j) {
    /* Predict the rise of this step from the samples on either side. */
    const size_t before = j >= 2 ? j - 2 : 0;
    const size_t after = j < last ? j + 1 : last;
    const double expected = fmax(0.0, (v[after] - v[before]) / (double)(after - before));
    const bool back = v[j] < v[j - 1] && v[j - 1] - v[j] + expected > allowed;
    if (back || peak - v[j] > allowed) {
      return sample_fail_fall(origin, falling ? last - j : j, origin->volumes[seen], error);
    }
    if (v[j] > peak) {
      peak = v[j];
      seen = falling ? last - j : j;
    }
  }
  return SUPINE_OK;
}
