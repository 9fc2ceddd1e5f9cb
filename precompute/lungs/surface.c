/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find nearest points and winding numbers with a tree of bounding boxes over triangles. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/clones.h"
#include "base/parallel.h"
#include "base/vec3.h"

#include "precompute/lungs/surface.h"

enum { LEAF = 8, DISTANCE_GRAIN = 64 };

/* A dipole replaces the triangles of a tree node farther away than this multiple of dipole.radius.
 * The error of the winding number, which is compared with 0.5, is then less than 0.01. */
static const double dipole_distance = 2.0;
/* Points nearer to the surface than this, mm, count as inside: positions are rounded to float32. */
static const double on_surface = 1e-3;

typedef struct node {
  double low[3], high[3];
  uint32_t begin, end; /* triangles of the node: order[begin] to order[end - 1] */
  uint32_t right;      /* index of the second child (the first is the next node); 0 in a leaf */
  uint32_t leaf;       /* of a leaf: index in supine_lungs_surface.leaves */
} node;

/* The dipole that replaces the triangles of a tree node, seen from a distant point. */
typedef struct dipole {
  double area, centre[3]; /* total area of the triangles, mm^2, and their centroid, mm */
  double normal[3];       /* sum over the triangles of area times unit normal, mm^2 */
  double radius;          /* radius of a ball about `centre` that contains the node's box, mm */
} dipole;

/* Bounding boxes of the triangles of a leaf: least and greatest x, y and z, rounded outwards. */
typedef struct boxes {
  float low[3][LEAF], high[3][LEAF];
} boxes;

struct supine_lungs_surface {
  supine_arena arena; /* holds this struct and its arrays */
  const double *vertices;
  const uint32_t *triangles;
  size_t triangle_count;
  uint32_t *order; /* indices of all triangles, leaf by leaf */
  node *nodes;
  dipole *dipoles; /* [nodes]; NULL if only distances are wanted */
  uint32_t node_count;
  boxes *leaves; /* [leaf_count] bounding boxes of the triangles of each leaf */
  uint32_t leaf_count;
};

static void corners(const supine_lungs_surface *s, size_t triangle, const double *corner[3]) {
  for (int k = 0; k < 3; ++k) {
    corner[k] = s->vertices + 3 * (size_t)s->triangles[3 * triangle + (size_t)k];
  }
}

typedef struct keyed {
  double key;
  uint32_t triangle;
} keyed;

/* Move the `half` items with the least keys to the front (quickselect by Hoare). */
static void select_least(keyed *item, ptrdiff_t count, ptrdiff_t half) {
  ptrdiff_t low = 0;
  ptrdiff_t high = count - 1;
  while (low < high) {
    const double pivot = item[low + (high - low) / 2].key;
    ptrdiff_t up = low;
    ptrdiff_t down = high;
    while (up <= down) {
      while (item[up].key < pivot) {
        ++up;
      }
      while (item[down].key > pivot) {
        --down;
      }
      if (up <= down) {
        const keyed other = item[up];
        item[up++] = item[down];
        item[down--] = other;
      }
    }
    /* Item `half` lies at or before `down`, at or after `up`, or between them in its place. */
    low = down < half ? up : low;
    high = up > half ? down : high;
  }
}

/* Extend the bounding box of a tree node to its triangles and, if `leaf` is not NULL, find the box
 * of each triangle. */
static void find_box(const supine_lungs_surface *s, node *n, boxes *leaf) {
  for (size_t i = n->begin; i < n->end; ++i) {
    const double *p[3];
    double low[3];
    double high[3];
    corners(s, s->order[i], p);
    supine_box_begin(low, high);
    for (int k = 0; k < 3; ++k) {
      supine_box_add(p[k], low, high);
      supine_box_add(p[k], n->low, n->high);
    }
    if (leaf != NULL) {
      for (int k = 0; k < 3; ++k) {
        leaf->low[k][i - n->begin] = nextafterf((float)low[k], -INFINITY);
        leaf->high[k][i - n->begin] = nextafterf((float)high[k], INFINITY);
      }
    }
  }
}

/* Add triangles to a dipole. Until all are added, d->centre is the sum of area times centroid. */
static void add_part(dipole *d, double area, const double centre[3], const double normal[3]) {
  d->area += area;
  for (int k = 0; k < 3; ++k) {
    d->centre[k] += area * centre[k];
    d->normal[k] += normal[k];
  }
}

