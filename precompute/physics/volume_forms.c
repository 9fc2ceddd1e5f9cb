/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the change of volume of closed lungs as a polynomial of the weights of modes. */
#include <cblas.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/clones.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "precompute/physics/volume_forms.h"

/* The triangles of each lung are split into PARTS ranges, which are summed separately, BLOCK
 * triangles at a time. The number of ranges is fixed, so that the sums do not depend on the number
 * of threads. */
enum { PARTS = 16, BLOCK = 128 };

static const double sixth_ml = 1e-3 / 6.0; /* volume of a tetrahedron, mL / its determinant, mm^3 */

void supine_physics_volume_forms_free(supine_volume_forms *forms) {
  free(forms->linear);
  free(forms->quadratic);
  free(forms->cubic);
  *forms = (supine_volume_forms){0};
}

typedef struct lung_work {
  const supine_lungs *lungs;
  const supine_rows *rows; /* kind of the rows of `columns` */
  const double *columns;   /* [rows, count] displacements by the modes */
  size_t count;            /* number of modes or other displacement fields in `columns` */
  size_t lung;
  double centre[3]; /* centre of the box of all lungs, mm, subtracted from each vertex */
  double *sums;     /* [PARTS, size] partial sums of these coefficients, by range of triangles */
  size_t size;      /* number of coefficients of the volume polynomial */
  double *space;    /* [threads, room] scratch memory, `room` elements for each thread */
  size_t room;
} lung_work;

/* Read a triangle's corners, mm, relative to work->centre. Return their vertex indices. */
static const uint32_t *read_corners(const lung_work *work, size_t triangle, double p[3][3]) {
  const uint32_t *corner = work->lungs->mesh.triangles + 3 * triangle;
  for (size_t v = 0; v < 3; ++v) {
    for (size_t axis = 0; axis < 3; ++axis) {
      p[v][axis] = work->lungs->mesh.vertices[3 * (size_t)corner[v] + axis] - work->centre[axis];
    }
  }
  return corner;
}

static size_t part_begin(const lung_work *work, size_t part) {
  const size_t *begin = work->lungs->triangle_begin + work->lung;
  return begin[0] + (begin[1] - begin[0]) * part / PARTS;
}

/* Return the index of the pair of modes k and l, in either order, among all pairs of modes. */
static size_t pair_of(size_t k, size_t l) {
  return k > l ? k * (k + 1) / 2 + l : l * (l + 1) / 2 + k;
}

/* Add factor * (a_k b_l + a_l b_k), k >= l, to element (k, l) of the lower triangle `pairs`. */
static void add_pairs(size_t count, double factor, const double *a, const double *b,
                      double *pairs) {
  for (size_t k = 0; k < count; ++k) {
    const double first = factor * a[k];
    const double second = factor * b[k];
    for (size_t l = 0; l <= k; ++l) {
      *pairs++ += first * b[l] + second * a[l];
    }
  }
}

/* Add the cubic terms of n triangles to sums [pairs of modes, modes]. For the pair of modes (k, l)
 * and the mode m, a triangle adds
 *
 *     (det(u(0,k), u(1,l), u(2,m)) + det(u(0,l), u(1,k), u(2,m))) / 2
 *
 * where u(v,k) is the displacement of corner v by mode k. If it is c(v,k) d(v) for all modes, the
 * first determinant is det(d(0), d(1), d(2)) c(0,k) c(1,l) c(2,m). x is work space. */
SUPINE_CLONES static void add_cubic(const lung_work *work, size_t begin, size_t n, const double *u,
                                    double *x, double *sums) {
  const size_t count = work->count;
  const size_t pairs = count * (count + 1) / 2;
  const size_t plane = 3 * n * count;
  double *third = x + n * pairs;
  for (size_t axis = 0; axis < supine_rows_per_vertex(work->rows->kind); ++axis) {
    const double *y = u + (axis + 1) % 3 * plane;
    const double *z = u + (axis + 2) % 3 * plane;
    memset(x, 0, n * pairs * sizeof *x);
    for (size_t t = 0; t < n; ++t) {
      if (work->rows->kind == SUPINE_ROWS_SCALAR) {
        const uint32_t *corner = work->lungs->mesh.triangles + 3 * (begin + t);
        const double *c[3];
        const double *d[3];
        for (size_t v = 0; v < 3; ++v) {
          c[v] = work->columns + corner[v] * count;
          d[v] = work->rows->directions + 3 * (size_t)corner[v];
        }
        add_pairs(count, 0.5 * supine_triple(d[0], d[1], d[2]), c[0], c[1], x + t * pairs);
        memcpy(third + t * count, c[2], count * sizeof *third);
      } else {
        add_pairs(count, 0.5, y + t * count, z + (n + t) * count, x + t * pairs);
        add_pairs(count, -0.5, z + t * count, y + (n + t) * count, x + t * pairs);
        memcpy(third + t * count, u + axis * plane + (2 * n + t) * count, count * sizeof *third);
      }
    }
    cblas_dgemm(CblasRowMajor, CblasTrans, CblasNoTrans, (int)pairs, (int)count, (int)n, 1.0, x,
                (int)pairs, third, (int)count, 1.0, sums, (int)count);
  }
}

