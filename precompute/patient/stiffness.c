/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Smooth regions of stiffness over a lung. */
#include <math.h>

#include "precompute/patient/stiffness.h"

double supine_patient_mode_at(const supine_patient_mode *mode, const double point[3],
                              double *slope) {
  double square = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    square += (point[k] - mode->centre[k]) * (point[k] - mode->centre[k]);
  }
  const double q = fmin(1.0, fmax(0.0, 2.0 - 2.0 * sqrt(square) / mode->radius));
  if (slope != NULL) {
    *slope = -12.0 * q * (1.0 - q);
  }
  return q * q * (3.0 - 2.0 * q);
}

size_t supine_patient_side_of(const supine_lungs *lungs, size_t vertex) {
  const size_t lung = lungs->lung_count == 2 && vertex >= lungs->lung_begin[1] ? 1 : 0;
  return lungs->side[lung] > 0 ? 0 : 1;
}

void supine_patient_stiffness_of(const supine_patient_stiffness *stiffness,
                                 const supine_lungs *lungs, double *e) {
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    const size_t side = supine_patient_side_of(lungs, i);
    double sum = 0.0;
    for (size_t k = 0; k < stiffness->count[side]; ++k) {
      const supine_patient_mode *mode = &stiffness->mode[side][k];
      sum += mode->value * supine_patient_mode_at(mode, lungs->mesh.vertices + 3 * i, NULL);
    }
    e[i] = exp(sum);
  }
}
