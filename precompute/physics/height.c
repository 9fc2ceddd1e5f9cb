/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the smallest and largest height g.p of vertices p along many directions g, for force.h. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "base/arena.h"
#include "base/clones.h"
#include "base/parallel.h"
#include "precompute/physics/force.h"

/* BLOCK consecutive vertices form a block, GROUP blocks a group. The search skips groups and blocks
 * whose bounding boxes cannot contain a new greatest height. It handles LANES directions together.
 */
enum { BLOCK = 64, GROUP = 16, LANES = 8 };

typedef struct block_box {
  double centre[3];
  double half[3];
} block_box;

typedef struct range_work {
  size_t vertex_count;
  const double *vertices; /* [vertex_count, 3] mm */
  const block_box *boxes; /* [box_count] bounding box of each block of BLOCK vertices */
  size_t box_count;
  const block_box *groups; /* [group_count] bounding box of each group of GROUP blocks */
  size_t group_count;
  size_t direction_count;
  const double *directions;
  double *minimum, *maximum;
} range_work;

/* A batch of LANES directions. One search finds the greatest height of a vertex along each. */
typedef struct lanes {
  double g[3][LANES];    /* components of the directions, which are unit vectors */
  double size[3][LANES]; /* absolute values of the elements of `g` */
  double best[LANES];    /* greatest height found so far along each direction, mm */
} lanes;

static block_box box_of(const double *vertices, size_t count) {
  block_box box;
  for (size_t k = 0; k < 3; ++k) {
    double low = vertices[k];
    double high = vertices[k];
    for (size_t i = 1; i < count; ++i) {
      const double x = vertices[3 * i + k];
      low = x < low ? x : low;
      high = x > high ? x : high;
    }
    box.centre[k] = 0.5 * (low + high);
    box.half[k] = 0.5 * (high - low) * (1.0 + 1e-12) + 1e-9;
  }
  return box;
}

/* Return whether a box may contain a vertex whose height along a direction exceeds at->best. */
static inline bool may_improve(const block_box *box, const lanes *at) {
  const block_box b = *box;
  int64_t any = 0;
#pragma GCC unroll 1 /* full unrolling would prevent vectorisation */
  for (size_t l = 0; l < LANES; ++l) {
    const double bound = at->g[0][l] * b.centre[0] + at->size[0][l] * b.half[0] +
                         at->g[1][l] * b.centre[1] + at->size[1][l] * b.half[1] +
                         at->g[2][l] * b.centre[2] + at->size[2][l] * b.half[2];
    any |= bound > at->best[l] ? 1 : 0;
  }
  return any != 0;
}

/* Update at->best, the greatest heights found so far, with the vertices of one block. */
static inline void raise_best(const range_work *work, size_t block, lanes *at) {
  const size_t end =
      (block + 1) * BLOCK < work->vertex_count ? (block + 1) * BLOCK : work->vertex_count;
  for (size_t i = block * BLOCK; i < end; ++i) {
    const double x = work->vertices[3 * i];
    const double y = work->vertices[3 * i + 1];
    const double z = work->vertices[3 * i + 2];
#pragma GCC unroll 1
    for (size_t l = 0; l < LANES; ++l) {
      const double h = at->g[0][l] * x + at->g[1][l] * y + at->g[2][l] * z;
      at->best[l] = h > at->best[l] ? h : at->best[l];
    }
  }
}

/* Find the greatest height of a vertex along each direction. Search the block of vertices `seed`
 * first. Return the block searched last, a good seed for similar directions. */
static inline size_t search(const range_work *work, size_t seed, lanes *at) {
  raise_best(work, seed, at);
  for (size_t group = 0; group < work->group_count; ++group) {
    if (!may_improve(&work->groups[group], at)) {
      continue;
    }
    const size_t end =
        (group + 1) * GROUP < work->box_count ? (group + 1) * GROUP : work->box_count;
    for (size_t block = group * GROUP; block < end; ++block) {
      if (may_improve(&work->boxes[block], at)) {
        raise_best(work, block, at);
        seed = block;
      }
    }
  }
  return seed;
}

SUPINE_CLONES static void height_range(void *context, size_t begin, size_t end, size_t thread) {
  const range_work *work = context;
  size_t seed[2] = {0, 0};
  (void)thread;
  for (size_t d = begin; d < end; ++d) {
    const size_t left = work->direction_count - d * LANES;
    for (size_t up = 0; up < 2; ++up) {
      lanes at;
      for (size_t l = 0; l < LANES; ++l) {
        const double *g = work->directions + 3 * (d * LANES + (l < left ? l : 0));
        for (size_t k = 0; k < 3; ++k) {
          at.g[k][l] = up ? g[k] : -g[k];
          at.size[k][l] = fabs(g[k]);
        }
        at.best[l] = -INFINITY;
      }
      seed[up] = search(work, seed[up], &at);
      for (size_t l = 0; l < LANES && l < left; ++l) {
        if (up) {
          work->maximum[d * LANES + l] = at.best[l];
        } else {
          work->minimum[d * LANES + l] = -at.best[l];
        }
      }
    }
  }
}

supine_status supine_physics_height_range(const supine_lungs *lungs, bool pair, size_t count,
                                          const double *directions, double *minimum,
                                          double *maximum) {
  const size_t single = lungs->mesh.vertex_count;
  const size_t n = pair && lungs->lung_count == 1 ? 2 * single : single;
  const size_t box_count = (n + BLOCK - 1) / BLOCK;
  const size_t group_count = (box_count + GROUP - 1) / GROUP;
  SUPINE_ARENA arena = {0};
  block_box *boxes = supine_arena_take(&arena, box_count, sizeof *boxes);
  block_box *groups = supine_arena_take(&arena, group_count, sizeof *groups);
  double *vertices = supine_arena_take(&arena, 3 * n, sizeof *vertices);
  if (arena.failed) {
    return SUPINE_ERROR_MEMORY;
  }
  range_work work = {.vertex_count = n,
                     .vertices = vertices,
                     .boxes = boxes,
                     .box_count = box_count,
                     .groups = groups,
                     .group_count = group_count,
                     .direction_count = count,
                     .directions = directions,
                     .minimum = minimum,
                     .maximum = maximum};
  memcpy(vertices, lungs->mesh.vertices, 3 * single * sizeof *vertices);
  for (size_t i = 3 * single; i < 3 * n; ++i) { /* append the mirror image of a single lung */
    const double at = vertices[i - 3 * single];
    vertices[i] = i % 3 == 0 ? 2.0 * lungs->midline - at : at;
  }
  for (size_t i = 0; i < n; i += BLOCK) {
    boxes[i / BLOCK] = box_of(vertices + 3 * i, n - i < BLOCK ? n - i : BLOCK);
  }
  const size_t most = (size_t)GROUP * BLOCK;
  for (size_t i = 0; i < n; i += most) {
    groups[i / most] = box_of(vertices + 3 * i, n - i < most ? n - i : most);
  }
  supine_parallel_for((count + LANES - 1) / LANES, 4, 0, height_range, &work);
  return SUPINE_OK;
}
