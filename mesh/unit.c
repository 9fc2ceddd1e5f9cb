/* SPDX-License-Identifier: MIT */
/* Name units of length, and guess a file's unit from the size of its bounding box. */
#include <math.h>
#include <stdio.h>

#include "base/number.h"
#include "base/quantity.h"
#include "mesh/mesh.h"

void supine_mesh_unit_name(double millimetres, char *text) {
  const supine_unit *unit = supine_quantity_list(SUPINE_QUANTITY_LENGTH);
  (void)supine_print_text(text, 24, "%.9g mm", millimetres);
  for (; unit->name != NULL; ++unit) {
    if (unit->factor == millimetres) {
      (void)snprintf(text, 24, "%s", unit->name);
    }
  }
}

bool supine_mesh_unit_is_likely(double side, const char **other) {
  /* least, greatest and typical longest side of the bounding box of lungs, mm */
  static const double least = 80.0;
  static const double most = 700.0;
  static const double typical = 280.0;
  double nearest = INFINITY;
  const supine_unit *unit = supine_quantity_list(SUPINE_QUANTITY_LENGTH) + 1; /* after mm */
  *other = NULL;
  for (; unit->name != NULL; ++unit) {
    const double scaled = side * unit->factor;
    const double distance = fabs(log(scaled / typical));
    if (scaled >= least && scaled <= most && distance < nearest) {
      *other = unit->name;
      nearest = distance;
    }
  }
  return side >= least && side <= most;
}
