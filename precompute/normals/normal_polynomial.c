/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Express normals, the sums of triangles' area vectors, as polynomials of the weights of the
 * displacement modes and the gains, which multiply the displacement along each axis. */
#include <math.h>
#include <string.h>

#include "precompute/normals/polynomial.h"

enum { COLUMNS = SUPINE_NORMALS_FIELD_MAX + 1 };

/* Each side of a triangle is a sum of columns: column 0 is the side on the reference surface,
 * column k > 0 its change by displacement mode k - 1. Return the index of the monomial
 * (supine_normals_terms) of the product of column k of one side and column l of another. */
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

supine_status supine_normals_fans_create(const supine_normals_surface *surface, supine_arena *arena,
                                         supine_normals_fans *fans) {
  const size_t corners = 3 * surface->lungs->mesh.triangle_count;
  fans->begin =
      supine_arena_zeros(arena, surface->lungs->mesh.vertex_count + 2, sizeof *fans->begin);
  fans->corner = supine_arena_take(arena, corners, sizeof *fans->corner);
  SUPINE_TRY(supine_arena_status(arena));
  uint32_t *next = fans->begin + 1;
  for (size_t s = 0; s < corners; ++s) {
    ++next[surface->lungs->mesh.triangles[s] + 1];
  }
  for (size_t i = 1; i <= surface->lungs->mesh.vertex_count; ++i) {
    next[i] += next[i - 1];
  }
  for (size_t s = 0; s < corners; ++s) {
    fans->corner[next[surface->lungs->mesh.triangles[s]]++] = (uint32_t)s;
  }
  return SUPINE_OK;
}

/* Write vertex `to` minus vertex `from` to side [3, COLUMNS]: the difference of their positions on
 * the reference surface to column 0, that of their displacements by mode k to column k + 1. */
static void read_side(const supine_normals_surface *s, size_t from, size_t to,
                      double (*side)[COLUMNS]) {
  const size_t modes = s->field->mode_count;
  for (size_t axis = 0; axis < 3; ++axis) {
    const bool vector = s->kind == SUPINE_ROWS_VECTOR;
    const float *c = s->field->coefficients + (vector ? (3 * to + axis) * modes : to * modes);
    const float *o = s->field->coefficients + (vector ? (3 * from + axis) * modes : from * modes);
    const double d = vector ? 1.0 : (double)s->directions[3 * to + axis];
    const double e = vector ? 1.0 : (double)s->directions[3 * from + axis];
    side[axis][0] = (double)s->vertices[3 * to + axis] - (double)s->vertices[3 * from + axis];
    for (size_t k = 0; k < modes; ++k) {
      side[axis][k + 1] = (double)c[k] * d - (double)o[k] * e;
    }
  }
}

/* Add to row [3, terms] the coefficients of the polynomial that gives the normal of a vertex: the
 * sum of the area vectors of the triangles around it (normal_modes.h). */
static void find_row(const supine_normals_surface *s, const supine_normals_fans *fans,
                     size_t vertex, size_t terms, double *row) {
  for (size_t at = fans->begin[vertex]; at < fans->begin[vertex + 1]; ++at) {
    uint32_t others[2];
    double a[3][COLUMNS];
    double b[3][COLUMNS];
    supine_normals_fan_others(s->lungs->mesh.triangles, fans->corner[at], others);
    read_side(s, vertex, others[0], a);
    read_side(s, vertex, others[1], b);
    for (size_t axis = 0; axis < 3; ++axis) {
      const size_t y = (axis + 1) % 3;
      const size_t z = (axis + 2) % 3;
      for (size_t k = 0; k <= s->field->mode_count; ++k) {
        for (size_t l = 0; l <= s->field->mode_count; ++l) {
          row[axis * terms + term_of(s->field->mode_count, k, l)] +=
              a[y][k] * b[z][l] - b[y][k] * a[z][l];
        }
      }
    }
  }
}

supine_status supine_normals_rows_create(const supine_normals_surface *surface,
                                         const supine_normals_fans *fans, size_t lung,
                                         size_t offset, size_t stride, supine_arena *arena,
                                         supine_normals_rows *rows) {
  const size_t terms = supine_normals_terms(surface->field->mode_count);
  const size_t end = surface->lungs->lung_begin[lung + 1];
  const size_t begin = surface->lungs->lung_begin[lung];
  const size_t most = (end - begin) / stride + 1;
  rows->count = 0;
  rows->vertex = supine_arena_take(arena, most, sizeof *rows->vertex);
  rows->terms = supine_arena_take(arena, most * 3 * terms, sizeof *rows->terms);
  SUPINE_TRY(supine_arena_status(arena));
  for (size_t i = begin + offset; i < end; i += stride) {
    double *row = rows->terms + 3 * rows->count * terms;
    memset(row, 0, 3 * terms * sizeof *row);
    find_row(surface, fans, i, terms, row);
    const double length =
        sqrt(row[0] * row[0] + row[terms] * row[terms] + row[2 * terms] * row[2 * terms]);
    if (length > 0.0) {
      for (size_t j = 0; j < 3 * terms; ++j) {
        row[j] /= length;
      }
      rows->vertex[rows->count++] = (uint32_t)i;
    }
  }
  return SUPINE_OK;
}