/* Compute the dipole of a leaf from its triangles, or of another tree node from its children. */
static void find_dipole(const supine_lungs_surface *s, const node *n) {
  if (s->dipoles == NULL) {
    return;
  }
  dipole *d = &s->dipoles[n - s->nodes];
  *d = (dipole){0};
  if (n->right != 0) {
    const dipole *child[2] = {d + 1, &s->dipoles[n->right]};
    for (int i = 0; i < 2; ++i) {
      add_part(d, child[i]->area, child[i]->centre, child[i]->normal);
    }
  }
  if (n->right == 0) {
    for (size_t i = n->begin; i < n->end; ++i) {
      const double *p[3];
      double normal[3];
      double centre[3];
      corners(s, s->order[i], p);
      supine_normal(p[0], p[1], p[2], normal);
      for (int k = 0; k < 3; ++k) {
        normal[k] *= 0.5;
        centre[k] = (p[0][k] + p[1][k] + p[2][k]) / 3.0;
      }
      add_part(d, sqrt(supine_dot(normal, normal)), centre, normal);
    }
  }
  double square = 0.0;
  for (int k = 0; k < 3; ++k) {
    d->centre[k] = d->area > 0.0 ? d->centre[k] / d->area : 0.5 * (n->low[k] + n->high[k]);
    const double reach = fmax(n->high[k] - d->centre[k], d->centre[k] - n->low[k]);
    square += reach * reach;
  }
  d->radius = sqrt(square);
}

/* Build the tree node of the triangles order[begin] to order[end - 1], and its descendants. */
static void build(supine_lungs_surface *s, keyed *space, uint32_t begin, uint32_t end) {
  node *n = &s->nodes[s->node_count++];
  n->begin = begin;
  n->end = end;
  n->right = 0;
  if (end - begin <= LEAF) {
    n->leaf = s->leaf_count++;
    return;
  }
  supine_box_begin(n->low, n->high);
  find_box(s, n, NULL);
  int axis = 0;
  for (int k = 1; k < 3; ++k) {
    axis = n->high[k] - n->low[k] > n->high[axis] - n->low[axis] ? k : axis;
  }
  for (size_t i = begin; i < end; ++i) {
    const double *p[3];
    corners(s, s->order[i], p);
    space[i] = (keyed){p[0][axis] + p[1][axis] + p[2][axis], s->order[i]};
  }
  const uint32_t middle = begin + (end - begin) / 2;
  select_least(space + begin, end - begin, middle - begin);
  for (size_t i = begin; i < end; ++i) {
    s->order[i] = space[i].triangle;
  }
  build(s, space, begin, middle);
  n->right = s->node_count;
  build(s, space, middle, end);
}

void supine_lungs_surface_refit(supine_lungs_surface *surface) {
  for (node *n = surface->nodes + surface->node_count; n-- > surface->nodes;) {
    const node *child[2] = {n + 1, &surface->nodes[n->right]};
    supine_box_begin(n->low, n->high);
    if (n->right != 0) {
      for (int c = 0; c < 2; ++c) {
        supine_box_add(child[c]->low, n->low, n->high);
        supine_box_add(child[c]->high, n->low, n->high);
      }
    }
    if (n->right == 0) {
      find_box(surface, n, &surface->leaves[n->leaf]);
    }
    find_dipole(surface, n);
  }
}

supine_status supine_lungs_surface_create(const double *vertices, size_t count,
                                          const uint32_t *triangles, bool sides,
                                          supine_lungs_surface **surface, supine_error *error) {
  const size_t leaves = 2 * count / LEAF + 1; /* upper bound: each leaf is at least half full */
  *surface = NULL;
  SUPINE_ARENA temporary = {0};
  SUPINE_ARENA arena = {0};
  keyed *space = supine_arena_take(&temporary, count, sizeof *space);
  supine_lungs_surface *s = supine_arena_take(&arena, 1, sizeof *s);
  const supine_lungs_surface made = {
      .vertices = vertices,
      .triangles = triangles,
      .triangle_count = count,
      .order = supine_arena_take(&arena, count, sizeof *s->order),
      .nodes = supine_arena_take(&arena, 2 * leaves, sizeof *s->nodes),
      .dipoles = sides ? supine_arena_take(&arena, 2 * leaves, sizeof *s->dipoles) : NULL,
      .leaves = supine_arena_take(&arena, leaves, sizeof *s->leaves)};
  if (temporary.failed || arena.failed) {
    return supine_error_memory(error, "a tree of %zu triangles", count);
  }
  *s = made;
  for (uint32_t i = 0; i < count; ++i) {
    s->order[i] = i;
  }
  build(s, space, 0, (uint32_t)count);
  supine_lungs_surface_refit(s);
  s->arena = arena;
  arena = (supine_arena){0};
  *surface = s;
  return SUPINE_OK;
}

