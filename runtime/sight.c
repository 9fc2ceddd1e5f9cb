/* SPDX-License-Identifier: MIT */
/* Lines of sight of observed points: what no view sees, and where the points may lie. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "runtime/kriging.h"
#include "runtime/sight.h"

/* Sources within this share of the length of their lines are one view, and lines within this angle,
 * rad, are parallel. */
static const double one_view = 0.01, parallel = 0.0175;

bool supine_sight_valid(const supine_observation *o) {
  double line = 0;
  double sum = 0;
  for (size_t k = 0; k < 3; ++k) {
    sum += o->position[k] + (o->on_line ? o->from[k] : 0);
    line += fabs(o->position[k] - o->from[k]);
  }
  return isfinite(sum) && (!o->on_line || line > 0);
}

size_t supine_sight_count(size_t count, const supine_observation *observed) {
  size_t different = 0;
  for (size_t j = 0; j < count; ++j) {
    size_t i = 0;
    while (observed[i].vertex != observed[j].vertex) {
      ++i;
    }
    different += i == j;
  }
  return different;
}

void supine_sight_direction(const supine_observation *o, double direction[3]) {
  double line[3];
  supine_subtract(o->position, o->from, line);
  const double length = sqrt(line[0] * line[0] + line[1] * line[1] + line[2] * line[2]);
  for (size_t k = 0; k < 3; ++k) {
    direction[k] = line[k] / length;
  }
}

bool supine_sight_unseen(size_t count, const supine_observation *observed, double axis[3]) {
  double apart = 0;
  double length = 0;
  double turned = 0;
  double first[3];
  double sum[3] = {0};
  memset(axis, 0, 3 * sizeof *axis);
  supine_sight_direction(observed, first);
  for (size_t j = 0; j < count; ++j) {
    const supine_observation *o = &observed[j];
    double direction[3];
    double away = 0;
    double line = 0;
    double turn = 0;
    if (!o->on_line) {
      return false;
    }
    supine_sight_direction(o, direction);
    for (size_t k = 0; k < 3; ++k) {
      sum[k] += direction[k];
      away += pow(o->from[k] - observed->from[k], 2);
      line += pow(o->position[k] - o->from[k], 2);
      turn += pow(direction[k] - first[k], 2);
    }
    apart = fmax(apart, sqrt(away));
    length += sqrt(line) / (double)count;
    turned = fmax(turned, sqrt(turn));
  }
  return (apart <= one_view * length || turned <= parallel) && supine_normalise(sum, axis);
}

/* Solve the normal equations for the translation that moves the predicted positions closest to the
 * points and lines, with its prior along `axis`. Return false if they leave it open. */
static bool find_translation(size_t count, const supine_observation *observed,
                             const double *predicted, const double axis[3], double depth,
                             double translation[3]) {
  double a[9] = {0};
  memset(translation, 0, 3 * sizeof *translation);
  for (size_t k = 0; k < 9; ++k) {
    a[k] = axis[k / 3] * axis[k % 3] / (depth * depth);
  }
  for (size_t j = 0; j < count; ++j) {
    double d[3] = {0, 0, 0};
    if (observed[j].on_line) {
      supine_sight_direction(&observed[j], d);
    }
    for (size_t k = 0; k < 9; ++k) {
      const double across = (k % 4 == 0 ? 1 : 0) - d[k / 3] * d[k % 3];
      a[k] += across;
      translation[k / 3] += across * (observed[j].position[k % 3] - predicted[3 * j + k % 3]);
    }
  }
  if (!supine_kriging_factor(3, a)) {
    return false;
  }
  supine_kriging_forward(3, a, translation);
  supine_kriging_backward(3, a, translation);
  return true;
}

void supine_sight_place(size_t count, const supine_observation *observed, const double *predicted,
                        const double axis[3], double depth, double *places) {
  double translation[3];
  if (!find_translation(count, observed, predicted, axis, depth, translation)) {
    memset(translation, 0, sizeof translation);
  }
  for (size_t j = 0; j < count; ++j) {
    const supine_observation *o = &observed[j];
    double along = 0;
    double d[3] = {0, 0, 0};
    if (o->on_line) {
      supine_sight_direction(o, d);
    }
    for (size_t k = 0; k < 3; ++k) {
      along += d[k] * (predicted[3 * j + k] + translation[k] - o->position[k]);
    }
    for (size_t k = 0; k < 3; ++k) {
      places[3 * j + k] = o->position[k] + along * d[k];
    }
  }
}
