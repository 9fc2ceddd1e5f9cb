/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The reduced system of an equilibrium, in single precision on every level, and what one solve of
 * it works with. Rows are in the network's internal order; every vector is [rows, lanes], a lane
 * being one right-hand side.
 *
 *     A t = right,  (A t)_i = mass_i t_i + sum over links of c_ij (t_i - t_j),  F_i = S_i^2 t_i */
#ifndef SUPINE_SYSTEM_H
#define SUPINE_SYSTEM_H

#include "precompute/physics/coarse.h"
#include "precompute/physics/network.h"
#include "sh/base/parallel.h"

/* Rows whose sums are added before those of others: the numbers then do not depend on threads. */
enum { SUPINE_SUM_ROWS = 2048 };

/* One level of the system. */
typedef struct supine_stage {
  const supine_rows *links;       /* who is linked, and c */
  const supine_rows *part;        /* shares of its rows in those of the next stage */
  const supine_rows *whole;       /* the transpose */
  float *mass;                    /* [rows] */
  float *inverse;                 /* [rows] of the diagonal */
  float *solution, *right, *work; /* [rows, lanes] */
} supine_stage;

typedef struct supine_system {
  size_t lanes, threads, stage_count;
  supine_stage stage[SUPINE_LEVELS_MAX]; /* the first is the mesh itself */
} supine_system;

/* Calls `function` on ranges of rows that begin at multiples of SUPINE_SUM_ROWS, in threads,
 * denormals flushed. */
void supine_physics_system_run(size_t threads, size_t rows, supine_range_function *function,
                               void *context);

/* Finds the coarse masses of the fine ones, and the inverse of every diagonal. */
void supine_physics_system_set_masses(supine_system *system);

/* Share of a full step that smoothing takes: stable for diagonals of half the largest eigenvalue or
 * more, which those of a graph's Laplacian are. */
#define SUPINE_DAMPING 0.9F

/* Improves the first stage's solution for its right side, where the solution stands at
 * SUPINE_DAMPING inverse right: down to the last stage and back, coarse stages twice, one smoothing
 * sweep on either way.
 * Symmetric, so that conjugate gradients take it for a preconditioner. */
void supine_physics_system_cycle(supine_system *system);

/* Calls `rows(..., lanes, ...)` with the common numbers of lanes as constants, so that the compiler
 * keeps a row in registers. */
#define SUPINE_FOR_LANES(lanes, rows, ...)                                                         \
  do {                                                                                             \
    switch (lanes) {                                                                               \
    case 1:                                                                                        \
      rows(1, __VA_ARGS__);                                                                        \
      break;                                                                                       \
    case 4:                                                                                        \
      rows(4, __VA_ARGS__);                                                                        \
      break;                                                                                       \
    case 5:                                                                                        \
      rows(5, __VA_ARGS__);                                                                        \
      break;                                                                                       \
    case 16:                                                                                       \
      rows(16, __VA_ARGS__);                                                                       \
      break;                                                                                       \
    default:                                                                                       \
      rows(lanes, __VA_ARGS__);                                                                    \
    }                                                                                              \
  } while (0)

/* For the functions that it calls. */
#define SUPINE_INLINE static inline __attribute__((always_inline))

/* Over the lanes of a row, in vectors: unrolled first, it would be left scalar. */
#if defined(__GNUC__) && !defined(__clang__)
#define SUPINE_EACH_LANE(r, lanes) _Pragma("GCC unroll 1") for (size_t r = 0; r < (lanes); ++r)
#else
#define SUPINE_EACH_LANE(r, lanes) for (size_t r = 0; r < (lanes); ++r)
#endif

/* out = row i of A from. Differences rather than a diagonal, so that smooth vectors keep their
 * digits. */
SUPINE_INLINE void supine_physics_stage_image(size_t lanes, const supine_stage *stage,
                                              const float *from, size_t i, float *out) {
  const supine_rows *links = stage->links;
  const float *here = from + i * lanes;
  const float mass = stage->mass[i];
  SUPINE_EACH_LANE(r, lanes) {
    out[r] = mass * here[r];
  }
  for (size_t s = links->begin[i]; s < links->begin[i + 1]; ++s) {
    const float *other = from + (size_t)links->column[s] * lanes;
    const float c = links->value[s];
    SUPINE_EACH_LANE(r, lanes) {
      out[r] += c * (here[r] - other[r]);
    }
  }
}

#endif
