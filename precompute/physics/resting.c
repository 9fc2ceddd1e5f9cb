/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute volumes at rest and at full inflation as functions of gravity. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/posture.h>

#include "precompute/physics/resting.h"

#include "base/arena.h"
#include "base/number.h"
#include "base/quantity.h"
#include "base/remedy.h"
#include "base/text.h"

/* Volumes at rest of healthy people divided by the volume at full inflation supine, both with
 * tissue. Rows: left lung, right lung. Columns: lying on the left, on the right, supine, prone,
 * head down, upright. Sources of the supine share of both lungs, 0.48:
 *
 *   0.473     (3.39 - 0.806 + 0.86 L) / (7.21 L / 1.109 + 0.86 L): FRC and TLC of a man of 45
 *             years, 1.78 m (GLI: Hall, Eur Respir J 57, 2021); 0.502 from (3.39 + 0.86 L) / 1.15
 *   0.484     (SD 0.038) FRC 2.7 L and TLC 6.5 L of the same people, supine; not found
 *   0.40      density at TLC / at FRC, n 10 (MRI: Theilmann, J Magn Reson Imaging 30, 2009)
 *   0.53-0.60 if scans hold 90 to 80 % of TLC, which skews the spread upwards; TLC by CT was 5.34,
 *             by plethysmography 6.46 L in COPD, n 59 (PMC3292389)
 *
 * Prone and on either side: FRC + 0.35 L, one figure for all three, n 13 (Lumb & Nimmo 1991).
 * Upright: + 15 %; lobes at expiration + 5.3 to 14.7 %, n 100 (Yamada, Sci Rep 10, 2020), FRC +
 * 0.806 L (Lumb & Nimmo). Head down: as supine, because no volume in litres was found. Left to
 * right lung: a table after Svanberg 1957 (not found), except the left lung when lying on the
 * right: 0.629 gives the lower lung its share of a breath; that table gives (2.07 + 0.43) / (1.39 +
 * 0.43) x 0.467 = 0.642. */
static const supine_resting usual = {.share = {{0.462, 0.629, 0.467, 0.519, 0.467, 0.538},
                                               {0.610, 0.486, 0.492, 0.531, 0.492, 0.566}},
                                     .assumed = SUPINE_REST_SHARE,
                                     .spread = SUPINE_REST_SPREAD};

/* Limits of (volume at rest) / (volume at full inflation). Without gas, this ratio is 0.1. */
static const double least_share = 0.1;
static const double most_share = 1.0;

supine_resting supine_physics_resting_default(void) {
  return usual;
}

static bool is_share(double share) {
  return share > least_share && share <= most_share;
}

/* Return the volume at rest in a posture, in the unit of `full` [count], volumes at full
 * inflation. */
static double at_rest(const supine_resting *resting, size_t axis, size_t count, const int *side,
                      const double *full) {
  double rest = 0.0;
  for (size_t lung = 0; lung < count; ++lung) {
    rest += full[lung] * resting->share[side[lung] < 0][axis];
  }
  return rest;
}

static const int sides[2] = {1, -1};
static const double parts[2] = {SUPINE_LEFT_SHARE, 1.0 - SUPINE_LEFT_SHARE};

/* Read the volume at rest with gravity along an axis: a share of the full volume of both lungs
 * ("0.48") or of the left and the right lung ("0.47/0.49"), or mL of both lungs ("2600mL"). Return
 * false if the text has another form or is out of range. */
static bool read_value(supine_resting *resting, size_t axis, const char *text) {
  double first = 0.0;
  bool in_ml = false;
  const char *end = supine_quantity_read(text, SUPINE_QUANTITY_VOLUME, &first, &in_ml);
  double share[2] = {first, first};
  if (end == NULL) {
    return false;
  }
  resting->given[axis] = true;
  if (in_ml) {
    resting->ml[axis] = first;
    return *end == '\0' && first > 0.0;
  }
  if (*end == '/') {
    end = supine_quantity_read(end + 1, SUPINE_QUANTITY_NUMBER, &share[1], &in_ml);
    if (end == NULL) {
      return false;
    }
  } else {
    const double both = at_rest(&usual, axis, 2, sides, parts);
    share[0] *= usual.share[0][axis] / both;
    share[1] *= usual.share[1][axis] / both;
  }
  resting->share[0][axis] = share[0];
  resting->share[1][axis] = share[1];
  resting->ml[axis] = 0.0;
  return *end == '\0' && is_share(first) && is_share(share[0]) && is_share(share[1]);
}

/* Read the volume at rest into each axis along which gravity has a component. */
static bool read_values(supine_resting *resting, const double gravity[3], const char *text) {
  bool read = true;
  for (size_t k = 0; k < 3; ++k) {
    if (gravity[k] != 0.0) {
      read = read_value(resting, 2 * k + (gravity[k] < 0.0), text) && read;
    }
  }
  return read;
}

bool supine_physics_resting_given(const supine_resting *resting) {
  static const bool none[6] = {false};
  return memcmp(resting->given, none, sizeof none) != 0;
}

