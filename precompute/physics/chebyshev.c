/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Chebyshev's semi-iteration (Golub and Varga 1961) on the system scaled by its diagonal. */
#include <math.h>

#include "precompute/physics/chebyshev.h"

typedef struct pass {
  const supine_system *system;
  float *from; /* x of this step */
  float *to;   /* of the last one, turned to the next */
  float omega;
  const double *unit;
  double *solution;
  double *largest;
} pass;

static void radius_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const pass *p = context;
  const supine_stage *stage = &p->system->stage[0];
  for (size_t block = begin; block < end; block += SUPINE_SUM_ROWS) {
    const size_t last = end - block < SUPINE_SUM_ROWS ? end : block + SUPINE_SUM_ROWS;
    float most = 0.0F;
    for (size_t at = block; at < last; ++at) {
      const float share = 1.0F - stage->mass[at] * stage->inverse[at];
      most = share > most ? share : most;
    }
    p->largest[block / SUPINE_SUM_ROWS] = (double)most;
  }
}

double supine_physics_chebyshev_radius(const supine_system *system, double *largest) {
  const size_t rows = system->stage[0].links->count;
  pass p = {.system = system, .largest = largest};
  double radius = 0.0;
  supine_physics_system_run(system->threads, rows, radius_range, &p);
  for (size_t block = 0; block * SUPINE_SUM_ROWS < rows; ++block) {
    radius = fmax(radius, largest[block]);
  }
  return radius;
}

size_t supine_physics_chebyshev_steps(double radius, double gain) {
  return gain >= 1.0 || radius <= 0.0 ? 1 : (size_t)ceil(acosh(1.0 / gain) / acosh(1.0 / radius));
}

/* x' = omega (x + (r - A x) / diagonal - last) + last, in the place of the last. */
SUPINE_INLINE void step_rows(size_t lanes, const pass *p, size_t begin, size_t end) {
  const supine_stage *stage = &p->system->stage[0];
  for (size_t i = begin; i < end; ++i) {
    float out[SUPINE_RHS_MAX];
    const float *from = p->from + i * lanes;
    const float *right = stage->right + i * lanes;
    const float inverse = stage->inverse[i];
    float *restrict to = p->to + i * lanes;
    supine_physics_stage_image(lanes, stage, p->from, i, out);
    SUPINE_EACH_LANE(r, lanes) {
      to[r] += p->omega * (from[r] - to[r] + inverse * (right[r] - out[r]));
    }
  }
}

SUPINE_CLONES static void step_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const pass *p = context;
  SUPINE_FOR_LANES(p->system->lanes, step_rows, p, begin, end);
}

/* The first step, from 0: x = r / diagonal. */
static void begin_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const pass *p = context;
  const supine_stage *stage = &p->system->stage[0];
  const size_t lanes = p->system->lanes;
  for (size_t i = begin; i < end; ++i) {
    for (size_t at = i * lanes; at < (i + 1) * lanes; ++at) {
      stage->solution[at] = stage->inverse[i] * stage->right[at];
      stage->work[at] = 0.0F;
    }
  }
}

SUPINE_INLINE void add_rows(size_t lanes, const pass *p, size_t begin, size_t end) {
  for (size_t i = begin; i < end; ++i) {
    const float *from = p->from + i * lanes;
    double *restrict to = p->solution + i * lanes;
    SUPINE_EACH_LANE(r, lanes) {
      to[r] += p->unit[r] * (double)from[r];
    }
  }
}

SUPINE_CLONES static void add_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const pass *p = context;
  SUPINE_FOR_LANES(p->system->lanes, add_rows, p, begin, end);
}

void supine_physics_chebyshev(supine_system *system, double radius, size_t steps,
                              const double *unit, double *solution) {
  const supine_stage *stage = &system->stage[0];
  const size_t rows = stage->links->count;
  const double square = radius * radius;
  pass p = {.system = system,
            .from = stage->solution,
            .to = stage->work,
            .unit = unit,
            .solution = solution};
  double omega = 2.0; /* as if of step 1, so that the next is 1 / (1 - radius^2 / 2) */
  supine_physics_system_run(system->threads, rows, begin_range, &p);
  for (size_t step = 1; step < steps; ++step) {
    omega = 1.0 / (1.0 - 0.25 * square * omega);
    p.omega = (float)omega;
    supine_physics_system_run(system->threads, rows, step_range, &p);
    float *swap = p.to;
    p.to = p.from;
    p.from = swap;
  }
  supine_physics_system_run(system->threads, rows, add_range, &p);
}
