/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Area vectors of triangles whose corners are linear in the weights. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/normals/polynomial.h"

enum { SIDES = SUPINE_NORMALS_FIELD_MAX + 1 };

/* Two sides of a triangle: of the rest surface first, then by how much each mode changes them. */
typedef struct sides {
  double a[SIDES][3];
  double b[SIDES][3];
} sides;

void supine_normals_monomials(size_t modes, const double *weights, double scale, double *phi) {
  size_t at = 0;
  for (size_t k = 0; k <= modes; ++k) {
    const double first = k == 0 ? 1.0 : scale * weights[k - 1];
    for (size_t l = k; l <= modes; ++l) {
      phi[at++] = first * (l == 0 ? 1.0 : scale * weights[l - 1]);
    }
  }
}

/* Rest position and displacements of a vertex. */
static void read_vertex(const supine_normals_surface *s, size_t i, double out[SIDES][3]) {
  const size_t modes = s->mode_count;
  for (size_t axis = 0; axis < 3; ++axis) {
    out[0][axis] = (double)s->vertices[3 * i + axis];
    for (size_t k = 0; k < modes; ++k) {
      out[k + 1][axis] = s->directions == NULL ? (double)s->coefficients[(3 * i + axis) * modes + k]
                                               : (double)s->coefficients[i * modes + k] *
                                                     (double)s->directions[3 * i + axis];
    }
  }
}

static void read_sides(const supine_normals_surface *s, const uint32_t *corner, sides *out) {
  double origin[SIDES][3];
  read_vertex(s, corner[0], origin);
  read_vertex(s, corner[1], out->a);
  read_vertex(s, corner[2], out->b);
  for (size_t k = 0; k <= s->mode_count; ++k) {
    for (size_t axis = 0; axis < 3; ++axis) {
      out->a[k][axis] -= origin[k][axis];
      out->b[k][axis] -= origin[k][axis];
    }
  }
}

static void add_cross(const double *a, const double *b, double sum[3]) {
  sum[0] += a[1] * b[2] - a[2] * b[1];
  sum[1] += a[2] * b[0] - a[0] * b[2];
  sum[2] += a[0] * b[1] - a[1] * b[0];
}

static bool in_lung(const supine_normals_surface *s, size_t lung, uint32_t vertex) {
  return vertex >= s->lung_begin[lung] && vertex < s->lung_begin[lung + 1];
}

/* A triangle's terms, added to those of a corner, [3, terms]. */
static void add_terms(const sides *t, size_t modes, size_t terms, double *row) {
  size_t at = 0;
  for (size_t k = 0; k <= modes; ++k) {
    for (size_t l = k; l <= modes; ++l, ++at) {
      double n[3] = {0, 0, 0};
      add_cross(t->a[k], t->b[l], n);
      if (l != k) {
        add_cross(t->a[l], t->b[k], n);
      }
      for (size_t axis = 0; axis < 3; ++axis) {
        row[axis * terms + at] += n[axis];
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

void supine_normals_mix(const supine_normals_surface *surface, size_t lung, const double *mix,
                        float *plane) {
  const size_t sides_count = surface->mode_count + 1;
  double full[SIDES][SIDES];
  size_t at = 0;
  for (size_t k = 0; k < sides_count; ++k) {
    for (size_t l = k; l < sides_count; ++l, ++at) {
      full[k][l] = mix[at];
      full[l][k] = mix[at];
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
    for (size_t k = 0; k < sides_count; ++k) {
      double other[3] = {0, 0, 0};
      for (size_t l = 0; l < sides_count; ++l) {
        for (size_t axis = 0; axis < 3; ++axis) {
          other[axis] += full[k][l] * both.b[l][axis];
        }
      }
      add_cross(both.a[k], other, n);
    }
    for (size_t v = 0; v < 3; ++v) {
      for (size_t axis = 0; axis < 3; ++axis) {
        plane[3 * (size_t)corner[v] + axis] += (float)n[axis];
      }
    }
  }
}
