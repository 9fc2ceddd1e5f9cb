/* SPDX-License-Identifier: MIT */
/* Convert units of length, and guess a file's unit from the size of its bounding box. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/number.h"
#include "mesh/mesh.h"

static const struct {
  const char *name;
  double millimetres;
} units[] = {{"mm", 1.0}, {"cm", 10.0}, {"m", 1000.0}, {"um", 1e-3}, {"in", 25.4}};

enum { UNITS = sizeof units / sizeof *units };

bool supine_mesh_unit_find(const char *name, double *millimetres) {
  for (size_t i = 0; i < UNITS; ++i) {
    if (strcmp(name, units[i].name) == 0) {
      *millimetres = units[i].millimetres;
      return true;
    }
  }
  return false;
}

void supine_mesh_unit_name(double millimetres, char *text) {
  (void)supine_print_text(text, 24, "%.9g mm", millimetres);
  for (size_t i = 0; i < UNITS; ++i) {
    if (units[i].millimetres == millimetres) {
      (void)snprintf(text, 24, "%s", units[i].name);
    }
  }
}

bool supine_mesh_unit_is_likely(double side, const char **other) {
  /* least, greatest and typical longest side of the bounding box of lungs, mm */
  static const double least = 80.0;
  static const double most = 700.0;
  static const double typical = 280.0;
  double nearest = INFINITY;
  *other = NULL;
  for (size_t i = 1; i < UNITS; ++i) {
    const double scaled = side * units[i].millimetres;
    const double distance = fabs(log(scaled / typical));
    if (scaled >= least && scaled <= most && distance < nearest) {
      *other = units[i].name;
      nearest = distance;
    }
  }
  return side >= least && side <= most;
}