void supine_lungs_surface_destroy(supine_lungs_surface *surface) {
  if (surface != NULL) {
    supine_arena arena = surface->arena;
    supine_arena_free(&arena);
  }
}

/* Return the position on an edge, from 0 at its start to 1 at its end, of the point nearest to x.
 * `offset` is the vector from the start of the edge to x. */
static double along(const double offset[3], const double edge[3]) {
  const double length = supine_dot(edge, edge);
  const double t = length > 0.0 ? supine_dot(offset, edge) / length : 0.0;
  if (t > 1.0) {
    return 1.0;
  }
  return t > 0.0 ? t : 0.0;
}

/* Find the barycentric coordinates b of the point nearest to x in a triangle. Return false, with b
 * undefined, if the triangle's squared distance from x certainly exceeds `best`. */
static bool nearest_in_triangle(const double *const p[3], const double x[3], double best,
                                double b[3]) {
  /* The barycentric coordinates b are inexact if sin^2 of the angle at p[0] is below this. */
  static const double slender = 1e-4;
  double u[3];
  double v[3];
  double w[3];
  supine_subtract(p[1], p[0], u);
  supine_subtract(p[2], p[0], v);
  supine_subtract(x, p[0], w);
  const double uu = supine_dot(u, u);
  const double uv = supine_dot(u, v);
  const double vv = supine_dot(v, v);
  const double uw = supine_dot(u, w);
  const double vw = supine_dot(v, w);
  const double determinant = uu * vv - uv * uv;
  b[1] = (vv * uw - uv * vw) / determinant;
  b[2] = (uu * vw - uv * uw) / determinant;
  b[0] = 1.0 - b[1] - b[2];
  if (b[0] >= 0.0 && b[1] >= 0.0 && b[2] >= 0.0) {
    return true;
  }
  const double ww = supine_dot(w, w);
  const double opposite_square[3] = {uu + vv - 2.0 * uv, vv, uu};
  /* `best` minus the squared distance of x from the triangle's plane, plus a margin for rounding */
  const double limit = best + 1e-9 * ww - (ww - b[1] * uw - b[2] * vw);
  bool farther = false;
  for (int k = 0; k < 3; ++k) {
    farther |= b[k] < 0.0 && b[k] * b[k] * determinant > limit * opposite_square[k];
  }
  if (farther && determinant > slender * uu * vv) {
    return false;
  }
  double least = INFINITY;
  for (int k = 0; k < 3; ++k) {
    const double *from = p[k];
    const double *to = p[(k + 1) % 3];
    double edge[3];
    double offset[3];
    supine_subtract(to, from, edge);
    supine_subtract(x, from, offset);
    const double t = along(offset, edge);
    double square = 0.0;
    for (int a = 0; a < 3; ++a) {
      const double apart = offset[a] - t * edge[a];
      square += apart * apart;
    }
    if (square < least) {
      least = square;
      b[k] = 1.0 - t;
      b[(k + 1) % 3] = t;
      b[(k + 2) % 3] = 0.0;
    }
  }
  return true;
}

/* Find the squared distance of the point x from the interval [low, high]. */
static inline double gap_square(double low, double high, double x) {
  const double out = low - x > x - high ? low - x : x - high;
  const double apart = out > 0.0 ? out : 0.0;
  return apart * apart;
}

static double box_square(const node *n, const double x[3]) {
  double square = 0.0;
  for (int k = 0; k < 3; ++k) {
    square += gap_square(n->low[k], n->high[k], x[k]);
  }
  return square;
}

SUPINE_CLONES static void boxes_squares(const boxes *leaf, const double x[3], double *square) {
  for (size_t i = 0; i < LEAF; ++i) {
    square[i] = gap_square((double)leaf->low[0][i], (double)leaf->high[0][i], x[0]) +
                gap_square((double)leaf->low[1][i], (double)leaf->high[1][i], x[1]) +
                gap_square((double)leaf->low[2][i], (double)leaf->high[2][i], x[2]);
  }
}

/* Search tree node `at` and its descendants for the point nearest to x. Ignore points at a
 * squared distance of *best or more. If a point is nearer, update *best and `place`. */
