/* SPDX-License-Identifier: MIT */
/* Find the direction of gravity in a posture, an orientation, a tilt or a roll. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/inputs.h>
#include <supine/posture.h>

#include "base/arena.h"
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

/* Which of its own axes (1, 2, 3 for x, y, z, negative for the opposite direction) point to the
 * left, the back and the head of a body that is standing. */
static const struct {
  const char *name;
  signed char left, back, head;
} bodies[] = {{"lps", 1, 2, 3},
              {"unity", -1, -3, 2},
              {"unreal", -2, -1, 3},
              {"three", 1, -3, 2},
              {"headset", -1, 3, 2}};

enum { BODIES = sizeof bodies / sizeof *bodies };

static supine_status refuse_body(const char *name, supine_error *error) {
  char known[64] = "";
  size_t length = 0;
  for (size_t i = 0; i < BODIES; ++i) {
    length += (size_t)snprintf(known + length, sizeof known - length, " %s", bodies[i].name);
  }
  return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "no axes '%s': give one of%s", name, known);
}

/* Check that the `count` numbers are a rotation, and convert it to a matrix. */
static supine_status read_rotation(const double *rotation, size_t count, double matrix[9],
                                   supine_error *error) {
  SUPINE_REFUSE_IF(count != 4 && count != 9, error, SUPINE_ERROR_ARGUMENT,
                   "%zu numbers: give a quaternion of 4 or a matrix of 9", count);
  if (count == 4) {
    supine_quaternion_matrix(rotation, matrix);
  } else {
    memcpy(matrix, rotation, 9 * sizeof *matrix);
  }
  double scale = 0;
  const double strain = supine_matrix_strain(matrix, &scale);
  SUPINE_REFUSE_IF(!(strain <= SUPINE_ROTATION_TOLERANCE) ||
                       !(fabs(scale - 1) <= SUPINE_ROTATION_TOLERANCE),
                   error, SUPINE_ERROR_ARGUMENT,
                   "not a rotation: scale %.4g instead of 1%s, shear %.4g instead of 0. Normalise "
                   "the quaternion, or give the matrix without its scale",
                   scale, scale < 0 ? " (mirrored)" : "", strain);
  return SUPINE_OK;
}

supine_status supine_posture_rotation(const double *rotation, size_t count, const double up[3],
                                      const char *axes, double gravity[3], supine_error *error) {
  size_t body = 0;
  while (body < BODIES && !supine_words_same(axes, bodies[body].name)) {
    ++body;
  }
  if (body == BODIES) {
    return refuse_body(axes, error);
  }
  double matrix[9];
  double high[3];
  SUPINE_TRY(read_rotation(rotation, count, matrix, error));
  const bool has_up = supine_normalise(up, high);
  SUPINE_REFUSE_IF(!has_up, error, SUPINE_ERROR_ARGUMENT,
                   "up is zero or not finite: give a direction");
  const signed char axis[3] = {bodies[body].left, bodies[body].back, bodies[body].head};
  for (int i = 0; i < 3; ++i) {
    const int k = abs(axis[i]) - 1;
    const double along = matrix[k] * high[0] + matrix[3 + k] * high[1] + matrix[6 + k] * high[2];
    gravity[i] = axis[i] > 0 ? 0 - along : along;
  }
  (void)supine_normalise(gravity, gravity); /* the rotation may be rounded */
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
