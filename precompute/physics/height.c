/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Extent of the lungs along many directions: the min and max of the heights in (18). */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/physics/force.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"

/* Group the vertices into blocks with bounding boxes, and the blocks into groups. The bounds
 * leave few blocks that can hold an extreme, so the exact search is fast. Blocks hold neighbours
 * in space: vertices are sorted along a curve through 32 x 32 x 32 cells (Morton 1966). */
enum { BLOCK = 64, GROUP = 32, CELL_BITS = 5, CELLS = 1 << (3 * CELL_BITS) };

/* Directions searched together, most candidate vertices of such a run, and least cosine of the
 * angle to its first direction. */
enum { RUN = 8, CANDIDATES = 4096 };
static const double run_cosine = 0.985;

typedef struct block_box {
  double centre[3];
  double half[3];
} block_box;

typedef struct range_work {
  size_t count;            /* vertices */
  const double *vertices;  /* [count, 3] */
  const block_box *boxes;  /* [box_count] */
  const block_box *groups; /* of GROUP boxes each */
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
    box.half[k] = 0.5 * (high - low) * (1.0 + 1e-12) + 1e-9; /* wide enough for rounding */
  }
  return box;
}

static size_t block_size(const range_work *work, size_t block) {
  const size_t left = work->count - block * BLOCK;
  return left < BLOCK ? left : BLOCK;
}

static double bound_of(const block_box *box, const double *g, const double *size) {
  return supine_dot(g, box->centre) + supine_dot(size, box->half);
}

/* The highest vertex found along a direction, and its block. */
typedef struct summit {
  double height;
  const double *point;
  size_t block;
} summit;

static void look_into(const range_work *work, const double *g, size_t block, summit *best) {
  const double *p = work->vertices + 3 * block * BLOCK;
  for (size_t i = 0; i < block_size(work, block); ++i) {
    const double h = supine_dot(g, p + 3 * i);
    if (h > best->height) {
      *best = (summit){h, p + 3 * i, block};
    }
  }
}

/* Find the largest g.p, starting from block `seed`, the result for a similar direction. */
static summit highest(const range_work *work, const double *g, size_t seed) {
  const double size[3] = {fabs(g[0]), fabs(g[1]), fabs(g[2])};
  summit best = {.height = -INFINITY};
  look_into(work, g, seed, &best);
  for (size_t first = 0; first < work->box_count; first += GROUP) {
    if (bound_of(&work->groups[first / GROUP], g, size) <= best.height) {
      continue;
    }
    for (size_t block = first; block < first + GROUP && block < work->box_count; ++block) {
      if (bound_of(&work->boxes[block], g, size) > best.height) {
        look_into(work, g, block, &best);
      }
    }
  }
  return best;
}

/* Bound how far a box rises above the highest vertex along any direction in a cone of tangent
 * `slope` about the given one, negative if it holds no highest vertex. */
static double margin_of(const block_box *box, const double *g, const double *size,
                        const summit *top, double slope) {
  const double far = supine_distance(box->centre, top->point) + supine_length(box->half);
  return bound_of(box, g, size) - top->height + slope * far;
}

/* Copy the vertices that may be highest along some direction within an angle of g, whose tangent
 * is `slope`: with p the highest along g, q rises above it only if g.(p - q) <= slope |p - q|.
 * Return their number; CANDIDATES + 1: too many. */
static size_t find_candidates(const range_work *work, const double *g, double slope,
                              const summit *top, double *points) {
  const double size[3] = {fabs(g[0]), fabs(g[1]), fabs(g[2])};
  size_t count = 0;
  for (size_t first = 0; first < work->box_count; first += GROUP) {
    if (margin_of(&work->groups[first / GROUP], g, size, top, slope) < 0.0) {
      continue;
    }
    for (size_t block = first; block < first + GROUP && block < work->box_count; ++block) {
      if (margin_of(&work->boxes[block], g, size, top, slope) < 0.0) {
        continue;
      }
      for (size_t i = 0; i < block_size(work, block); ++i) {
        const double *q = work->vertices + 3 * (block * BLOCK + i);
        if (top->height - supine_dot(g, q) > slope * supine_distance(top->point, q) + 1e-9) {
          continue;
        }
        if (count == CANDIDATES) {
          return CANDIDATES + 1;
        }
        memcpy(points + 3 * count++, q, 3 * sizeof *q);
      }
    }
  }
  return count;
}

/* Find the largest sign g.p for a run of neighbouring directions, which share candidates. */
static void search_run(const range_work *work, size_t begin, size_t end, double sign, size_t *seed,
                       double *out) {
  const double *centre = work->directions + 3 * (begin + (end - begin) / 2);
  const double g[3] = {sign * centre[0], sign * centre[1], sign * centre[2]};
  const summit top = highest(work, g, *seed);
  double points[3 * CANDIDATES];
  double least = 1.0; /* cosine to the centre */
  *seed = top.block;
  for (size_t d = begin; d < end; ++d) {
    least = fmin(least, supine_dot(centre, work->directions + 3 * d));
  }
  const double slope = sqrt(fmax(0.0, 1.0 - least * least)) / least + 1e-7; /* margin for
                                                                             * rounding */
  const size_t count = end - begin == 1 ? 0 : find_candidates(work, g, slope, &top, points);
  for (size_t d = begin; d < end; ++d) {
    const double *at = work->directions + 3 * d;
    const double seen[3] = {sign * at[0], sign * at[1], sign * at[2]};
    double best = end - begin == 1 ? top.height : -INFINITY;
    if (count > CANDIDATES) {
      best = highest(work, seen, *seed).height;
    }
    for (size_t i = 0; i < count && count <= CANDIDATES; ++i) {
      const double h = supine_dot(seen, points + 3 * i);
      best = h > best ? h : best;
    }
    out[d] = sign * best;
  }
}

