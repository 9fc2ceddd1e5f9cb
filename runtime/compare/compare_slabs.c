/* SPDX-License-Identifier: MIT */
/* Compute ventilation by height: the volume that a breath adds between two heights. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include <supine/compare.h>

#include "base/vec3.h"
#include "runtime/internal.h"

enum { BEFORE, AFTER, TIMES };

/* A vertex of the surface, or a point where a plane cuts an edge of a triangle. */
typedef struct corner {
  double at[TIMES][3]; /* [BEFORE, AFTER] positions, mm */
  double level;        /* coordinate along gravity before the breath, mm; larger is lower */
} corner;

/* A triangle of the surface, or its part between two horizontal planes: at most five corners. */
typedef struct polygon {
  size_t count;
  corner corner[6];
} polygon;

/* Sums over the edges of the outline along which a horizontal plane cuts the surface. Each edge is
 * oriented as in the boundary of the part of its triangle above the plane. */
typedef struct outline {
  double length;           /* total length of the edges before the breath, mm */
  double middle[TIMES][3]; /* [BEFORE, AFTER] sum of edge midpoint times initial length, mm^2 */
  double area[TIMES][3];   /* [BEFORE, AFTER] sum of cross product of start and end, mm^2 */
} outline;

/* Horizontal planes that cut the lungs into slabs, and the outlines of one lung in these planes. */
typedef struct cutter {
  const float *from;                  /* [N, 3] positions before the breath, mm */
  double down[3];                     /* unit vector along gravity */
  size_t count;                       /* number of slabs */
  double level[SUPINE_SLABS_MAX + 1]; /* coordinate of each plane along gravity, mm */
  outline cut[SUPINE_SLABS_MAX + 1];  /* outline of the lung in each plane */
} cutter;

/* Read a vertex, before and after the breath. To reduce rounding errors, move the origin to the
 * position of vertex 0 before the breath. */
static corner read_corner(const cutter *c, const float *xyz, size_t vertex) {
  corner out;
  for (size_t i = 0; i < 3; ++i) {
    out.at[BEFORE][i] = (double)c->from[3 * vertex + i] - (double)c->from[i];
    out.at[AFTER][i] = (double)xyz[3 * vertex + i] - (double)c->from[i];
  }
  out.level = supine_dot(c->down, out.at[BEFORE]);
  return out;
}

/* Add the volume, mL, of the cone between the origin and a polygon to slab->volume. Add the change
 * of this volume in the breath to slab->gain. */
static void add_polygon(const polygon *p, supine_slab *slab) {
  double volume[TIMES] = {0};
  for (size_t i = 1; i + 1 < p->count; ++i) {
    for (int time = 0; time < TIMES; ++time) {
      double cross[3];
      supine_cross(p->corner[i].at[time], p->corner[i + 1].at[time], cross);
      volume[time] += 1e-3 / 6 * supine_dot(p->corner[0].at[time], cross);
    }
  }
  slab->volume += volume[BEFORE];
  slab->gain += volume[AFTER] - volume[BEFORE];
}

static corner cross_level(const corner *a, const corner *b, double level) {
  corner out = {.level = level};
  const double share = (level - a->level) / (b->level - a->level);
  for (int k = 0; k < 3 * TIMES; ++k) {
    const double from = a->at[k / 3][k % 3];
    out.at[k / 3][k % 3] = from + share * (b->at[k / 3][k % 3] - from);
  }
  return out;
}

static void add_edge(const corner *p, const corner *q, outline *cut) {
  const double length = supine_distance(p->at[BEFORE], q->at[BEFORE]);
  cut->length += length;
  for (int time = 0; time < TIMES; ++time) {
    double cross[3];
    supine_cross(p->at[time], q->at[time], cross);
    for (int i = 0; i < 3; ++i) {
      cut->middle[time][i] += length * (p->at[time][i] + q->at[time][i]) / 2;
      cut->area[time][i] += cross[i];
    }
  }
}

/* Split a polygon by a plane at `level`, a coordinate along gravity within the polygon's height.
 * Add the new edge to `cut`.
 * @param above, below  written; must not be `p` */
