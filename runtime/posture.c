/* SPDX-License-Identifier: MIT */
/* Find the direction of gravity in a posture, an orientation, a tilt or a roll. */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include <supine/inputs.h>
#include <supine/posture.h>

#include "base/vec3.h"
#include "runtime/words.h"

static const struct {
  const char *name;
  double gravity[3];
} postures[] = {
    {"supine", {0, 1, 0}},       {"prone", {0, -1, 0}},
    {"left", {1, 0, 0}},         {"right", {-1, 0, 0}},
    {"upright", {0, 0, -1}},     {"inverted", {0, 0, 1}},
    {"left-lateral", {1, 0, 0}}, {"right-lateral", {-1, 0, 0}},
    {"HFS", {0, 1, 0}},          {"FFS", {0, 1, 0}},
    {"HFP", {0, -1, 0}},         {"FFP", {0, -1, 0}},
    {"HFDL", {1, 0, 0}},         {"FFDL", {1, 0, 0}},
    {"HFDR", {-1, 0, 0}},        {"FFDR", {-1, 0, 0}},
    {"LFP", {0, -1, 0}},         {"LFS", {0, 1, 0}},
    {"RFP", {0, -1, 0}},         {"RFS", {0, 1, 0}},
    {"AFDR", {-1, 0, 0}},        {"AFDL", {1, 0, 0}},
    {"PFDR", {-1, 0, 0}},        {"PFDL", {1, 0, 0}},
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
  static const struct {
    const char *word;
    const char *name;
  } meant[] = {{"sitting", "upright"}, {"standing", "upright"}, {"erect", "upright"}};
  for (size_t i = 0; i < sizeof meant / sizeof *meant; ++i) {
    if (supine_words_same(name, meant[i].word)) {
      return meant[i].name;
    }
  }
  const char *best = NULL;
  size_t fewest = 0;
  for (size_t i = 0; i < POSTURES; ++i) {
    const size_t edits = supine_words_distance(name, postures[i].name);
    const bool is_close = supine_words_close(name, postures[i].name);
    if (is_close && (best == NULL || edits < fewest)) {
      fewest = edits;
      best = postures[i].name;
    }
  }
  return best;
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

static const double degree = 3.14159265358979323846 / 180;

/* Return whether gravity is finite, and the table of checks takes the angle, in degrees. */
static bool takes_angle(const double gravity[3], double degrees, supine_input_id check) {
  return isfinite(gravity[0]) && isfinite(gravity[1]) && isfinite(gravity[2]) &&
         supine_input_judge(check, fabs(degrees)) != SUPINE_INPUT_REFUSED;
}

supine_status supine_posture_tilt(const double gravity[3], double degrees, double tilted[3]) {
  if (!takes_angle(gravity, degrees, SUPINE_INPUT_TILT)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  const double level = hypot(gravity[0], gravity[1]);
  const double x = level > 0 ? gravity[0] / level : 0;
  const double y = level > 0 ? gravity[1] / level : 1; /* upright bodies lean back */
  const double z = gravity[2];
  const double c = cos(degrees * degree);
  const double s = sin(degrees * degree);
  const double across = level * c - z * s;
  tilted[0] = x * across;
  tilted[1] = y * across;
  tilted[2] = level * s + z * c;
  return SUPINE_OK;
}

supine_status supine_posture_roll(const double gravity[3], double degrees, double rolled[3]) {
  if (!takes_angle(gravity, degrees, SUPINE_INPUT_ROLL)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  const double c = cos(degrees * degree);
  const double s = sin(degrees * degree);
  const double x = gravity[0];
  const double y = gravity[1];
  rolled[0] = x * c + y * s;
  rolled[1] = y * c - x * s;
  rolled[2] = gravity[2];
  return SUPINE_OK;
}
