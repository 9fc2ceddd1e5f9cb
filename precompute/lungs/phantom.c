/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A made pair of lungs. */
#include <math.h>
#include <stdlib.h>

#include "precompute/lungs/phantom.h"
#include <supine/sh.h>

#include "precompute/lungs/geodesic.h"
#include "precompute/lungs/phantom_shape.h"

/* Pushes a unit sphere out to the radius of one lung. */
static supine_status shape(size_t lung, size_t count, double *vertices) {
  double y[SUPINE_PHANTOM_TERMS];
  for (size_t i = 0; i < count; ++i) {
    double *p = vertices + 3 * i;
    const supine_status status = supine_sh_evaluate(SUPINE_PHANTOM_BAND, p, y);
    if (status != SUPINE_OK) {
      return status;
    }
    double radius = 0.0;
    for (size_t t = 0; t < SUPINE_PHANTOM_TERMS; ++t) {
      radius += supine_phantom_radius[lung][t] * y[t];
    }
    for (size_t k = 0; k < 3; ++k) {
      p[k] = supine_phantom_centre[lung][k] + radius * p[k];
    }
  }
  return SUPINE_OK;
}

supine_status supine_phantom_create(size_t vertices, double millilitres, supine_mesh *mesh,
                                    supine_error *error) {
  if (vertices < SUPINE_PHANTOM_VERTICES_MIN || vertices > SUPINE_PHANTOM_VERTICES_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "%zu vertices: %d to %d are possible",
                            vertices, SUPINE_PHANTOM_VERTICES_MIN, SUPINE_PHANTOM_VERTICES_MAX);
  }
  if (!(millilitres > 0.0) || !isfinite(millilitres)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "a volume of %g mL: it must be positive",
                            millilitres);
  }
  const double exact = sqrt(((double)vertices / 2.0 - 2.0) / 10.0);
  const size_t frequency = (size_t)fmax(2.0, floor(exact + 0.5));
  const size_t count = supine_phantom_geodesic_vertex_count(frequency);
  const size_t faces = supine_phantom_geodesic_triangle_count(frequency);
  supine_mesh made = {.vertex_count = 2 * count, .triangle_count = 2 * faces};
  made.vertices = malloc(3 * made.vertex_count * sizeof *made.vertices);
  made.triangles = malloc(3 * made.triangle_count * sizeof *made.triangles);
  if (made.vertices == NULL || made.triangles == NULL) {
    supine_mesh_free(&made);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", 2 * count);
  }
  for (size_t lung = 0; lung < 2; ++lung) {
    double *part = made.vertices + 3 * lung * count;
    supine_phantom_geodesic(frequency, (uint32_t)(lung * count), part,
                            made.triangles + 3 * lung * faces);
    const supine_status status = shape(lung, count, part);
    if (status != SUPINE_OK) {
      supine_mesh_free(&made);
      return supine_error_set(error, status, "lung shape: %s", supine_status_string(status));
    }
  }
  const double factor = cbrt(1e3 * millilitres / supine_mesh_volume(&made));
  for (size_t i = 0; i < 3 * made.vertex_count; ++i) {
    made.vertices[i] *= factor;
  }
  *mesh = made;
  return SUPINE_OK;
}