static void split(const polygon *p, double level, polygon *above, polygon *below, outline *cut) {
  corner end[2] = {{.level = level}, {.level = level}};
  above->count = below->count = 0;
  for (size_t i = 0; i < p->count; ++i) {
    const corner *a = &p->corner[i];
    const corner *b = &p->corner[(i + 1) % p->count];
    polygon *side = a->level < level ? above : below;
    side->corner[side->count++] = *a;
    if ((a->level < level) != (b->level < level)) {
      const corner point = cross_level(a, b, level);
      end[a->level < level ? 0 : 1] = point;
      above->corner[above->count++] = point;
      below->corner[below->count++] = point;
    }
  }
  add_edge(&end[0], &end[1], cut);
}

static size_t slab_of(const cutter *c, double t) {
  size_t slab = 0;
  while (slab + 1 < c->count && c->level[slab + 1] <= t) {
    ++slab;
  }
  return slab;
}

static void add_triangle(cutter *c, const polygon *triangle, supine_slab *slabs) {
  const corner *v = triangle->corner;
  const size_t last = slab_of(c, fmax(v[0].level, fmax(v[1].level, v[2].level)));
  polygon rest = *triangle;
  for (size_t slab = slab_of(c, fmin(v[0].level, fmin(v[1].level, v[2].level))); slab < last;
       ++slab) {
    polygon above;
    polygon below;
    split(&rest, c->level[slab + 1], &above, &below, &c->cut[slab + 1]);
    add_polygon(&above, &slabs[slab]);
    rest = below;
  }
  add_polygon(&rest, &slabs[last]);
}

/* Close the slabs above and below an outline by triangles. Each triangle joins one edge of the
 * outline to the mean point of the outline. */
static void close_cut(const outline *cut, supine_slab *above, supine_slab *below) {
  double volume[TIMES]; /* [BEFORE, AFTER] between the origin and the triangles, signed, mL */
  if (cut->length > 0) {
    for (int time = 0; time < TIMES; ++time) {
      volume[time] = 1e-3 / 6 * supine_dot(cut->middle[time], cut->area[time]) / cut->length;
    }
    above->volume -= volume[BEFORE];
    above->gain -= volume[AFTER] - volume[BEFORE];
    below->volume += volume[BEFORE];
    below->gain += volume[AFTER] - volume[BEFORE];
  }
}

static void cut_lung(cutter *c, const supine_basis *basis, size_t lung, const float *xyz,
                     supine_slab *slabs) {
  memset(c->cut, 0, sizeof c->cut);
  memset(slabs, 0, c->count * sizeof *slabs);
  for (size_t i = 0; i < basis->info.triangle_count; ++i) {
    const uint32_t *vertex = basis->info.triangles + 3 * i;
    if (vertex[0] >= basis->lung_begin[lung] && vertex[0] < basis->lung_begin[lung + 1]) {
      polygon triangle = {.count = 3};
      for (size_t v = 0; v < 3; ++v) {
        triangle.corner[v] = read_corner(c, xyz, vertex[v]);
      }
      add_triangle(c, &triangle, slabs);
    }
  }
  for (size_t slab = 0; slab + 1 < c->count; ++slab) {
    close_cut(&c->cut[slab + 1], &slabs[slab], &slabs[slab + 1]);
  }
}

supine_status supine_compare_slabs(const supine_basis *basis, const double gravity[3],
                                   const float *from, const float *xyz, size_t count,
                                   supine_slab *slabs, supine_error *error) {
  cutter c = {.from = from != NULL ? from : basis->info.vertices, .count = count};
  if (count == 0 || count > SUPINE_SLABS_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "%zu slabs: give 1 to %d", count,
                            (int)SUPINE_SLABS_MAX);
  }
  if (!supine_normalise(gravity, c.down)) {
    return supine_basis_refuse_gravity(error);
  }
  if (!basis->info.has_volume) {
    return supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                            "the surface is open and encloses no volume: close the mesh first");
  }
  double lowest = -INFINITY;
  double highest = INFINITY;
  for (size_t i = 0; i < basis->info.vertex_count; ++i) {
    const double level = read_corner(&c, xyz, i).level;
    const float *p = xyz + 3 * i;
    if (!isfinite(level) || !isfinite(p[0] + p[1] + p[2])) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "the position of vertex %zu is not finite", i);
    }
    highest = fmin(highest, level);
    lowest = fmax(lowest, level);
  }
  for (size_t i = 0; i <= count; ++i) {
    c.level[i] = highest + (lowest - highest) * (double)i / (double)count;
  }
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    cut_lung(&c, basis, lung, xyz, slabs + lung * count);
  }
  return SUPINE_OK;
}
