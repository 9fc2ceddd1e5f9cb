/* SPDX-License-Identifier: MIT */
/* Compute ventilation by height: the volume that the tissue between two heights gains. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "sh/base/vec3.h"

#include "runtime/compare/compare_internal.h"

/* Sums over the part of a lung's surface above a cut. Levels t increase along gravity g, so that
 * "above" a cut is at smaller t. u is the displacement and N the area vector of a piece, mm. */
typedef struct part {
  double sweep;     /* sum of u.N: the volume that the part sweeps */
  double volume;    /* sum of t (g.N) */
  double area;      /* sum of g.N: minus the area of the cut that closes the part */
  double moment[2]; /* sum of (x, y) (g.N): minus the moments of the cut */
} part;

/* Sums along the outline of a cut, weighted by length, to fit a plane to u.g by least squares. */
typedef struct outline {
  double length, x, y, xx, xy, yy, u, xu, yu;
} outline;

/* A triangle in axes (x, y, t) with t along gravity, mm. */
typedef struct triangle {
  double at[3][3];   /* corners before the breath: x, y, t */
  double u[3][3];    /* displacements of the corners */
  double normal[3];  /* area vector before the breath, mm^2 */
  double average[3]; /* area vector, averaged over the motion, mm^2 */
} triangle;

/* The slabs, and the sums of one lung at the levels between them. */
typedef struct cutter {
  const float *from;                  /* [N, 3] positions before the breath */
  double axis[3][3];                  /* axes x, y and gravity */
  size_t count;                       /* number of slabs */
  double level[SUPINE_SLABS_MAX + 1]; /* t at which slab i begins, mm; the last: where all end */
  part above[SUPINE_SLABS_MAX + 1];   /* parts above each level of the triangles that it cuts */
  outline line[SUPINE_SLABS_MAX + 1]; /* outline of the cut at each level */
} cutter;

static void add_cross(const double *a, const double *b, double factor, double *sum) {
  double product[3];
  supine_cross(a, b, product);
  for (int i = 0; i < 3; ++i) {
    sum[i] += factor * product[i];
  }
}

/* Choose orthonormal axes with the third along gravity; false if it has no direction. */
static bool make_axes(const double gravity[3], double axis[3][3]) {
  double *g = axis[2];
  if (!supine_normalise(gravity, g)) {
    return false;
  }
  double seed[3] = {0, 0, 0};
  seed[fabs(g[0]) < 0.6 ? 0 : 1] = 1;
  supine_cross(g, seed, axis[0]);
  const double across = supine_length(axis[0]);
  for (int i = 0; i < 3; ++i) {
    axis[0][i] /= across;
  }
  supine_cross(g, axis[0], axis[1]);
  return true;
}

static void place(const cutter *c, const float *point, const float *origin, double *out) {
  const double p[3] = {(double)point[0] - (double)origin[0], (double)point[1] - (double)origin[1],
                       (double)point[2] - (double)origin[2]};
  for (int i = 0; i < 3; ++i) {
    out[i] = supine_dot(c->axis[i], p);
  }
}

static void read_triangle(const cutter *c, const float *xyz, const uint32_t *corner, triangle *t) {
  for (int v = 0; v < 3; ++v) {
    const float *rest = c->from + 3 * (size_t)corner[v];
    place(c, rest, c->from, t->at[v]);
    place(c, xyz + 3 * (size_t)corner[v], rest, t->u[v]);
  }
  double e[2][3];
  double f[2][3];
  for (int v = 0; v < 2; ++v) {
    for (int i = 0; i < 3; ++i) {
      e[v][i] = t->at[v + 1][i] - t->at[0][i];
      f[v][i] = t->u[v + 1][i] - t->u[0][i];
    }
  }
  /* 1/2 integral over 0 <= s <= 1 of (e + s f) x (e' + s f') */
  memset(t->normal, 0, sizeof t->normal);
  add_cross(e[0], e[1], 0.5, t->normal);
  memcpy(t->average, t->normal, sizeof t->normal);
  add_cross(e[0], f[1], 0.25, t->average);
  add_cross(f[0], e[1], 0.25, t->average);
  add_cross(f[0], f[1], 1.0 / 6, t->average);
}