/* Expand the determinant det(p(0) + u(0), p(1) + u(1), p(2) + u(2)) for each of n triangles, at
 * most BLOCK, with corners p and displacements u. Add its terms, except the constant, to `sums`:
 *
 *     linear     sum over corners v of u(v) . (p(v+1) x p(v+2)), a sum for each axis of u
 *     quadratic  sum over corners v of p(v) . (u(v+1) x u(v+2)), a sum for each axis of p
 *     cubic      det(u(0), u(1), u(2))
 *
 * Corner numbers are modulo 3. The arrays u, area (cross products of corners) and at (corners) hold
 * the first corners of all n triangles, then the second corners, then the third. */
SUPINE_CLONES static void add_block(const lung_work *work, size_t begin, size_t n, double *u,
                                    double *sums) {
  const size_t count = work->count;
  const size_t plane = 3 * n * count;
  const int k = (int)count;
  double *w = u + 3 * plane;
  double *x = w + plane;
  double at[3][3 * BLOCK];
  double area[3][3 * BLOCK];
  for (size_t t = 0; t < n; ++t) {
    double p[3][3];
    const uint32_t *corner = read_corners(work, begin + t, p);
    for (size_t v = 0; v < 3; ++v) {
      double cross[3];
      supine_cross(p[(v + 1) % 3], p[(v + 2) % 3], cross);
      for (size_t axis = 0; axis < 3; ++axis) {
        const size_t row = v * n + t;
        const size_t from = 3 * (size_t)corner[v] + axis;
        const bool vector = work->rows->kind == SUPINE_ROWS_VECTOR;
        const double *c = work->columns + (vector ? from : corner[v]) * count;
        const double d = vector ? 1.0 : work->rows->directions[from];
        at[axis][row] = p[v][axis];
        area[axis][row] = cross[axis];
        for (size_t i = 0; i < count; ++i) {
          u[axis * plane + row * count + i] = c[i] * d;
        }
      }
    }
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    const double *y = u + (axis + 1) % 3 * plane;
    const double *z = u + (axis + 2) % 3 * plane;
    cblas_dgemv(CblasRowMajor, CblasTrans, (int)(3 * n), k, 1.0, u + axis * plane, k, area[axis], 1,
                1.0, sums + axis * count, 1);
    for (size_t row = 0; row < 3 * n; ++row) {
      const size_t next = (row + n) % (3 * n);
      const size_t last = (row + 2 * n) % (3 * n);
      for (size_t i = 0; i < count; ++i) {
        w[row * count + i] =
            at[axis][last] * z[next * count + i] - at[axis][next] * z[last * count + i];
      }
    }
    cblas_dgemm(CblasRowMajor, CblasTrans, CblasNoTrans, k, k, (int)(3 * n), 1.0, y, k, w, k, 1.0,
                sums + (3 + axis * count) * count, k);
  }
  add_cubic(work, begin, n, u, x, sums + 3 * (1 + count) * count);
}

static void forms_range(void *context, size_t begin, size_t end, size_t thread) {
  const lung_work *work = context;
  for (size_t part = begin; part < end; ++part) {
    const size_t last = part_begin(work, part + 1);
    double *sums = work->sums + part * work->size;
    memset(sums, 0, work->size * sizeof *sums);
    for (size_t t = part_begin(work, part); t < last; t += BLOCK) {
      add_block(work, t, last - t < BLOCK ? last - t : BLOCK, work->space + thread * work->room,
                sums);
    }
  }
}

/* Add the sums over all ranges of triangles, in mm^3, to the coefficients of one lung's volume,
 * with the factor `unit`. Average the coefficients over all orders of their mode indices. */
