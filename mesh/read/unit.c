/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Which unit a file is in, judged by the size of its box. */
#include <math.h>

#include "mesh/read/read.h"

/* Longest side of a box of one or two lungs, infant to adult; and of an adult lung. mm */
static const double side_least = 80.0;
static const double side_most = 700.0;
static const double side_typical = 280.0;

const char *supine_mesh_unit_likely(double longest_side) {
  static const struct {
    const char *name;
    double millimetres;
  } units[] = {{"m", 1000.0}, {"cm", 10.0}, {"inch", 25.4}, {"um", 0.001}};
  if (longest_side >= side_least && longest_side <= side_most) {
    return NULL;
  }
  const char *name = "unknown";
  double nearest = INFINITY;
  for (size_t i = 0; i < sizeof units / sizeof *units; ++i) {
    const double side = longest_side * units[i].millimetres;
    const double distance = fabs(log(side / side_typical));
    if (side >= side_least && side <= side_most && distance < nearest) {
      name = units[i].name;
      nearest = distance;
    }
  }
  return name;
}
