/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute volumes at rest and at full inflation as functions of gravity. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/posture.h>

#include "precompute/physics/resting.h"

/* Volumes at rest of healthy people divided by the volume at full inflation, all with tissue.
 * Rows: left lung, right lung. Columns: lying on the left, on the right, supine, prone, head down,
 * upright. Sources, for both lungs together:
 *
 *   supine     0.43 = (3.39 L - 0.806 L + 0.86 L) / (7.21 L + 0.86 L)
 *              3.39, 7.21  functional residual and total lung capacity upright, man of 45 years,
 *                          1.78 m (GLI 2021, Hall et al., Eur Respir J 57)
 *              0.806       decrease of the functional residual capacity from upright to supine
 *                          (SD 0.293; Lumb & Nimmo 1991, Anesth Analg 73:422, 13 people)
 *              0.86        tissue (Denison 1986, Thorax 41:620, 12 people)
 *   prone, on either side   0.47, 0.35 L above supine (Lumb & Nimmo; one figure for all three)
 *   upright    15 % above supine (Yamada 2020, Sci Rep 10, 100 people: 3.2 L seated, 2.7 L supine)
 *   head down  set to the value of supine, because no volume in litres was found. From upright to
 *              horizontal, end-expiratory volume falls nearly to its minimum, as sine of the tilt
 *              ("Effects of body tilting on respiratory mechanics", J Appl Physiol 1956)
 *
 * The ratio of the left to the right lung's share is from a table after Svanberg 1957. The only
 * exception is 0.563, the left lung when lying on the right. No source was found for it; it follows
 * from the lower lung's share of a breath in that posture. */
static const supine_resting usual = {.share = {{0.413, 0.563, 0.418, 0.464, 0.418, 0.481},
                                               {0.546, 0.435, 0.440, 0.475, 0.440, 0.506}}};

/* Limits of (volume at rest) / (volume at full inflation). Without gas, this ratio is 0.1. */
static const double least_share = 0.1;
static const double most_share = 1.0;

supine_resting supine_reference_resting_default(void) {
  return usual;
}

static bool is_share(double share) {
  return share > least_share && share <= most_share;
}

/* Read the volume at rest with gravity along an axis: a share of the full volume of both lungs
 * ("0.43") or of the left and the right lung ("0.42/0.44"), or mL of both lungs ("2600mL"). Return
 * false if the text has another form or is out of range. */
static bool read_value(supine_resting *resting, size_t axis, const char *text) {
  char *end = NULL;
  const double first = strtod(text, &end);
  double share[2] = {first, first};
  if (end == text) {
    return false;
  }
  if (strcmp(end, "mL") == 0) {
    resting->ml[axis] = first;
    return first > 0.0 && isfinite(first);
  }
  if (*end == '/') {
    const char *second = end + 1;
    share[1] = strtod(second, &end);
    if (end == second) {
      return false;
    }
  } else {
    const double both =
        SUPINE_LEFT_SHARE * usual.share[0][axis] + (1.0 - SUPINE_LEFT_SHARE) * usual.share[1][axis];
    share[0] *= usual.share[0][axis] / both;
    share[1] *= usual.share[1][axis] / both;
  }
  resting->share[0][axis] = share[0];
  resting->share[1][axis] = share[1];
  resting->ml[axis] = 0.0;
  return *end == '\0' && is_share(first) && is_share(share[0]) && is_share(share[1]);
}

supine_status supine_reference_resting_set(supine_resting *resting, const char *posture,
                                           const char *value, supine_error *error) {
  double g[3];
  supine_resting set = *resting;
  if (supine_posture_gravity(posture, g) != SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "'%s' is not a posture; did you mean '%s'?", posture,
                            supine_posture_nearest(posture));
  }
  for (size_t k = 0; k < 3; ++k) {
    if (g[k] != 0.0 && !read_value(&set, 2 * k + (g[k] < 0.0), value)) {
      return supine_error_set(
          error, SUPINE_ERROR_ARGUMENT,
          "%s=%s: give a share of the full volume above %g and at most %g (0.43, or "
          "0.42/0.44 for the left and the right lung) or a volume of gas and tissue (2600mL)",
          posture, value, least_share, most_share);
    }
  }
  *resting = set;
  return SUPINE_OK;
}

