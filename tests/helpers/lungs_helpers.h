/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Synthetic and real lungs, random numbers, and comparisons of arrays. */
#ifndef SUPINE_LUNGS_HELPERS_H
#define SUPINE_LUNGS_HELPERS_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "mesh/mesh.h"
#include "precompute/lungs/lungs.h"

#include "precompute/lungs/phantom.h"
#include "tests/helpers/sh_helpers.h"

/* Return a pseudo-random number in [0, 1). */
static inline double helper_random(uint64_t *seed) {
  return 0.5 + 0.5 * random_signed(seed);
}

/* Return a closed, asymmetric surface with 10 frequency^2 + 2 vertices. It is about 250 mm high,
 * and its centre is at the given x, mm. */
static inline supine_mesh helper_lump(size_t frequency, double x, uint64_t seed) {
  supine_mesh mesh = {.vertex_count = supine_lungs_phantom_geodesic_vertex_count(frequency),
                      .triangle_count = supine_lungs_phantom_geodesic_triangle_count(frequency)};
  mesh.vertices = malloc(3 * mesh.vertex_count * sizeof *mesh.vertices);
  mesh.triangles = malloc(3 * mesh.triangle_count * sizeof *mesh.triangles);
  supine_lungs_phantom_geodesic(frequency, 0, mesh.vertices, mesh.triangles);
  for (size_t i = 0; i < mesh.vertex_count; ++i) {
    double *p = mesh.vertices + 3 * i;
    const double radius =
        80.0 + 15.0 * p[0] * p[1] + 9.0 * p[2] * p[2] * p[0] + 0.5 * helper_random(&seed);
    p[0] = x + 0.7 * radius * p[0];
    p[1] = 3.1 + 1.1 * radius * p[1];
    p[2] = -40.7 + 1.6 * radius * p[2];
  }
  return mesh;
}

/* Find a file of real lungs: left.obj or right.obj of examples/lungs, which is always there, or a
 * file in the folder of test data (tests/README.md). Return false if it is missing. */
static inline bool helper_real_path(const char *name, char path[512]) {
  const bool shipped = strchr(name, '/') == NULL;
  (void)snprintf(path, 512, "%s/%s", shipped ? SUPINE_EXAMPLE_LUNGS : SUPINE_TEST_DATA, name);
  if (access(path, R_OK) == 0) {
    return true;
  }
  printf("skipped: %s is missing\n", path);
  return false;
}

/* Load one or two surfaces of real lungs into one supine_lungs. Return false if a file is
 * missing. */
static inline bool helper_real_lungs(const char *const *names, size_t count, supine_axes axes,
                                     supine_lungs *lungs) {
  supine_mesh meshes[2] = {0};
  bool loaded = true;
  for (size_t i = 0; i < count && loaded; ++i) {
    char path[512];
    if (!helper_real_path(names[i], path)) {
      loaded = false;
      break;
    }
    const supine_mesh_load_options options = {.axes = axes};
    supine_error error;
    if (supine_mesh_load(path, &options, &meshes[i], NULL, &error) != SUPINE_OK) {
      printf("%s\n", error.message);
      abort();
    }
  }
  if (loaded && supine_lungs_create(meshes, count, NULL, lungs, NULL) != SUPINE_OK) {
    abort();
  }
  for (size_t i = 0; i < count; ++i) {
    supine_mesh_free(&meshes[i]);
  }
  return loaded;
}

/* Load a real left lung with 5,000 vertices into `coarse` and with 20,000 vertices into `fine`. If
 * a file is missing, leave both empty and return false. */
static inline bool helper_real_left_lung(supine_lungs *coarse, supine_lungs *fine) {
  static const char *const name[2] = {"lungs/chaste_left_5k.obj", "lungs/chaste_left.ply"};
  const bool loaded = helper_real_lungs(&name[0], 1, SUPINE_AXES_LPS, coarse) &&
                      helper_real_lungs(&name[1], 1, SUPINE_AXES_LPS, fine);
  if (!loaded) {
    supine_lungs_free(coarse);
    *coarse = (supine_lungs){0};
  }
  return loaded;
}

/* Return the largest |a[i] - b[i]|. */
static inline double helper_difference(size_t count, const double *a, const double *b) {
  double largest = 0.0;
  for (size_t i = 0; i < count; ++i) {
    largest = fmax(largest, fabs(a[i] - b[i]));
  }
  return largest;
}

static inline double helper_largest(size_t count, const double *a) {
  double largest = 0.0;
  for (size_t i = 0; i < count; ++i) {
    largest = fmax(largest, fabs(a[i]));
  }
  return largest;
}

#endif
