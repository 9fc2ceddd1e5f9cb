/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The resting volume as a function of gravity. */
#include <math.h>

#include <supine/posture.h>

#include "precompute/physics/reference.h"
#include "sh/base/csv.h"

/* Where the shares come from, tissue included (gas + tissue over full gas + tissue):
 *
 *   upright  functional residual capacity 3.39 L of 7.21 L (GLI 2021, Hall et al., Eur Respir J 57:
 *            2000289, man of 45 years and 1.78 m) and 0.86 L of tissue (Denison 1986, Thorax
 *            41:620, n 12): 0.53
 *   supine   0.806 L (SD 0.293) below that (Lumb & Nimmo 1991, Anesth Analg 73:422, n 13): 0.43.
 *            With a third less tissue (rebreathing, 0.54 L) and of the supine full volume, 8 % less
 *            (Elliott 1994, J Appl Physiol 77:2005, n 4): 0.435; Elliott's own -32 %: 0.42
 *   prone, on either side  0.35 L above supine (Lumb & Nimmo; not told apart): 0.47
 *   head down  no volume in litres was found; end-expiratory volume follows the sine of a tilt feet
 *            down and is at or near its least when horizontal ("Effects of body tilting on
 *            respiratory mechanics", J Appl Physiol 1956): as supine, 0.43 */
supine_resting supine_reference_resting_default(void) {
  return (supine_resting){{0.47, 0.47, 0.43, 0.47, 0.43, 0.53}};
}

static const double least_share = 0.1; /* tissue alone */
static const double most_share = 1.0;

supine_status supine_reference_resting_set(supine_resting *resting, const char *posture,
                                           double share, supine_error *error) {
  double g[3];
  if (supine_posture_gravity(posture, g) != SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "no posture '%s' to rest in; did you mean '%s'?", posture,
                            supine_posture_nearest(posture));
  }
  if (!(share > least_share && share <= most_share)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%s at rest: a share of the full volume lies above %g and at most "
                            "at %g, not %g",
                            posture, least_share, most_share, share);
  }
  for (size_t k = 0; k < 3; ++k) {
    if (g[k] != 0.0) { /* named postures lie along the axes */
      resting->share[2 * k + (g[k] < 0.0)] = share;
    }
  }
  return SUPINE_OK;
}

supine_status supine_reference_resting_load(const char *path, supine_resting *resting,
                                            supine_error *error) {
  static const char *const columns[] = {"posture", "share"};
  supine_csv csv = {0};
  bool more = false;
  supine_status status = supine_csv_open(path, columns, 2, 2, &csv, error);
  while (status == SUPINE_OK && (status = supine_csv_next(&csv, &more, error)) == SUPINE_OK &&
         more) {
    double share = 0.0;
    supine_error inner = {0};
    status = supine_csv_number(&csv, 1, "share", &share, error);
    if (status == SUPINE_OK) {
      status = supine_reference_resting_set(resting, supine_csv_text(&csv, 0), share, &inner);
      if (status != SUPINE_OK) {
        (void)supine_error_set(error, status, "%s: line %zu: %s", path, csv.line, inner.message);
      }
    }
  }
  supine_csv_close(&csv);
  return status;
}

double supine_reference_along_axes(const double values[6], const double g[3]) {
  double value = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    const double odd = 0.5 * (values[2 * k] - values[2 * k + 1]);
    const double even = 0.5 * (values[2 * k] + values[2 * k + 1]);
    value += g[k] * (odd + even * g[k]);
  }
  return value;
}

/* With e the even parts, of mean m: sum of e_k g_k^2 = m + (e_z - m) (3 z^2 - 1) / 2 + (e_x - e_y)
 * / 2 (x^2 - y^2). The constants are those of Y at l <= 2. */
void supine_reference_harmonics(const double values[6], double harmonics[9]) {
  static const size_t axis_term[3] = {3, 1, 2}; /* of x, y, z: m = 1, -1, 0 */
  double even[3];
  for (size_t t = 0; t < 9; ++t) {
    harmonics[t] = 0.0;
  }
  for (size_t k = 0; k < 3; ++k) {
    even[k] = 0.5 * (values[2 * k] + values[2 * k + 1]);
    harmonics[axis_term[k]] = 0.5 * (values[2 * k] - values[2 * k + 1]) / (0.5 * sqrt(3.0 / M_PI));
  }
  const double mean = (even[0] + even[1] + even[2]) / 3.0;
  harmonics[0] = mean / (0.5 * sqrt(1.0 / M_PI));
  harmonics[6] = 0.5 * (even[2] - mean) / (0.25 * sqrt(5.0 / M_PI));
  harmonics[8] = 0.5 * (even[0] - even[1]) / (0.25 * sqrt(15.0 / M_PI));
}
