/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Area vectors of triangles whose corners are linear in the weights and gains. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/normals/polynomial.h"
#include "sh/base/clones.h"

enum { SIDES = SUPINE_NORMALS_FIELD_MAX + 1, PADDED = (SIDES + 7) / 8 * 8 };

/* Two sides of a triangle, by axis: of the reference surface first, then by how much each mode
 * changes them. */
typedef struct sides {
  double a[3][SIDES];
  double b[3][SIDES];
} sides;

/* Where the product of columns k and l is, of the axes a and b. Column 0 is the reference. */
static size_t term_of(size_t modes, size_t k, size_t l) {
  const size_t low = (k < l ? k : l) - 1;
  const size_t high = (k < l ? l : k) - 1;
  return k == 0 && l == 0 ? 0
         : l == 0         ? k
         : k == 0         ? modes + l
                          : 1 + 2 * modes + low * modes - low * (low + 1) / 2 + high;
}

void supine_normals_monomials(size_t modes, const double *weights, const double gains[3],
                              double *phi) {
  for (size_t axis = 0; axis < 3; ++axis) {
    const double a = gains[(axis + 1) % 3];
    const double b = gains[(axis + 2) % 3];
    *phi++ = 1.0;
    for (size_t k = 0; k < modes; ++k) {
      phi[k] = a * weights[k];
      phi[modes + k] = b * weights[k];
    }
    phi += 2 * modes;
    for (size_t k = 0; k < modes; ++k) {
      for (size_t l = k; l < modes; ++l) {
        *phi++ = a * b * weights[k] * weights[l];
      }
    }
  }
}

/* Reference position and displacements of a vertex along one axis. */
static void read_vertex(const supine_normals_surface *s, size_t i, size_t axis, double *out) {
  const size_t modes = s->mode_count;
  const float *c = s->coefficients + (s->directions == NULL ? (3 * i + axis) * modes : i * modes);
  const double d = s->directions == NULL ? 1.0 : (double)s->directions[3 * i + axis];
  out[0] = (double)s->vertices[3 * i + axis];
  for (size_t k = 0; k < modes; ++k) {
    out[k + 1] = (double)c[k] * d;
  }
}

static void read_sides(const supine_normals_surface *s, const uint32_t *corner, sides *out) {
  double origin[SIDES];
  for (size_t axis = 0; axis < 3; ++axis) {
    read_vertex(s, corner[0], axis, origin);
    read_vertex(s, corner[1], axis, out->a[axis]);
    read_vertex(s, corner[2], axis, out->b[axis]);
    for (size_t k = 0; k <= s->mode_count; ++k) {
      out->a[axis][k] -= origin[k];
      out->b[axis][k] -= origin[k];
    }
  }
}

static bool in_lung(const supine_normals_surface *s, size_t lung, uint32_t vertex) {
  return vertex >= s->lung_begin[lung] && vertex < s->lung_begin[lung + 1];
}

/* A triangle's terms, added to those of a corner, [3, terms]. */
static void add_terms(const sides *t, size_t modes, size_t terms, double *row) {
  for (size_t axis = 0; axis < 3; ++axis) {
    const size_t y = (axis + 1) % 3;
    const size_t z = (axis + 2) % 3;
    for (size_t k = 0; k <= modes; ++k) {
      for (size_t l = 0; l <= modes; ++l) {
        row[axis * terms + term_of(modes, k, l)] +=
            t->a[y][k] * t->b[z][l] - t->b[y][k] * t->a[z][l];
      }
    }
  }
}

/* Divides by the lengths at rest, and drops rows without. */
static void normalise_rows(supine_normals_rows *rows, size_t terms) {
  size_t kept = 0;
  for (size_t r = 0; r < rows->count; ++r) {
    const double *row = rows->terms + 3 * r * terms;
    const double length =
        sqrt(row[0] * row[0] + row[terms] * row[terms] + row[2 * terms] * row[2 * terms]);
    if (length > 0.0) {
      for (size_t j = 0; j < 3 * terms; ++j) {
        rows->terms[3 * kept * terms + j] = row[j] / length;
      }
      rows->vertex[kept++] = rows->vertex[r];
    }
  }
  rows->count = kept;
}