/* Add a piece of a triangle to the sums. `m` are the integrals of the barycentric coordinates over
 * the piece, divided by the area of the triangle. */
static void add_piece(const triangle *t, const double m[3], part *sum) {
  for (int v = 0; v < 3; ++v) {
    const double down = m[v] * t->normal[2];
    sum->sweep += m[v] * supine_dot(t->u[v], t->average);
    sum->volume += down * t->at[v][2];
    sum->area += down;
    sum->moment[0] += down * t->at[v][0];
    sum->moment[1] += down * t->at[v][1];
  }
}

static void add_segment(const double p[3], const double q[3], double u, outline *line) {
  const double x = (p[0] + q[0]) / 2;
  const double y = (p[1] + q[1]) / 2;
  const double length = sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]));
  line->length += length;
  line->x += length * x;
  line->y += length * y;
  line->xx += length * x * x;
  line->xy += length * x * y;
  line->yy += length * y * y;
  line->u += length * u;
  line->xu += length * x * u;
  line->yu += length * y * u;
}

/* Cut a triangle at a level between its corners; add the piece above the level to `sum`, and the
 * cut edge to `line`. */
static void cut(const triangle *t, double level, part *sum, outline *line) {
  int lone = 0; /* the corner that is alone on its side */
  int before = 0;
  for (int v = 0; v < 3; ++v) {
    before += t->at[v][2] < level;
  }
  while ((t->at[lone][2] < level) != (before == 1)) {
    ++lone;
  }
  const int other[2] = {(lone + 1) % 3, (lone + 2) % 3};
  double share[2];
  double end[2][3];
  double down = 0;
  for (int i = 0; i < 2; ++i) {
    const double *a = t->at[lone];
    const double *b = t->at[other[i]];
    share[i] = (level - a[2]) / (b[2] - a[2]);
    for (int k = 0; k < 3; ++k) {
      end[i][k] = a[k] + share[i] * (b[k] - a[k]);
    }
    down += t->u[lone][2] + share[i] * (t->u[other[i]][2] - t->u[lone][2]);
  }
  const double area = share[0] * share[1];
  double m[3];
  m[lone] = area * (1 - (share[0] + share[1]) / 3);
  m[other[0]] = area * share[0] / 3;
  m[other[1]] = area * share[1] / 3;
  for (int v = 0; v < 3 && before == 2; ++v) {
    m[v] = 1.0 / 3 - m[v];
  }
  add_piece(t, m, sum);
  add_segment(end[0], end[1], down / 2, line);
}

/* Find the slab that holds level t. */
static size_t slab_of(const cutter *c, double t) {
  size_t slab = 0;
  while (slab + 1 < c->count && c->level[slab + 1] <= t) {
    ++slab;
  }
  return slab;
}

static void add_triangle(cutter *c, const triangle *t, part *whole) {
  static const double full[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};
  size_t first = c->count;
  size_t last = 0;
  for (int v = 0; v < 3; ++v) {
    const size_t slab = slab_of(c, t->at[v][2]);
    first = slab < first ? slab : first;
    last = slab > last ? slab : last;
  }
  for (size_t level = first + 1; level <= last; ++level) {
    cut(t, c->level[level], &c->above[level], &c->line[level]);
  }
  add_piece(t, full, &whole[last + 1]);
}

/* Compute the flux of u.g through a cut: its area times the mean of u.g over it. The mean is
 * approximated by a plane fitted to u.g along the outline, evaluated at the centroid of the cut. */
