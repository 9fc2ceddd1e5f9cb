/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Sweeps over the rows of a system, and the cycle over its stages. */
#include "precompute/physics/system.h"
#include "sh/base/denormals.h"

typedef struct flushed {
  supine_range_function *function;
  void *context;
} flushed;

static void flushed_range(void *context, size_t begin, size_t end, size_t thread) {
  const flushed *call = context;
  const unsigned saved = supine_denormals_flush();
  call->function(call->context, begin, end, thread);
  supine_denormals_restore(saved);
}

void supine_physics_system_run(size_t threads, size_t rows, supine_range_function *function,
                               void *context) {
  flushed call = {function, context};
  supine_parallel_for(rows, SUPINE_SUM_ROWS, threads, flushed_range, &call);
}

/* Vectors and matrices of one pass over the rows of a stage. */
typedef struct row_pass {
  const supine_stage *stage;
  const supine_rows *rows;
  size_t lanes;
  float factor;
  const float *right, *from;
  float *to;
} row_pass;

/* to = from + factor inverse (right - A from), or right - A from where factor is 0. */
SUPINE_INLINE void sweep_rows(size_t lanes, const row_pass *pass, size_t begin, size_t end) {
  const supine_stage *stage = pass->stage;
  for (size_t i = begin; i < end; ++i) {
    float out[SUPINE_RHS_MAX];
    const float *from = pass->from + i * lanes;
    const float *right = pass->right + i * lanes;
    const float inverse = pass->factor * stage->inverse[i];
    float *restrict to = pass->to + i * lanes;
    supine_physics_stage_image(lanes, stage, pass->from, i, out);
    if (pass->factor == 0.0F) {
      SUPINE_EACH_LANE(r, lanes) {
        to[r] = right[r] - out[r];
      }
    } else {
      SUPINE_EACH_LANE(r, lanes) {
        to[r] = from[r] + inverse * (right[r] - out[r]);
      }
    }
  }
}

SUPINE_CLONES static void sweep_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const row_pass *pass = context;
  SUPINE_FOR_LANES(pass->lanes, sweep_rows, pass, begin, end);
}

/* to = rows from; factor 1: added to what is there. */
SUPINE_INLINE void apply_rows(size_t lanes, const row_pass *pass, size_t begin, size_t end) {
  const supine_rows *rows = pass->rows;
  for (size_t i = begin; i < end; ++i) {
    float out[SUPINE_RHS_MAX];
    float *restrict to = pass->to + i * lanes;
    SUPINE_EACH_LANE(r, lanes) {
      out[r] = pass->factor == 0.0F ? 0.0F : to[r];
    }
    for (size_t s = rows->begin[i]; s < rows->begin[i + 1]; ++s) {
      const float *from = pass->from + (size_t)rows->column[s] * lanes;
      const float value = rows->value[s];
      SUPINE_EACH_LANE(r, lanes) {
        out[r] += value * from[r];
      }
    }
    SUPINE_EACH_LANE(r, lanes) {
      to[r] = out[r];
    }
  }
}

SUPINE_CLONES static void apply_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const row_pass *pass = context;
  SUPINE_FOR_LANES(pass->lanes, apply_rows, pass, begin, end);
}

static void sweep(const supine_system *system, const supine_stage *stage, float factor,
                  const float *right, const float *from, float *to) {
  row_pass pass = {stage, NULL, system->lanes, factor, right, from, to};
  supine_physics_system_run(system->threads, stage->links->count, sweep_range, &pass);
}

static void apply(const supine_system *system, const supine_rows *rows, size_t lanes, float factor,
                  const float *from, float *to) {
  row_pass pass = {NULL, rows, lanes, factor, NULL, from, to};
  supine_physics_system_run(system->threads, rows->count, apply_range, &pass);
}

/* inverse = 1 / (mass + sum of c) of the rows of a stage. */
static void invert_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const row_pass *pass = context;
  const supine_stage *stage = pass->stage;
  const supine_rows *links = stage->links;
  for (size_t i = begin; i < end; ++i) {
    double sum = (double)stage->mass[i];
    for (size_t s = links->begin[i]; s < links->begin[i + 1]; ++s) {
      sum += (double)links->value[s];
    }
    stage->inverse[i] = (float)(1.0 / sum);
  }
}

void supine_physics_system_set_masses(supine_system *system) {
  for (size_t k = 0; k < system->stage_count; ++k) {
    const supine_stage *stage = &system->stage[k];
    row_pass pass = {.stage = stage};
    supine_physics_system_run(system->threads, stage->links->count, invert_range, &pass);
    if (k + 1 < system->stage_count) { /* shares sum to 1: the mass stays the same in all */
      apply(system, stage->whole, 1, 0.0F, stage->mass, system->stage[k + 1].mass);
    }
  }
}

/* solution = damping inverse right. */
static void begin_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const row_pass *pass = context;
  const size_t lanes = pass->lanes;
  for (size_t i = begin; i < end; ++i) {
    for (size_t at = i * lanes; at < (i + 1) * lanes; ++at) {
      pass->to[at] = pass->factor * pass->stage->inverse[i] * pass->right[at];
    }
  }
}

/* From one buffer to the other. */
static void smooth(const supine_system *system, supine_stage *stage) {
  sweep(system, stage, SUPINE_DAMPING, stage->right, stage->solution, stage->work);
  float *swap = stage->solution;
  stage->solution = stage->work;
  stage->work = swap;
}

/* From here on stages are gone through twice a cycle: a twentieth of a cycle's work, since each
 * stage has a seventh to a tenth of the last one's rows, for a tenth fewer steps on millions of
 * rows. */
static const size_t twice_from = 2;

/* Improves the solution of stage k, where it stands at SUPINE_DAMPING inverse right. */
static void improve(supine_system *system, size_t k) {
  supine_stage *stage = &system->stage[k];
  for (int turn = 0; turn < (k < twice_from ? 1 : 2); ++turn) {
    if (turn > 0) {
      smooth(system, stage);
    }
    if (k + 1 < system->stage_count) {
      supine_stage *next = &system->stage[k + 1];
      sweep(system, stage, 0.0F, stage->right, stage->solution, stage->work);
      apply(system, stage->whole, system->lanes, 0.0F, stage->work, next->right);
      row_pass pass = {next,        NULL,           system->lanes, SUPINE_DAMPING,
                       next->right, next->solution, next->solution};
      supine_physics_system_run(system->threads, next->links->count, begin_range, &pass);
      improve(system, k + 1);
      apply(system, stage->part, system->lanes, 1.0F, next->solution, stage->solution);
    }
    smooth(system, stage);
  }
}

void supine_physics_system_cycle(supine_system *system) {
  improve(system, 0);
}