static void search(const supine_lungs_surface *s, size_t at, const double x[3], double *best,
                   supine_inside_place *place) {
  const node *n = &s->nodes[at];
  if (n->right != 0) {
    const size_t child[2] = {at + 1, n->right};
    const double square[2] = {box_square(&s->nodes[child[0]], x),
                              box_square(&s->nodes[child[1]], x)};
    const int nearer = square[1] < square[0];
    for (int k = 0; k < 2; ++k) {
      if (square[nearer ^ k] < *best) {
        search(s, child[nearer ^ k], x, best, place);
      }
    }
    return;
  }
  double square[LEAF];
  boxes_squares(&s->leaves[n->leaf], x, square);
  for (size_t i = n->begin; i < n->end; ++i) {
    if (square[i - n->begin] >= *best) {
      continue;
    }
    const double *p[3];
    double b[3];
    double q[3];
    double apart[3];
    corners(s, s->order[i], p);
    if (!nearest_in_triangle(p, x, *best, b)) {
      continue;
    }
    for (int k = 0; k < 3; ++k) {
      q[k] = b[0] * p[0][k] + b[1] * p[1][k] + b[2] * p[2][k];
    }
    supine_subtract(x, q, apart);
    const double apart_square = supine_dot(apart, apart);
    if (apart_square < *best) {
      *best = apart_square;
      place->triangle = s->order[i];
      memcpy(place->nearest, q, sizeof q);
      memcpy(place->barycentric, b, sizeof b);
    }
  }
}

/* Return the solid angle of a triangle seen from x, positive if the triangle faces away from x. */
static double solid_angle(const double *const p[3], const double x[3]) {
  double a[3];
  double b[3];
  double c[3];
  double bc[3];
  supine_subtract(p[0], x, a);
  supine_subtract(p[1], x, b);
  supine_subtract(p[2], x, c);
  supine_cross(b, c, bc);
  const double la = sqrt(supine_dot(a, a));
  const double lb = sqrt(supine_dot(b, b));
  const double lc = sqrt(supine_dot(c, c));
  return 2.0 * atan2(supine_dot(a, bc), la * lb * lc + supine_dot(a, b) * lc +
                                            supine_dot(b, c) * la + supine_dot(c, a) * lb);
}

static double angle(const supine_lungs_surface *s, size_t at, const double x[3]) {
  const node *n = &s->nodes[at];
  const dipole *d = &s->dipoles[at];
  double apart[3];
  supine_subtract(d->centre, x, apart);
  const double distance = sqrt(supine_dot(apart, apart));
  if (distance > dipole_distance * d->radius) {
    return supine_dot(d->normal, apart) / (distance * distance * distance);
  }
  if (n->right != 0) {
    return angle(s, at + 1, x) + angle(s, n->right, x);
  }
  double sum = 0.0;
  for (size_t i = n->begin; i < n->end; ++i) {
    const double *p[3];
    corners(s, s->order[i], p);
    sum += solid_angle(p, x);
  }
  return sum;
}

supine_inside_place supine_lungs_surface_nearest(const supine_lungs_surface *surface,
                                                 const double point[3],
                                                 const supine_inside_place *near) {
  supine_inside_place place = {.point = {point[0], point[1], point[2]}};
  double best = INFINITY;
  if (near != NULL) {
    const double limit =
        (fabs(near->depth) + supine_distance(point, near->point)) * (1.0 + 1e-9) + 1e-9;
    best = limit * limit;
  }
  search(surface, 0, point, &best, &place);
  place.depth = sqrt(best);
  return place;
}

typedef struct distances {
  const supine_lungs_surface *surface;
  const double *points;
  double *distance;
  double *nearest; /* [points, 3] nearest points of the surface, mm; NULL if not wanted */
} distances;

static void distance_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const distances *d = context;
  supine_inside_place place;
  for (size_t i = begin; i < end; ++i) {
    place = supine_lungs_surface_nearest(d->surface, d->points + 3 * i, i > begin ? &place : NULL);
    d->distance[i] = place.depth;
    if (d->nearest != NULL) {
      memcpy(d->nearest + 3 * i, place.nearest, sizeof place.nearest);
    }
  }
}

void supine_lungs_surface_distances(const supine_lungs_surface *surface, size_t count,
                                    const double *points, double *distance, double *nearest) {
  distances all = {surface, points, distance, nearest};
  supine_parallel_for(count, DISTANCE_GRAIN, 0, distance_range, &all);
}

supine_inside_place supine_lungs_surface_find(const supine_lungs_surface *surface,
                                              const double point[3],
                                              const supine_inside_place *near) {
  static const double half = 6.283185307179586; /* half the full solid angle of 4 pi */
  supine_inside_place place = supine_lungs_surface_nearest(surface, point, near);
  const bool inside = place.depth <= on_surface ||
                      (near != NULL && supine_distance(point, near->point) < fabs(near->depth)
                           ? near->depth > 0.0
                           : angle(surface, 0, point) > half);
  place.depth = inside ? place.depth : -place.depth;
  return place;
}
