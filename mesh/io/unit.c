/* SPDX-License-Identifier: MIT */
/* Guess a file's unit from the size of its box. */
#include <math.h>

#include "mesh/mesh.h"

/* Range of the longest side of a box of lungs, infant to adult, and least of an adult's, mm. */
static const double side_least = 80.0;
static const double side_most = 700.0;
static const double side_typical = 280.0;

static bool is_lung(double side) {
  return side >= side_least && side <= side_most;
}

double supine_mesh_unit_check(double side, double millimetres, const char **likely) {
  static const struct {
    const char *name;
    double millimetres;
  } units[] = {{"mm", 1.0}, {"cm", 10.0}, {"m", 1000.0}, {"um", 0.001}, {"in", 25.4}};
  *likely = NULL;
  double nearest = INFINITY;
  for (size_t i = 0; i < sizeof units / sizeof *units; ++i) {
    const double other = side / millimetres * units[i].millimetres;
    const double distance = fabs(log(other / side_typical));
    if (!is_lung(side) && is_lung(other) && distance < nearest) {
      *likely = units[i].name;
      nearest = distance;
    }
  }
  return is_lung(side) ? 0.0 : side;
}