static void height_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const range_work *work = context;
  size_t top = 0;
  size_t bottom = 0;
  for (size_t d = begin; d < end;) {
    size_t last = d + 1;
    while (last < end && last < d + RUN &&
           supine_dot(work->directions + 3 * d, work->directions + 3 * last) > run_cosine) {
      ++last;
    }
    search_run(work, d, last, 1.0, &top, work->maximum);
    search_run(work, d, last, -1.0, &bottom, work->minimum);
    d = last;
  }
}

/* Find the cell of the mesh's box that holds a vertex, numbered along the curve. */
static size_t cell_of(const block_box *box, const double *p) {
  size_t cell = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double share = 0.5 + 0.5 * (p[k] - box->centre[k]) / box->half[k]; /* within 0 to 1 */
    const size_t step = (size_t)(share * ((1 << CELL_BITS) - 1));
    for (size_t bit = 0; bit < CELL_BITS; ++bit) {
      cell |= (step >> bit & 1) << (3 * bit + k);
    }
  }
  return cell;
}

/* Sort the vertices along the curve by counting sort. */
static void sort_vertices(const supine_mesh *mesh, size_t *begin, double *sorted) {
  const block_box box = box_of(mesh->vertices, mesh->vertex_count);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    ++begin[cell_of(&box, mesh->vertices + 3 * i) + 1];
  }
  for (size_t c = 0; c < CELLS; ++c) {
    begin[c + 1] += begin[c];
  }
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    const double *p = mesh->vertices + 3 * i;
    memcpy(sorted + 3 * begin[cell_of(&box, p)]++, p, 3 * sizeof *p);
  }
}

static supine_status range_of(const supine_mesh *mesh, size_t count, const double *directions,
                              double *minimum, double *maximum) {
  const size_t box_count = (mesh->vertex_count + BLOCK - 1) / BLOCK;
  block_box *boxes = malloc((box_count + 1) * sizeof *boxes);
  block_box *groups = malloc((box_count / GROUP + 1) * sizeof *groups);
  double *sorted = malloc((3 * mesh->vertex_count + 1) * sizeof *sorted);
  size_t *begin = calloc(CELLS + 1, sizeof *begin);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (boxes != NULL && groups != NULL && sorted != NULL && begin != NULL) {
    range_work work = {mesh->vertex_count, sorted,     boxes,   groups,
                       box_count,          directions, minimum, maximum};
    sort_vertices(mesh, begin, sorted);
    for (size_t b = 0; b < box_count; ++b) {
      boxes[b] = box_of(sorted + 3 * b * BLOCK, block_size(&work, b));
    }
    for (size_t b = 0; b < box_count; b += GROUP) {
      const size_t left = mesh->vertex_count - b * BLOCK;
      groups[b / GROUP] =
          box_of(sorted + 3 * b * BLOCK, left < GROUP * BLOCK ? left : GROUP * BLOCK);
    }
    supine_parallel_for(count, 16, 0, height_range, &work);
    status = SUPINE_OK;
  }
  free(boxes);
  free(groups);
  free(sorted);
  free(begin);
  return status;
}

/* Extend the range by the mirror image: p mirrored in the plane x = m has the height g'.p + 2 m
 * g_x, where g' is the mirror image of g. */
static supine_status pair_range(const supine_lungs *lungs, size_t count, const double *directions,
                                double *minimum, double *maximum) {
  double *mirrored = malloc(5 * count * sizeof *mirrored);
  if (mirrored == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  double *low = mirrored + 3 * count;
  double *high = mirrored + 4 * count;
  for (size_t i = 0; i < 3 * count; ++i) {
    mirrored[i] = i % 3 == 0 ? -directions[i] : directions[i];
  }
  const supine_status status = range_of(&lungs->mesh, count, mirrored, low, high);
  for (size_t d = 0; d < count && status == SUPINE_OK; ++d) {
    const double shift = 2.0 * lungs->midline * directions[3 * d];
    minimum[d] = fmin(minimum[d], low[d] + shift);
    maximum[d] = fmax(maximum[d], high[d] + shift);
  }
  free(mirrored);
  return status;
}

supine_status supine_physics_height_range(const supine_lungs *lungs, bool pair, size_t count,
                                          const double *directions, double *minimum,
                                          double *maximum) {
  const supine_status status = range_of(&lungs->mesh, count, directions, minimum, maximum);
  return status == SUPINE_OK && pair && lungs->lung_count == 1
             ? pair_range(lungs, count, directions, minimum, maximum)
             : status;
}
