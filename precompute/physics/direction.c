/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The direction of displacement (15)-(17), and two simple alternatives. */
#include <math.h>
#include <stdlib.h>

#include "precompute/physics/force.h"

static void box_direction(const supine_lungs *lungs, const double c[6], size_t vertex, double *d) {
  double box[3];
  supine_lungs_box_coordinates(lungs, vertex, box);
  const size_t lung = vertex >= lungs->lung_begin[1] ? 1 : 0;
  d[0] = lungs->side[lung] * c[0] * pow(box[0], c[1]); /* (15) */
  d[1] = -c[2] * pow(box[1], c[3]);                    /* (16) */
  d[2] = -c[4] * pow(box[2], c[5]);                    /* (17) */
}

static void radial_directions(const supine_lungs *lungs, double *d) {
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    const size_t begin = lungs->lung_begin[lung];
    const size_t end = lungs->lung_begin[lung + 1];
    double centre[3] = {0.0, 0.0, 0.0};
    for (size_t i = begin; i < end; ++i) {
      for (size_t k = 0; k < 3; ++k) {
        centre[k] += lungs->mesh.vertices[3 * i + k] / (double)(end - begin);
      }
    }
    for (size_t i = begin; i < end; ++i) {
      for (size_t k = 0; k < 3; ++k) {
        d[3 * i + k] = lungs->mesh.vertices[3 * i + k] - centre[k];
      }
    }
  }
}

static void normalise(size_t count, double *d) {
  for (size_t i = 0; i < count; ++i) {
    const double length =
        sqrt(d[3 * i] * d[3 * i] + d[3 * i + 1] * d[3 * i + 1] + d[3 * i + 2] * d[3 * i + 2]);
    for (size_t k = 0; k < 3 && length > 0.0; ++k) {
      d[3 * i + k] /= length;
    }
  }
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
  switch (law->model) {
  case SUPINE_DIRECTION_BOX:
    for (size_t i = 0; i < n; ++i) {
      box_direction(lungs, law->c, i, directions + 3 * i);
    }
    break;
  case SUPINE_DIRECTION_NORMAL:
    supine_mesh_vertex_normals(&lungs->mesh, directions);
    break;
  case SUPINE_DIRECTION_RADIAL:
    radial_directions(lungs, directions);
    normalise(n, directions);
    break;
  case SUPINE_DIRECTION_VECTORS:
    if (law->vectors == NULL) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "the model has no direction vectors: give --direction FILE");
    }
    for (size_t i = 0; i < 3 * n; ++i) {
      directions[i] = law->vectors[i];
    }
    break;
  default:
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "no direction model %d", (int)law->model);
  }
  if (law->correct != NULL) {
    law->correct(law->context, lungs, directions);
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    if (directions[i] != 0.0) {
      return SUPINE_OK;
    }
  }
  return supine_error_set(error, SUPINE_ERROR_MESH,
                          "no vertex would move: every direction is zero");
}
