/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the directions of displacement (15)-(17). */
#include <math.h>
#include <string.h>

#include "precompute/physics/force.h"

static void box_direction(const supine_lungs *lungs, const double c[6], size_t vertex, double *d) {
  double box[3];
  supine_lungs_box_coordinates(lungs, vertex, box);
  const size_t lung = vertex >= lungs->lung_begin[1] ? 1 : 0;
  d[0] = lungs->side[lung] * c[0] * pow(box[0], c[1]); /* (15) */
  d[1] = -c[2] * pow(box[1], c[3]);                    /* (16) */
  d[2] = -c[4] * pow(box[2], c[5]);                    /* (17) */
}

supine_status supine_physics_directions(const supine_lungs *lungs, const supine_direction_law *law,
                                        double *directions, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  for (size_t k = 0; k < 6; ++k) {
    if (!isfinite(law->c[k]) || (k % 2 == 1 && !(law->c[k] > 0.0))) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "direction constant c%zu is %g: %s",
                              k + 1, law->c[k],
                              k % 2 == 1 ? "exponents must be positive" : "it must be finite");
    }
  }
  for (size_t i = 0; i < n && law->vectors == NULL; ++i) {
    box_direction(lungs, law->c, i, directions + 3 * i);
  }
  if (law->vectors != NULL) {
    memcpy(directions, law->vectors, 3 * n * sizeof *directions);
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    if (directions[i] != 0.0) {
      return SUPINE_OK;
    }
  }
  return supine_error_set(error, SUPINE_ERROR_MESH,
                          "no vertex would move, as every direction is zero: change the direction "
                          "constants");
}