supine_status supine_physics_resting_set(supine_resting *resting, const char *posture,
                                         const char *value, supine_error *error) {
  double g[3];
  supine_resting set = *resting;
  if (strcmp(posture, "copd") == 0) {
    set.assumed = SUPINE_COPD_SHARE;
    set.spread = SUPINE_COPD_SPREAD;
  } else if (supine_posture_gravity(posture, g) != SUPINE_OK) {
    char suggestion[64];
    supine_text_suggest("", supine_posture_nearest(posture), suggestion, sizeof suggestion);
    return supine_error_set(
        error, SUPINE_ERROR_ARGUMENT,
        "'%s' is not a posture (supine, prone, left, right, upright, inverted)%s", posture,
        suggestion);
  }
  if (value != NULL) {
    const bool read = read_values(&set, g, value);
    SUPINE_REFUSE_IF(
        !read, error, SUPINE_ERROR_ARGUMENT,
        "%s=%s: give a share of the full volume above %g and at most %g (0.48, or 0.47/0.49 for "
        "the left and the right lung) or a volume of gas and tissue (2600mL)",
        posture, value, least_share, most_share);
  }
  *resting = set;
  return supine_physics_resting_settle(resting, 0, NULL, NULL, error);
}

const char *const supine_physics_resting_names[SUPINE_RESTING_POSTURES + 1] = {
    "left", "right", "supine", "prone", "inverted", "upright", NULL};

supine_status supine_physics_resting_give(supine_resting *resting, size_t axis, double ml,
                                          const double share[2], supine_error *error) {
  double parts_of[2] = {share[0], share[1]};
  if (share[1] == 0.0) {
    const double both = at_rest(&usual, axis, 2, sides, parts);
    parts_of[0] = share[0] * usual.share[0][axis] / both;
    parts_of[1] = share[0] * usual.share[1][axis] / both;
  }
  const bool shares_fit = is_share(share[0]) && is_share(parts_of[0]) && is_share(parts_of[1]);
  const bool fits = ml != 0.0 ? ml > 0.0 && isfinite(ml) : shares_fit;
  SUPINE_REFUSE_IF(!fits, error, SUPINE_ERROR_ARGUMENT,
                   "volume at rest in posture %s: give a volume of gas and tissue in mL, or shares "
                   "of the full volume above %g and at most %g",
                   supine_physics_resting_names[axis], least_share, most_share);
  resting->given[axis] = true;
  resting->ml[axis] = ml;
  if (ml == 0.0) {
    resting->share[0][axis] = parts_of[0];
    resting->share[1][axis] = parts_of[1];
  }
  return supine_physics_resting_settle(resting, 0, NULL, NULL, error);
}

void supine_physics_resting_print(const supine_resting *resting, char *text, size_t size) {
  text[0] = '\0';
  for (size_t axis = 0; axis < 6; ++axis) {
    supine_text_add(text, size, "%s%s=%.4g/%.4g", axis == 0 ? "" : ",",
                    supine_physics_resting_names[axis], resting->share[0][axis],
                    resting->share[1][axis]);
  }
}

supine_status supine_physics_resting_settle(supine_resting *resting, size_t count, const int *side,
                                            const double *full, supine_error *error) {
  const bool relative = full == NULL;
  double factor[6]; /* [posture] (known volume) / (default volume), or 0 */
  double sum = 0.0;
  double known = 0.0;
  count = relative ? 2 : count;
  side = relative ? sides : side;
  full = relative ? parts : full;
  for (size_t axis = 0; axis < 6; ++axis) {
    double rest = 0.0;
    if (resting->ml[axis] > 0.0) {
      rest = relative ? 0.0 : resting->ml[axis];
    } else if (resting->given[axis]) {
      rest = at_rest(resting, axis, count, side, full);
    }
    factor[axis] = rest / at_rest(&usual, axis, count, side, full);
    sum += factor[axis];
    known += factor[axis] > 0.0 ? 1.0 : 0.0;
  }
  const double others = known > 0.0 ? sum / known : resting->assumed / SUPINE_REST_SHARE;
  for (size_t axis = 0; axis < 6; ++axis) {
    bool fits = true;
    for (size_t k = 0; k < 2; ++k) {
      double *share = &resting->share[k][axis];
      if (factor[axis] == 0.0) {
        *share = fmin(usual.share[k][axis] * others, most_share);
      } else if (resting->ml[axis] > 0.0) {
        *share = usual.share[k][axis] * factor[axis];
      }
      fits = fits && is_share(*share);
    }
    const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
        supine_remedy_such_as("scanned", "supine:rest", "if the scan was not at full inflation"),
        supine_remedy_change("resting", "")};
    SUPINE_REFUSE_ADVISE(!relative && !fits, error, advice, SUPINE_ERROR_ARGUMENT,
                         "lungs with a full volume of %.0f mL do not hold %.0f mL at rest in "
                         "posture %s",
                         full[0] + (count > 1 ? full[1] : 0.0),
                         at_rest(resting, axis, count, side, full),
                         supine_physics_resting_names[axis]);
    resting->ml[axis] = relative ? resting->ml[axis] : 0.0;
  }
  return SUPINE_OK;
}

double supine_physics_resting_share(const supine_resting *resting, int side, const double g[3]) {
  return supine_physics_resting_along_axes(resting->share[side < 0], g);
}

double supine_physics_resting_total(const supine_resting *resting, const double g[3]) {
  return SUPINE_LEFT_SHARE * supine_physics_resting_along_axes(resting->share[0], g) +
         (1.0 - SUPINE_LEFT_SHARE) * supine_physics_resting_along_axes(resting->share[1], g);
}

double supine_physics_resting_full_share(const double g[3]) {
  const double up = fmax(0.0, -g[2]);
  return 1.0 + SUPINE_FULL_UPRIGHT_GAIN * up * up;
}

void supine_physics_resting_axis(size_t axis, double g[3]) {
  g[0] = 0.0;
  g[1] = 0.0;
  g[2] = 0.0;
  g[axis / 2] = axis % 2 == 0 ? 1.0 : -1.0;
}

double supine_physics_resting_along_axes(const double values[6], const double g[3]) {
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
void supine_physics_resting_harmonics(const double values[6], double harmonics[9]) {
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