static const char *const names[] = {"left", "right", "supine", "prone", "inverted", "upright"};

void supine_reference_resting_print(const supine_resting *resting, char *text, size_t size) {
  size_t used = 0;
  for (size_t axis = 0; axis < 6 && used < size; ++axis) {
    used += (size_t)snprintf(text + used, size - used, "%s%s=%.4g/%.4g", axis == 0 ? "" : ",",
                             names[axis], resting->share[0][axis], resting->share[1][axis]);
  }
}

supine_status supine_reference_resting_settle(supine_resting *resting, size_t count,
                                              const int *side, const double *full,
                                              supine_error *error) {
  double sum = 0.0; /* sum of (given volume) / (default volume) over all postures given in mL */
  size_t known = 0;
  for (size_t axis = 0; axis < 6; ++axis) {
    double rest = 0.0;
    for (size_t lung = 0; lung < count; ++lung) {
      rest += full[lung] * resting->share[side[lung] < 0][axis];
    }
    const double factor = resting->ml[axis] / rest;
    sum += factor;
    known += resting->ml[axis] > 0.0;
    for (size_t k = 0; k < 2 && resting->ml[axis] > 0.0; ++k) {
      resting->share[k][axis] *= factor;
      if (!is_share(resting->share[k][axis])) {
        return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                "lungs with a full volume of %.0f mL do not hold %.0f mL at rest "
                                "in posture %s: change --resting or --scanned",
                                full[0] + (count > 1 ? full[1] : 0.0), resting->ml[axis],
                                names[axis]);
      }
    }
  }
  for (size_t axis = 0; axis < 6 && known > 0; ++axis) {
    for (size_t k = 0; k < 2 && resting->ml[axis] == 0.0; ++k) {
      double *share = &resting->share[k][axis];
      if (*share == usual.share[k][axis]) {
        *share = fmin(*share * sum / (double)known, most_share);
      }
      if (!is_share(*share)) {
        return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                "--resting makes the volume at rest in posture %s less than that "
                                "of the tissue: give --resting for this posture too",
                                names[axis]);
      }
    }
    resting->ml[axis] = 0.0;
  }
  return SUPINE_OK;
}

double supine_reference_resting_share(const supine_resting *resting, int side, const double g[3]) {
  return supine_reference_along_axes(resting->share[side < 0], g);
}

double supine_reference_resting_total(const supine_resting *resting, const double g[3]) {
  return SUPINE_LEFT_SHARE * supine_reference_along_axes(resting->share[0], g) +
         (1.0 - SUPINE_LEFT_SHARE) * supine_reference_along_axes(resting->share[1], g);
}

double supine_reference_full_share(const double g[3]) {
  const double up = fmax(0.0, -g[2]);
  return 1.0 + SUPINE_FULL_UPRIGHT_GAIN * up * up;
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

/* At the unit vector (x, y, z), the interpolated value has linear and quadratic terms. Up to a
 * constant factor each, x, y and z are harmonics. If e_k is the mean of the values along +k and -k,
 * and m is the mean of e_x, e_y and e_z, the quadratic terms are
 *
 *     e_x x^2 + e_y y^2 + e_z z^2 = m + (e_z - m) (3 z^2 - 1) / 2 + (e_x - e_y) (x^2 - y^2) / 2
 *
 * Up to a constant factor each, 1, 3 z^2 - 1 and x^2 - y^2 are harmonics, too. */
void supine_reference_harmonics(const double values[6], double harmonics[9]) {
  static const size_t axis_term[3] = {3, 1, 2}; /* harmonics proportional to x, y and z */
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
