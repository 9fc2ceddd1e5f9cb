/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Extent of the lungs along many directions: the min and max of the heights in (18). */
#include <math.h>
#include <stdlib.h>

#include "precompute/physics/force.h"
#include "sh/base/parallel.h"

#include "precompute/physics/network.h"

/* Vertices are taken in blocks of the file's order, each with its box. The box's own extent along a
 * direction bounds its vertices', so that only the few blocks that can hold an extreme are read:
 * the result is exact, and its cost next to nothing where the file's order is local. */
enum { BLOCK = 256 };

typedef struct block_box {
  double centre[3];
  double half[3];
} block_box;

typedef struct range_work {
  const supine_mesh *mesh;
  const block_box *boxes;
  size_t box_count;
  const double *directions;
  double *minimum, *maximum;
} range_work;

static block_box box_of(const double *vertices, size_t count) {
  block_box box;
  for (size_t k = 0; k < 3; ++k) {
    double low = vertices[k];
    double high = vertices[k];
    for (size_t i = 1; i < count; ++i) {
      low = fmin(low, vertices[3 * i + k]);
      high = fmax(high, vertices[3 * i + k]);
    }
    box.centre[k] = 0.5 * (low + high);
    box.half[k] = 0.5 * (high - low) * (1.0 + 1e-12) + 1e-9; /* never less for rounding */
  }
  return box;
}

static size_t block_size(const range_work *work, size_t block) {
  const size_t left = work->mesh->vertex_count - block * BLOCK;
  return left < BLOCK ? left : BLOCK;
}

/* Largest g.p, starting from `seed`, a block that held the last direction's: turned to `seed`
 * again. */
static double highest(const range_work *work, const double *g, size_t *seed) {
  const double size[3] = {fabs(g[0]), fabs(g[1]), fabs(g[2])};
  double best = -INFINITY;
  const size_t first = *seed;
  for (size_t step = 0; step <= work->box_count; ++step) {
    const size_t block = step == 0 ? first : step - 1;
    const block_box *box = &work->boxes[block];
    if (supine_dot(g, box->centre) + supine_dot(size, box->half) <= best) {
      continue;
    }
    const double *p = work->mesh->vertices + 3 * block * BLOCK;
    for (size_t i = 0; i < block_size(work, block); ++i) {
      const double h = supine_dot(g, p + 3 * i);
      if (h > best) {
        best = h;
        *seed = block;
      }
    }
  }
  return best;
}

static void height_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const range_work *work = context;
  size_t top = 0;
  size_t bottom = 0;
  for (size_t d = begin; d < end; ++d) {
    const double *g = work->directions + 3 * d;
    const double opposite[3] = {-g[0], -g[1], -g[2]};
    work->maximum[d] = highest(work, g, &top);
    work->minimum[d] = -highest(work, opposite, &bottom);
  }
}

supine_status supine_physics_height_range(const supine_mesh *mesh, size_t count,
                                          const double *directions, double *minimum,
                                          double *maximum) {
  const size_t box_count = (mesh->vertex_count + BLOCK - 1) / BLOCK;
  block_box *boxes = malloc((box_count + 1) * sizeof *boxes);
  if (boxes == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  range_work work = {mesh, boxes, box_count, directions, minimum, maximum};
  for (size_t b = 0; b < box_count; ++b) {
    boxes[b] = box_of(mesh->vertices + 3 * b * BLOCK, block_size(&work, b));
  }
  supine_parallel_for(count, 16, 0, height_range, &work);
  free(boxes);
  return SUPINE_OK;
}
