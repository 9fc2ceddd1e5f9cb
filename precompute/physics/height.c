/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the smallest and largest height g.p of vertices p along many directions g, for force.h. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "precompute/physics/force.h"

/* Number of consecutive vertices in a block. The search skips blocks whose bounding boxes cannot
 * contain a new greatest height. */
enum { BLOCK = 64 };

typedef struct block_box {
  double centre[3];
  double half[3];
} block_box;

typedef struct range_work {
  size_t vertex_count;
  const double *vertices; /* [vertex_count, 3] mm */
  const block_box *boxes; /* [box_count] bounding box of each block of BLOCK vertices */
  size_t box_count;
  size_t direction_count;
  const double *directions;
  double *minimum, *maximum;
} range_work;

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

/* Return the greatest of a block's heights along g and `best`. */
static double highest(const range_work *work, size_t block, const double g[3], double best) {
  const size_t end =
      (block + 1) * BLOCK < work->vertex_count ? (block + 1) * BLOCK : work->vertex_count;
  for (size_t i = block * BLOCK; i < end; ++i) {
    const double h = supine_dot(g, work->vertices + 3 * i);
    best = h > best ? h : best;
  }
  return best;
}

/* Return the greatest height of a vertex along g. Search block *seed first, and set it to the block
 * that was searched last, a good seed for similar directions. */
static double search(const range_work *work, const double g[3], size_t *seed) {
  const double size[3] = {fabs(g[0]), fabs(g[1]), fabs(g[2])};
  double best = highest(work, *seed, g, -INFINITY);
  for (size_t block = 0; block < work->box_count; ++block) {
    const block_box *box = &work->boxes[block];
    if (supine_dot(g, box->centre) + supine_dot(size, box->half) > best) {
      best = highest(work, block, g, best);
      *seed = block;
    }
  }
  return best;
}

static void height_range(void *context, size_t begin, size_t end, size_t thread) {
  const range_work *work = context;
  size_t seed[2] = {0, 0};
  (void)thread;
  for (size_t d = begin; d < end; ++d) {
    const double *g = work->directions + 3 * d;
    const double down[3] = {-g[0], -g[1], -g[2]};
    work->maximum[d] = search(work, g, &seed[0]);
    work->minimum[d] = -search(work, down, &seed[1]);
  }
}

supine_status supine_physics_height_range(const supine_lungs *lungs, bool pair, size_t count,
                                          const double *directions, double *minimum,
                                          double *maximum) {
  const size_t single = lungs->mesh.vertex_count;
  const size_t n = pair && lungs->lung_count == 1 ? 2 * single : single;
  const size_t box_count = (n + BLOCK - 1) / BLOCK;
  SUPINE_ARENA arena = {0};
  block_box *boxes = supine_arena_take(&arena, box_count, sizeof *boxes);
  double *vertices = supine_arena_take(&arena, 3 * n, sizeof *vertices);
  if (arena.failed) {
    return SUPINE_ERROR_MEMORY;
  }
  range_work work = {n, vertices, boxes, box_count, count, directions, minimum, maximum};
  memcpy(vertices, lungs->mesh.vertices, 3 * single * sizeof *vertices);
  for (size_t i = 3 * single; i < 3 * n; ++i) { /* append the mirror image of a single lung */
    const double at = vertices[i - 3 * single];
    vertices[i] = i % 3 == 0 ? 2.0 * lungs->midline - at : at;
  }
  for (size_t i = 0; i < n; i += BLOCK) {
    boxes[i / BLOCK] = box_of(vertices + 3 * i, n - i < BLOCK ? n - i : BLOCK);
  }
  supine_parallel_for(count, 32, 0, height_range, &work);
  return SUPINE_OK;
}
