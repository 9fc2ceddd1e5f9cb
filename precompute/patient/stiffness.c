/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Smooth regions of expandability in a lung. */
#include <math.h>
#include <string.h>

#include "precompute/patient/stiffness.h"

#include "sh/base/vec3.h"

static const double apart = 35.0;      /* largest distance of a vertex from a centre, mm */
static const double overlapping = 1.5; /* radius over that distance */

enum { LOOKED_AT = 8192 }; /* most vertices considered as centres */

static double weight_at(const supine_patient_mode *mode, const double point[3]) {
  const double t = supine_distance(mode->centre, point) / mode->radius;
  const double q = fmin(1.0, fmax(0.0, 2.0 - 2.0 * t));
  return q * q * (3.0 - 2.0 * q);
}

size_t supine_patient_side_of(const supine_lungs *lungs, size_t vertex) {
  const size_t lung = lungs->lung_count == 2 && vertex >= lungs->lung_begin[1] ? 1 : 0;
  return lungs->side[lung] > 0 ? 0 : 1;
}

/* Find the vertex of a side farthest from the side's centres, and its distance, mm. */
static size_t farthest(const supine_lungs *lungs, const supine_patient_stiffness *stiffness,
                       size_t side, double *distance) {
  size_t found = 0;
  const size_t step = lungs->mesh.vertex_count / LOOKED_AT + 1;
  *distance = 0.0;
  for (size_t i = 0; i < lungs->mesh.vertex_count; i += step) {
    double nearest = INFINITY;
    for (size_t k = 0; k < stiffness->count[side]; ++k) {
      nearest = fmin(
          nearest, supine_distance(stiffness->mode[side][k].centre, lungs->mesh.vertices + 3 * i));
    }
    if (supine_patient_side_of(lungs, i) == side && nearest > *distance) {
      *distance = nearest;
      found = i;
    }
  }
  return found;
}

void supine_patient_stiffness_spread(const supine_lungs *lungs,
                                     supine_patient_stiffness *stiffness) {
  *stiffness = (supine_patient_stiffness){0};
  for (size_t side = 0; side < 2; ++side) {
    double distance;
    size_t vertex = farthest(lungs, stiffness, side, &distance);
    while (distance > apart && stiffness->count[side] < SUPINE_PATIENT_MODES) {
      supine_patient_mode *mode = &stiffness->mode[side][stiffness->count[side]++];
      mode->value = 1.0;
      memcpy(mode->centre, lungs->mesh.vertices + 3 * vertex, sizeof mode->centre);
      vertex = farthest(lungs, stiffness, side, &distance);
    }
    for (size_t k = 0; k < stiffness->count[side]; ++k) {
      stiffness->mode[side][k].radius = overlapping * distance;
    }
  }
}

void supine_patient_stiffness_shares(const supine_patient_stiffness *stiffness, size_t side,
                                     const double point[3], double *shares) {
  const supine_patient_mode *mode = stiffness->mode[side];
  const size_t count = stiffness->count[side];
  double sum = 0.0;
  size_t nearest = 0;
  for (size_t k = 0; k < count; ++k) {
    shares[k] = weight_at(&mode[k], point);
    sum += shares[k];
    nearest = supine_distance(mode[k].centre, point) < supine_distance(mode[nearest].centre, point)
                  ? k
                  : nearest;
  }
  for (size_t k = 0; k < count; ++k) {
    shares[k] = sum > 0.0 ? shares[k] / sum : (double)(k == nearest);
  }
}

void supine_patient_stiffness_of(const supine_patient_stiffness *stiffness,
                                 const supine_lungs *lungs, double *e) {
  double shares[SUPINE_PATIENT_MODES];
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    const size_t side = supine_patient_side_of(lungs, i);
    double a = stiffness->count[side] == 0 ? 1.0 : 0.0;
    supine_patient_stiffness_shares(stiffness, side, lungs->mesh.vertices + 3 * i, shares);
    for (size_t k = 0; k < stiffness->count[side]; ++k) {
      a += stiffness->mode[side][k].value * shares[k];
    }
    e[i] = 1.0 / a;
  }
}
