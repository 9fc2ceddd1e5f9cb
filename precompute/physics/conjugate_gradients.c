/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Conjugate gradients in the form of Chronopoulos and Gear (1989): one image and one update a step,
 * preconditioned by the diagonal or, where there are coarser stages, by the cycle over them. */
#include <math.h>
#include <string.h>

#include "precompute/physics/conjugate_gradients.h"

typedef struct pass {
  const supine_gradients *work;
  float first; /* factor on inverse times residual that the cycle starts from */
  float alpha[SUPINE_RHS_MAX], beta[SUPINE_RHS_MAX];
  double step[SUPINE_RHS_MAX]; /* alpha in the solution's units */
} pass;

double supine_physics_gradients_total(const double *sums, size_t rows, size_t lanes, size_t part,
                                      size_t lane) {
  double total = 0.0;
  for (size_t block = 0; block * SUPINE_SUM_ROWS < rows; ++block) {
    total += sums[(2 * block + part) * lanes + lane];
  }
  return total;
}

/* w = A z, with <r, z> and <z, w>. */
SUPINE_INLINE void image_rows(size_t lanes, const pass *p, size_t begin, size_t end) {
  const supine_stage *stage = &p->work->system->stage[0];
  for (size_t block = begin; block < end; block += SUPINE_SUM_ROWS) {
    double rz[SUPINE_RHS_MAX] = {0.0};
    double zw[SUPINE_RHS_MAX] = {0.0};
    for (size_t i = block; i < end && i < block + SUPINE_SUM_ROWS; ++i) {
      float out[SUPINE_RHS_MAX];
      const float *z = stage->solution + i * lanes;
      const float *right = stage->right + i * lanes;
      float *restrict image = stage->work + i * lanes;
      supine_physics_stage_image(lanes, stage, stage->solution, i, out);
      SUPINE_EACH_LANE(r, lanes) {
        image[r] = out[r];
        rz[r] += (double)right[r] * (double)z[r];
        zw[r] += (double)z[r] * (double)out[r];
      }
    }
    double *sums = p->work->sums + block / SUPINE_SUM_ROWS * 2 * lanes;
    memcpy(sums, rz, lanes * sizeof *sums);
    memcpy(sums + lanes, zw, lanes * sizeof *sums);
  }
}

SUPINE_CLONES static void image_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const pass *p = context;
  SUPINE_FOR_LANES(p->work->system->lanes, image_rows, p, begin, end);
}

/* p = z + beta p, q = w + beta q, v += alpha p, r -= alpha q, with <r, r / diagonal>; and the z
 * that the next cycle starts at. */
SUPINE_INLINE void update_rows(size_t lanes, const pass *p, size_t begin, size_t end) {
  const supine_gradients *work = p->work;
  const supine_stage *stage = &work->system->stage[0];
  float *restrict z = stage->solution;
  float *restrict residual = stage->right;
  float *restrict direction = work->direction;
  float *restrict product = work->product;
  double *restrict solution = work->solution;
  const float *restrict image = stage->work;
  for (size_t block = begin; block < end; block += SUPINE_SUM_ROWS) {
    double rr[SUPINE_RHS_MAX] = {0.0};
    for (size_t i = block; i < end && i < block + SUPINE_SUM_ROWS; ++i) {
      const float inverse = stage->inverse[i];
      SUPINE_EACH_LANE(r, lanes) {
        const size_t at = i * lanes + r;
        direction[at] = z[at] + p->beta[r] * direction[at];
        product[at] = image[at] + p->beta[r] * product[at];
        solution[at] += p->step[r] * (double)direction[at];
        residual[at] -= p->alpha[r] * product[at];
        const float scaled = inverse * residual[at];
        z[at] = p->first * scaled;
        rr[r] += (double)(scaled * residual[at]);
      }
    }
    memcpy(work->sums + block / SUPINE_SUM_ROWS * 2 * lanes, rr, lanes * sizeof *rr);
  }
}

SUPINE_CLONES static void update_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const pass *p = context;
  SUPINE_FOR_LANES(p->work->system->lanes, update_rows, p, begin, end);
}

/* Find z of the given residual, with no earlier directions. */
static void begin_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const pass *p = context;
  const size_t lanes = p->work->system->lanes;
  const supine_stage *stage = &p->work->system->stage[0];
  for (size_t i = begin; i < end; ++i) {
    for (size_t at = i * lanes; at < (i + 1) * lanes; ++at) {
      stage->solution[at] = p->first * stage->inverse[i] * stage->right[at];
      p->work->direction[at] = p->work->product[at] = 0.0F;
    }
  }
}

size_t supine_physics_conjugate_gradients(const supine_gradients *work, size_t steps_max) {
  supine_system *system = work->system;
  const size_t lanes = system->lanes;
  const size_t rows = system->stage[0].links->count;
  pass p = {.work = work, .first = system->stage_count > 1 ? SUPINE_DAMPING : 1.0F};
  double last_rz[SUPINE_RHS_MAX] = {0.0};
  double last_alpha[SUPINE_RHS_MAX] = {0.0};
  bool done[SUPINE_RHS_MAX] = {false};
  supine_physics_system_run(system->threads, rows, begin_range, &p);
  for (size_t step = 0; step < steps_max; ++step) {
    if (system->stage_count > 1) {
      supine_physics_system_cycle(system);
    }
    supine_physics_system_run(system->threads, rows, image_range, &p);
    for (size_t r = 0; r < lanes; ++r) {
      const double rz = supine_physics_gradients_total(work->sums, rows, lanes, 0, r);
      const double zw = supine_physics_gradients_total(work->sums, rows, lanes, 1, r);
      const double beta = last_rz[r] == 0.0 ? 0.0 : rz / last_rz[r];
      const double alpha = rz / (beta == 0.0 ? zw : zw - beta * rz / last_alpha[r]);
      done[r] = done[r] || !isfinite(alpha) || alpha <= 0.0; /* converged, or lost to rounding */
      p.alpha[r] = done[r] ? 0.0F : (float)alpha;
      p.beta[r] = done[r] ? 0.0F : (float)beta;
      p.step[r] = done[r] ? 0.0 : alpha * work->unit[r];
      last_rz[r] = rz;
      last_alpha[r] = alpha;
    }
    supine_physics_system_run(system->threads, rows, update_range, &p);
    bool all = true;
    for (size_t r = 0; r < lanes; ++r) {
      done[r] = done[r] ||
                !(supine_physics_gradients_total(work->sums, rows, lanes, 0, r) > work->wanted[r]);
      all = all && done[r];
    }
    if (all) {
      return step + 1;
    }
  }
  return steps_max;
}
