/* SPDX-License-Identifier: MIT */
/* Find the direction of gravity in a posture, an orientation or a tilt. */
#include <math.h>
#include <string.h>

#include <supine/posture.h>

#include "base/vec3.h"
#include "runtime/words.h"

static const struct {
  const char *name;
  double gravity[3];
} postures[] = {
    {"supine", {0, 1, 0}},       {"prone", {0, -1, 0}},         {"left", {1, 0, 0}},
    {"right", {-1, 0, 0}},       {"upright", {0, 0, -1}},       {"inverted", {0, 0, 1}},
    {"left-lateral", {1, 0, 0}}, {"right-lateral", {-1, 0, 0}}, {"HFS", {0, 1, 0}},
    {"FFS", {0, 1, 0}},          {"HFP", {0, -1, 0}},           {"FFP", {0, -1, 0}},
    {"HFDL", {1, 0, 0}},         {"FFDL", {1, 0, 0}},           {"HFDR", {-1, 0, 0}},
    {"FFDR", {-1, 0, 0}},
};

enum { POSTURES = sizeof postures / sizeof *postures };

supine_status supine_posture_gravity(const char *name, double gravity[3]) {
  for (size_t i = 0; i < POSTURES; ++i) {
    if (supine_words_same(name, postures[i].name)) {
      memcpy(gravity, postures[i].gravity, sizeof postures[i].gravity);
      return SUPINE_OK;
    }
  }
  return SUPINE_ERROR_ARGUMENT;
}

size_t supine_posture_count(void) {
  return POSTURES;
}

const char *supine_posture_name(size_t index) {
  return index < POSTURES ? postures[index].name : NULL;
}

const char *supine_posture_nearest(const char *name) {
  size_t best = 0;
  size_t fewest = supine_words_distance(name, postures[0].name);
  for (size_t i = 1; i < POSTURES; ++i) {
    const size_t edits = supine_words_distance(name, postures[i].name);
    if (edits < fewest) {
      fewest = edits;
      best = i;
    }
  }
  return postures[best].name;
}

supine_status supine_posture_quaternion(const double quaternion[4], double gravity[3]) {
  double largest = 0;
  for (int i = 0; i < 4; ++i) {
    if (!isfinite(quaternion[i])) {
      return SUPINE_ERROR_ARGUMENT;
    }
    largest = fmax(largest, fabs(quaternion[i]));
  }
  if (largest == 0) {
    return SUPINE_ERROR_ARGUMENT;
  }
  double q[4];
  double rotation[9]; /* scaled; in body axes, (0, 0, -1) of world axes is minus its third row */
  for (int i = 0; i < 4; ++i) {
    q[i] = quaternion[i] / largest;
  }
  supine_quaternion_matrix(q, rotation);
  const double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  for (int i = 0; i < 3; ++i) {
    gravity[i] = (0 - rotation[6 + i]) / square;
  }
  return SUPINE_OK;
}

supine_status supine_posture_tilt(const double gravity[3], double degrees, double tilted[3]) {
  if (!isfinite(degrees) || !isfinite(gravity[0]) || !isfinite(gravity[1]) ||
      !isfinite(gravity[2])) {
    return SUPINE_ERROR_ARGUMENT;
  }
  const double radians = remainder(degrees, 360) * (3.14159265358979323846 / 180);
  const double y = gravity[1];
  const double z = gravity[2];
  tilted[0] = gravity[0];
  tilted[1] = y * cos(radians) - z * sin(radians);
  tilted[2] = y * sin(radians) + z * cos(radians);
  return SUPINE_OK;
}
