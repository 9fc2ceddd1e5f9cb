/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the applied force and the displacements at force 1, (15)-(18) of [Santhanam2008]. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "base/remedy.h"
#include "base/vec3.h"

#include "precompute/physics/force.h"

enum { GRAIN = 64 };

typedef struct force_work {
  const supine_lungs *lungs;
  const supine_force_law *law;
  const supine_gravities *gravities;
  const size_t *vertices; /* indices, or NULL for all vertices */
  double middle[3];       /* mean position of all vertices, mm; 0 if law->soften is 0 */
  double *force;
} force_work;

static void force_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const force_work *work = context;
  const supine_force_law *law = work->law;
  const supine_gravities *gravities = work->gravities;
  for (size_t k = begin; k < end; ++k) {
    const size_t vertex = work->vertices != NULL ? work->vertices[k] : k;
    const double *p = work->lungs->mesh.vertices + 3 * vertex;
    const double from_middle[3] = {p[0] - work->middle[0], p[1] - work->middle[1],
                                   p[2] - work->middle[2]};
    double *restrict out = work->force + k * gravities->count;
    double box[3];
    supine_lungs_box_coordinates(work->lungs, vertex, box);
    const double fixed = law->base + supine_dot(law->box, box);
    for (size_t d = 0; d < gravities->count; ++d) {
      const double *g = gravities->directions + 3 * d;
      const double height = gravities->maximum[d] - gravities->minimum[d];
      out[d] = fixed + law->gain * (supine_dot(g, p) - gravities->minimum[d]) / height;
      if (law->soften != 0.0) {
        out[d] *= exp(law->soften * supine_dot(g, from_middle) / height);
      }
    }
  }
}

void supine_physics_force(const supine_lungs *lungs, const supine_force_law *law,
                          const supine_gravities *gravities, size_t vertex_count,
                          const size_t *vertices, double *force) {
  const size_t n = lungs->mesh.vertex_count;
  force_work work = {lungs, law, gravities, vertices, {0.0}, force};
  if (law->soften != 0.0) {
    for (size_t i = 0; i < 3 * n; ++i) {
      work.middle[i % 3] += lungs->mesh.vertices[i] / (double)n;
    }
  }
  supine_parallel_for(vertex_count, GRAIN, 0, force_range, &work);
}

/* Compute a vertex's displacement at force 1, mm, by (15)-(17) of [Santhanam2008]. */
static void box_direction(const supine_lungs *lungs, const double c[6], size_t vertex, double *d) {
  double box[3];
  supine_lungs_box_coordinates(lungs, vertex, box);
  const size_t lung = vertex >= lungs->lung_begin[1] ? 1 : 0;
  d[0] = lungs->side[lung] * c[0] * pow(box[0], c[1]);
  d[1] = -c[2] * pow(box[1], c[3]);
  d[2] = -c[4] * pow(box[2], c[5]);
}

/* Add the shear to displacements [vertices, 3] at a force of 1. In the supine posture, forces below
 * a fifth of their RMS are raised to that value, against a division by zero. */
static supine_status add_shear(const supine_lungs *lungs, const supine_force_law *law, double shear,
                               double *directions, supine_error *error) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  static const double least = 0.2;
  const size_t n = lungs->mesh.vertex_count;
  double range[2];
  double forces = 0.0; /* sums of squares */
  double moved = 0.0;
  SUPINE_ARENA arena = {0};
  double *force = supine_arena_take(&arena, n, sizeof *force);
  if (force == NULL ||
      supine_physics_height_range(lungs, law->pair, 1, supine, range, range + 1) != SUPINE_OK) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  const supine_gravities gravity = {1, supine, range, range + 1};
  supine_physics_force(lungs, law, &gravity, n, NULL, force);
  for (size_t i = 0; i < n; ++i) {
    const double *d = directions + 3 * i;
    forces += force[i] * force[i];
    moved += force[i] * force[i] * supine_dot(d, d);
  }
  for (size_t i = 0; i < n; ++i) {
    double box[3];
    supine_lungs_box_coordinates(lungs, i, box);
    directions[3 * i + 1] -= shear * (box[2] - 0.5) * sqrt(moved / (double)n) /
                             fmax(force[i], least * sqrt(forces / (double)n));
  }
  return SUPINE_OK;
}

supine_status supine_physics_directions(const supine_lungs *lungs, const supine_force_law *force,
                                        const supine_direction_law *law, double *directions,
                                        supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  for (size_t k = 0; k < 6; ++k) {
    SUPINE_REFUSE_IF(!isfinite(law->c[k]) || (k % 2 == 1 && !(law->c[k] > 0.0)), error,
                     SUPINE_ERROR_ARGUMENT, "direction constant c%zu is %g: %s", k + 1, law->c[k],
                     k % 2 == 1 ? "it is an exponent: give a number above 0"
                                : "give a finite number");
  }
  if (law->vectors != NULL) {
    memcpy(directions, law->vectors, 3 * n * sizeof *directions);
  } else {
    for (size_t i = 0; i < n; ++i) {
      box_direction(lungs, law->c, i, directions + 3 * i);
    }
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    if (directions[i] != 0.0) {
      return law->vectors != NULL || law->shear == 0.0
                 ? SUPINE_OK
                 : add_shear(lungs, force, law->shear, directions, error);
    }
  }
  (void)supine_error_set(error, SUPINE_ERROR_MESH,
                         "no vertex is displaced: the constants C1, C3 and C5 are all 0");
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_change("constants", "")};
  supine_error_advise(error, advice);
  return SUPINE_ERROR_MESH;
}
