/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Spread smooth regions of expandability over each lung. */
#include <math.h>
#include <string.h>

#include "precompute/patient/matching.h"

#include "sh/base/vec3.h"

static const double apart = 35.0; /* largest distance of a vertex from the nearest centre, mm */
static const double overlapping = 1.5; /* radius of a region over that distance */

enum { LOOKED_AT = 8192 }; /* most vertices considered as centres */

/* Find the vertex of a side farthest from the regions, and its distance, mm. */
static size_t farthest(const supine_lungs *lungs, const supine_patient_stiffness *stiffness,
                       int side, double *distance) {
  size_t found = 0;
  const size_t step = lungs->mesh.vertex_count / LOOKED_AT + 1;
  *distance = 0.0;
  for (size_t i = 0; i < lungs->mesh.vertex_count; i += step) {
    double nearest = supine_patient_side_of(lungs, i) == side ? INFINITY : 0.0;
    for (size_t k = 0; k < stiffness->count; ++k) {
      if (stiffness->mode[k].side == side) {
        nearest =
            fmin(nearest, supine_distance(stiffness->mode[k].centre, lungs->mesh.vertices + 3 * i));
      }
    }
    if (nearest > *distance) {
      *distance = nearest;
      found = i;
    }
  }
  return found;
}

void supine_patient_stiffness_spread(const supine_lungs *lungs,
                                     supine_patient_stiffness *stiffness) {
  *stiffness = (supine_patient_stiffness){0};
  for (int side = 1; side >= -1; side -= 2) {
    const size_t first = stiffness->count;
    double distance;
    size_t vertex = farthest(lungs, stiffness, side, &distance);
    while (distance > apart && stiffness->count - first < SUPINE_PATIENT_MODES / 2) {
      supine_patient_mode *mode = &stiffness->mode[stiffness->count++];
      *mode = (supine_patient_mode){.side = side, .value = 1.0};
      memcpy(mode->centre, lungs->mesh.vertices + 3 * vertex, sizeof mode->centre);
      vertex = farthest(lungs, stiffness, side, &distance);
    }
    for (size_t k = first; k < stiffness->count; ++k) {
      stiffness->mode[k].radius = overlapping * distance;
    }
  }
}

void supine_patient_stiffness_shares(const supine_patient_stiffness *stiffness,
                                     const supine_lungs *lungs, size_t vertex, double *shares) {
  const double *point = lungs->mesh.vertices + 3 * vertex;
  const int side = supine_patient_side_of(lungs, vertex);
  double sum = 0.0;
  double least = INFINITY;
  size_t nearest = 0;
  for (size_t k = 0; k < stiffness->count; ++k) {
    const supine_patient_mode *mode = &stiffness->mode[k];
    const double distance = mode->side == side ? supine_distance(mode->centre, point) : INFINITY;
    const double q = fmin(1.0, fmax(0.0, 2.0 - 2.0 * distance / mode->radius));
    shares[k] = q * q * (3.0 - 2.0 * q);
    sum += shares[k];
    nearest = distance < least ? k : nearest;
    least = fmin(least, distance);
  }
  for (size_t k = 0; k < stiffness->count; ++k) {
    shares[k] = sum > 0.0 ? shares[k] / sum : (double)(k == nearest);
  }
}

void supine_patient_stiffness_of(const supine_patient_stiffness *stiffness,
                                 const supine_lungs *lungs, double *e) {
  double shares[SUPINE_PATIENT_MODES];
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    double a = stiffness->count == 0 ? 1.0 : 0.0;
    supine_patient_stiffness_shares(stiffness, lungs, i, shares);
    for (size_t k = 0; k < stiffness->count; ++k) {
      a += stiffness->mode[k].value * shares[k];
    }
    e[i] = 1.0 / a;
  }
}