supine_status supine_normals_rows_create(const supine_normals_surface *surface, size_t lung,
                                         size_t offset, size_t stride, supine_normals_rows *rows) {
  const size_t begin = surface->lung_begin[lung];
  const size_t n = surface->lung_begin[lung + 1] - begin;
  const size_t terms = supine_normals_terms(surface->mode_count);
  const size_t count = offset < n ? (n - offset + stride - 1) / stride : 0;
  *rows = (supine_normals_rows){.count = count};
  rows->vertex = malloc((count + 1) * sizeof *rows->vertex);
  rows->terms = calloc(count * 3 * terms + 1, sizeof *rows->terms);
  if (rows->vertex == NULL || rows->terms == NULL) {
    supine_normals_rows_free(rows);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t r = 0; r < count; ++r) {
    rows->vertex[r] = (uint32_t)(begin + offset + r * stride);
  }
  for (size_t t = 0; t < surface->triangle_count; ++t) {
    const uint32_t *corner = surface->triangles + 3 * t;
    sides both;
    bool ready = false;
    for (size_t v = 0; v < 3 && in_lung(surface, lung, corner[0]); ++v) {
      const size_t at = corner[v] - begin;
      if (at < offset || (at - offset) % stride != 0) {
        continue;
      }
      if (!ready) {
        read_sides(surface, corner, &both);
        ready = true;
      }
      add_terms(&both, surface->mode_count, terms,
                rows->terms + 3 * ((at - offset) / stride) * terms);
    }
  }
  normalise_rows(rows, terms);
  return SUPINE_OK;
}

void supine_normals_rows_free(supine_normals_rows *rows) {
  free(rows->vertex);
  free(rows->terms);
  *rows = (supine_normals_rows){0};
}

/* n_x += sum over k, l of full[l][k] (a_y[k] b_z[l] - b_y[k] a_z[l]), and so on. The columns k
 * stand side by side for vector units: `columns` of them, a multiple of eight, zeros at the end. */
SUPINE_CLONES static void add_mixed(const sides *t, size_t modes, size_t columns,
                                    double (*full)[SIDES][PADDED], double n[3]) {
  for (size_t axis = 0; axis < 3; ++axis) {
    const size_t y = (axis + 1) % 3;
    const size_t z = (axis + 2) % 3;
    double a[PADDED] = {0.0};
    double b[PADDED] = {0.0};
    for (size_t l = 0; l <= modes; ++l) {
      const double az = t->a[z][l];
      const double bz = t->b[z][l];
      for (size_t k = 0; k < columns; ++k) {
        a[k] += full[axis][l][k] * az;
        b[k] += full[axis][l][k] * bz;
      }
    }
    for (size_t k = 0; k <= modes; ++k) {
      n[axis] += t->a[y][k] * b[k] - t->b[y][k] * a[k];
    }
  }
}

void supine_normals_mix(const supine_normals_surface *surface, size_t lung, const double *mix,
                        float *plane) {
  const size_t modes = surface->mode_count;
  const size_t terms = supine_normals_terms(modes);
  const size_t columns = (modes + 8) / 8 * 8;
  double full[3][SIDES][PADDED] = {{{0.0}}};
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t k = 0; k <= modes; ++k) {
      for (size_t l = 0; l <= modes; ++l) {
        full[axis][l][k] = mix[axis * terms + term_of(modes, k, l)];
      }
    }
  }
  for (size_t t = 0; t < surface->triangle_count; ++t) {
    const uint32_t *corner = surface->triangles + 3 * t;
    if (!in_lung(surface, lung, corner[0])) {
      continue;
    }
    sides both;
    double n[3] = {0, 0, 0};
    read_sides(surface, corner, &both);
    add_mixed(&both, modes, columns, full, n);
    for (size_t v = 0; v < 3; ++v) {
      for (size_t axis = 0; axis < 3; ++axis) {
        plane[3 * (size_t)corner[v] + axis] += (float)n[axis];
      }
    }
  }
}
