/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Samples of a limb: whether they can be fitted, and which one is at fault where not. */
#include <math.h>

#include "pv_internal.h"

/* "FILE:LINE: " or "sample 3: ", of sample j in the caller's order. */
static supine_status sample_fail(const pv_origin *origin, size_t j, supine_error *error,
                                 const char *text, double value, double other, const char *remedy) {
  char where[256];
  const char *name = origin->name != NULL ? origin->name : "samples";
  if (origin->lines != NULL) {
    (void)snprintf(where, sizeof where, "%s:%zu", name, origin->lines[j]);
  } else {
    (void)snprintf(where, sizeof where, "%s: sample %zu", name, j + 1);
  }
  return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: %s %g after %g; %s", where, text, value,
                          other, remedy);
}

supine_status supine_pv_samples_check(const pv_origin *origin, supine_error *error) {
  const char *name = origin->name != NULL ? origin->name : "samples";
  if (origin->count <= SUPINE_PV_UNKNOWNS) {
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: %zu samples in a limb; a fit has %d unknowns and needs at least %d", name,
        origin->count, (int)SUPINE_PV_UNKNOWNS, (int)SUPINE_PV_UNKNOWNS + 1);
  }
  const double *p = origin->pressures;
  for (size_t j = 0; j < origin->count; ++j) {
    if (!isfinite(p[j]) || !isfinite(origin->volumes[j])) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: sample %zu is not finite", name,
                              j + 1);
    }
  }
  for (size_t j = 1; j < origin->count; ++j) {
    if (p[j] == p[j - 1]) {
      return sample_fail(origin, j, error, "pressure", p[j], p[j - 1],
                         "a repeated pressure: keep one sample of it, or their mean");
    }
    if ((p[j] > p[j - 1]) != (p[1] > p[0])) {
      return sample_fail(origin, j, error, "pressure", p[j], p[j - 1],
                         "pressures of a limb must keep rising or keep falling: sort them, or name "
                         "the limbs, inhale and exhale, in a column \"limb\"");
    }
  }
  return SUPINE_OK;
}

void supine_pv_samples_range(const pv_origin *origin, supine_pv_curve *curve, double *span) {
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

supine_status supine_pv_check_falls(const pv_origin *origin, const double *v, double allowed,
                                    supine_error *error) {
  const size_t last = origin->count - 1;
  const bool falling = origin->pressures[last] < origin->pressures[0];
  for (size_t j = 1; j <= last; ++j) {
    /* The rise that the samples on either side lead one to expect of this step. */
    const size_t before = j >= 2 ? j - 2 : 0;
    const size_t after = j < last ? j + 1 : last;
    const double expected = fmax(0.0, (v[after] - v[before]) / (double)(after - before));
    if (v[j] < v[j - 1] && v[j - 1] - v[j] + expected > allowed) {
      const size_t at = falling ? last - j : j;
      const size_t previous = falling ? at + 1 : at - 1;
      return sample_fail(origin, at, error, "volume", origin->volumes[at],
                         origin->volumes[previous],
                         "volume falls while pressure rises, by more than noise explains");
    }
  }
  return SUPINE_OK;
}