static double cut_flux(const part *before, const outline *line) {
  const double area = -before->area;
  if (!(line->length > 0) || area == 0) {
    return 0;
  }
  const double x = line->x / line->length;
  const double y = line->y / line->length;
  const double u = line->u / line->length;
  const double xx = line->xx / line->length - x * x;
  const double xy = line->xy / line->length - x * y;
  const double yy = line->yy / line->length - y * y;
  const double xu = line->xu / line->length - x * u;
  const double yu = line->yu / line->length - y * u;
  const double determinant = xx * yy - xy * xy;
  if (!(determinant > 1e-6 * (xx + yy) * (xx + yy))) {
    return area * u; /* too thin to fit a plane to */
  }
  const double slope_x = (xu * yy - yu * xy) / determinant;
  const double slope_y = (yu * xx - xu * xy) / determinant;
  return area * u + slope_x * (-before->moment[0] - area * x) +
         slope_y * (-before->moment[1] - area * y);
}

static void cut_lung(cutter *c, const supine_basis *basis, size_t lung, const float *xyz,
                     supine_slab *slabs) {
  part whole[SUPINE_SLABS_MAX + 1]; /* [slab + 1]: triangles whose lowest corner is in the slab */
  memset(whole, 0, sizeof whole);
  memset(c->above, 0, sizeof c->above);
  memset(c->line, 0, sizeof c->line);
  for (size_t i = 0; i < basis->info.triangle_count; ++i) {
    const uint32_t *corner = basis->info.triangles + 3 * i;
    if (corner[0] >= basis->lung_begin[lung] && corner[0] < basis->lung_begin[lung + 1]) {
      triangle t;
      read_triangle(c, xyz, corner, &t);
      add_triangle(c, &t, whole);
    }
  }
  part so_far = {0};
  double flux = 0; /* through the cut above the slab */
  part above = {0};
  for (size_t slab = 0; slab < c->count; ++slab) {
    const part *add = &whole[slab + 1];
    so_far.sweep += add->sweep;
    so_far.volume += add->volume;
    so_far.area += add->area;
    so_far.moment[0] += add->moment[0];
    so_far.moment[1] += add->moment[1];
    part here = so_far;
    const part *cuts = &c->above[slab + 1];
    double next = 0;
    if (slab + 1 < c->count) {
      here.sweep += cuts->sweep;
      here.volume += cuts->volume;
      here.area += cuts->area;
      here.moment[0] += cuts->moment[0];
      here.moment[1] += cuts->moment[1];
      next = cut_flux(&here, &c->line[slab + 1]);
      here.volume -= c->level[slab + 1] * here.area; /* closed by the cut */
    }
    slabs[slab].volume = 1e-3 * (here.volume - above.volume);
    slabs[slab].gain = 1e-3 * (here.sweep - above.sweep + next - flux);
    above = here;
    flux = next;
  }
}

supine_status supine_compare_slabs(const supine_basis *basis, const double gravity[3],
                                   const float *from, const float *xyz, size_t count,
                                   supine_slab *slabs, supine_error *error) {
  cutter c = {.from = from != NULL ? from : basis->info.vertices, .count = count};
  if (count == 0 || count > SUPINE_SLABS_MAX || !make_axes(gravity, c.axis)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%zu slabs: give 1 to %d; or gravity has no direction", count,
                            (int)SUPINE_SLABS_MAX);
  }
  if (!basis->info.has_volume) {
    return supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                            "the surface is open and encloses no volume");
  }
  double lowest = -INFINITY;
  double highest = INFINITY;
  for (size_t i = 0; i < basis->info.vertex_count; ++i) {
    double at[3];
    place(&c, c.from + 3 * i, c.from, at);
    highest = fmin(highest, at[2]);
    lowest = fmax(lowest, at[2]);
  }
  for (size_t i = 0; i <= count; ++i) {
    c.level[i] = highest + (lowest - highest) * (double)i / (double)count;
  }
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    cut_lung(&c, basis, lung, xyz, slabs + lung * count);
  }
  return SUPINE_OK;
}