static void forms_collect(const lung_work *work, double unit, supine_volume_forms *forms) {
  const size_t n = work->count;
  double *linear = forms->linear + 3 * work->lung * n;
  double *quadratic = forms->quadratic + 3 * work->lung * n * n;
  double *cubic = forms->cubic + work->lung * n * n * n;
  for (size_t part = 0; part < PARTS; ++part) {
    const double *l = work->sums + part * work->size;
    const double *q = l + 3 * n;
    const double *c = q + 3 * n * n;
    for (size_t i = 0; i < 3 * n; ++i) {
      linear[i] += unit * l[i];
      for (size_t j = 0; j < n; ++j) {
        quadratic[i * n + j] += unit / 2.0 * (q[i * n + j] + q[(i / n * n + j) * n + i % n]);
      }
    }
    for (size_t i = 0; i < n * n * n; ++i) {
      const size_t a = i / (n * n);
      const size_t b = i / n % n;
      const size_t m = i % n;
      cubic[i] += unit / 3.0 *
                  (c[pair_of(a, b) * n + m] + c[pair_of(a, m) * n + b] + c[pair_of(b, m) * n + a]);
    }
  }
}

supine_status supine_physics_volume_forms_create(const supine_lungs *lungs, const double *share,
                                                 const supine_rows *rows, const double *columns,
                                                 size_t count, supine_volume_forms *forms,
                                                 supine_error *error) {
  const size_t pairs = count * (count + 1) / 2;
  const size_t size = 3 * count + 3 * count * count + pairs * count;
  const size_t room = BLOCK * (13 * count + pairs);
  SUPINE_ARENA arena = {0};
  double *sums = supine_arena_take(&arena, PARTS * size, sizeof *sums);
  double *space = supine_arena_take(&arena, supine_thread_count() * room, sizeof *space);
  *forms = (supine_volume_forms){
      .lung_count = lungs->lung_count,
      .column_count = count,
      .linear = calloc(3 * lungs->lung_count * count, sizeof(double)),
      .quadratic = calloc(3 * lungs->lung_count * count * count, sizeof(double)),
      .cubic = calloc(lungs->lung_count * count * count * count, sizeof(double))};
  if (arena.failed || forms->linear == NULL || forms->quadratic == NULL || forms->cubic == NULL) {
    supine_physics_volume_forms_free(forms);
    return supine_error_memory(error, "volume coefficients of %zu columns", count);
  }
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    lung_work work = {lungs, rows, columns, count, lung, {0.0}, sums, size, space, room};
    for (size_t axis = 0; axis < 3; ++axis) {
      work.centre[axis] = 0.5 * (lungs->minimum[axis] + lungs->maximum[axis]);
    }
    supine_parallel_for(PARTS, 1, 0, forms_range, &work);
    forms_collect(&work, sixth_ml * (share == NULL ? 1.0 : share[lung]), forms);
  }
  return SUPINE_OK;
}

supine_status supine_physics_volume_of_field(const supine_lungs *lungs, const double *share,
                                             const double *directions, const double *amounts,
                                             supine_volume_form *form, supine_error *error) {
  static const double one[1] = {1.0};
  const supine_rows rows = {SUPINE_ROWS_SCALAR, directions};
  SUPINE_FREED_BY(supine_physics_volume_forms_free) supine_volume_forms forms = {0};
  SUPINE_TRY(supine_physics_volume_forms_create(lungs, share, &rows, amounts, 1, &forms, error));
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    supine_physics_volume_forms_contract_lung(&forms, lung, one, &form[lung]);
  }
  return SUPINE_OK;
}

void supine_physics_volume_forms_contract_lung(const supine_volume_forms *forms, size_t lung,
                                               const double *weights, supine_volume_form *form) {
  const size_t n = forms->column_count;
  *form = (supine_volume_form){{0.0}};
  supine_volume_contract(n, forms->linear + 3 * lung * n, forms->quadratic + 3 * lung * n * n,
                         forms->cubic + lung * n * n * n, weights, form);
}

void supine_physics_volume_form_add(const supine_volume_form *form, double cubic[3]) {
  static const double even[3] = {1.0, 1.0, 1.0};
  double part[3];
  supine_volume_form_along(form, even, part);
  for (size_t i = 0; i < 3; ++i) {
    cubic[i] += part[i];
  }
}

void supine_physics_volume_forms_contract(const supine_volume_forms *forms, const double *weights,
                                          double cubic[3]) {
  cubic[0] = cubic[1] = cubic[2] = 0.0;
  for (size_t lung = 0; lung < forms->lung_count; ++lung) {
    supine_volume_form form;
    supine_physics_volume_forms_contract_lung(forms, lung, weights, &form);
    supine_physics_volume_form_add(&form, cubic);
  }
}
