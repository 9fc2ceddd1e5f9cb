/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the applied force (18) for any direction of gravity. */
#include <math.h>
#include <stddef.h>

#include "sh/base/parallel.h"
#include "sh/base/vec3.h"

#include "precompute/physics/force.h"

enum { GRAIN = 64 };

typedef struct force_work {
  const supine_lungs *lungs;
  const supine_force_law *law;
  const supine_gravities *gravities;
  const size_t *vertices; /* NULL: all */
  double middle[3];       /* mean position of all vertices, where h equals its mean */
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
    const double still = law->base + supine_dot(law->box, box);
    for (size_t d = 0; d < gravities->count; ++d) {
      const double *g = gravities->directions + 3 * d;
      const double height = gravities->maximum[d] - gravities->minimum[d];
      out[d] = still + law->gain * (supine_dot(g, p) - gravities->minimum[d]) / height; /* (18) */
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
  for (size_t i = 0; i < 3 * n && law->soften != 0.0; ++i) {
    work.middle[i % 3] += lungs->mesh.vertices[i] / (double)n;
  }
  supine_parallel_for(vertex_count, GRAIN, 0, force_range, &work);
}
