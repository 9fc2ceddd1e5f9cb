/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The applied force (18), turned with gravity. */
#include <math.h>
#include <stddef.h>

#include "sh/base/vec3.h"

#include "precompute/physics/force.h"

static bool has_fixed_part(const supine_force_law *law) {
  return law->box[0] != 0.0 || law->box[1] != 0.0 || law->box[2] != 0.0;
}

static double fixed_part(const supine_lungs *lungs, const supine_force_law *law, size_t vertex) {
  double box[3];
  supine_lungs_box_coordinates(lungs, vertex, box);
  return supine_dot(law->box, box);
}

void supine_physics_force(const supine_lungs *lungs, const supine_force_law *law, const double g[3],
                          double minimum, double maximum, double *force) {
  const bool fixed = has_fixed_part(law);
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    const double h = (supine_dot(g, lungs->mesh.vertices + 3 * i) - minimum) / (maximum - minimum);
    force[i] = law->base + law->gain * h + (fixed ? fixed_part(lungs, law, i) : 0.0); /* (18) */
  }
}

void supine_physics_force_stiffness(const supine_lungs *lungs, const supine_force_law *law,
                                    const double *stiffness, const double g[3], double minimum,
                                    double maximum, double *softened) {
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    const double h = (supine_dot(g, lungs->mesh.vertices + 3 * i) - minimum) / (maximum - minimum);
    softened[i] = (stiffness == NULL ? 1.0 : stiffness[i]) * exp(-law->soften * (h - 0.5));
  }
}

size_t supine_physics_force_column_count(const supine_force_law *law) {
  return has_fixed_part(law) ? 5 : 4;
}

/* Centre and half diagonal of the box: positions in these units keep the columns well scaled. */
static double box_frame(const supine_lungs *lungs, double centre[3]) {
  double square = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double half = 0.5 * (lungs->maximum[k] - lungs->minimum[k]);
    centre[k] = lungs->minimum[k] + half;
    square += half * half;
  }
  return sqrt(square);
}

void supine_physics_force_columns(const supine_lungs *lungs, const supine_force_law *law,
                                  double *columns) {
  const size_t count = supine_physics_force_column_count(law);
  double centre[3];
  const double radius = box_frame(lungs, centre);
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    double *row = columns + i * count;
    row[0] = 1.0;
    for (size_t k = 0; k < 3; ++k) {
      row[1 + k] = (lungs->mesh.vertices[3 * i + k] - centre[k]) / radius;
    }
    if (count == 5) {
      row[4] = fixed_part(lungs, law, i);
    }
  }
}

void supine_physics_force_functions(const supine_lungs *lungs, const supine_force_law *law,
                                    const double g[3], double minimum, double maximum,
                                    double *functions) {
  double centre[3];
  const double radius = box_frame(lungs, centre);
  const double slope = law->gain / (maximum - minimum);
  functions[0] = law->base + slope * (supine_dot(g, centre) - minimum);
  for (size_t k = 0; k < 3; ++k) {
    functions[1 + k] = slope * radius * g[k];
  }
  if (has_fixed_part(law)) {
    functions[4] = 1.0;
  }
}
