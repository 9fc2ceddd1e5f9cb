/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Linear, quadratic and cubic forms of the volume that closed lungs gain. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/physics/volume_forms.h"
#include "sh/base/clones.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"
#include <supine/volume.h>


static const double millilitres = 1e-3; /* in a cubic millimetre */

void supine_physics_volume_forms_free(supine_volume_forms *forms) {
  free(forms->linear);
  free(forms->quadratic);
  free(forms->cubic);
  *forms = (supine_volume_forms){0};
}

static supine_status forms_allocate(size_t lungs, size_t count, supine_volume_forms *forms) {
  *forms = (supine_volume_forms){.lung_count = lungs, .column_count = count};
  forms->linear = calloc(3 * lungs * count, sizeof(double));
  forms->quadratic = calloc(3 * lungs * count * count, sizeof(double));
  forms->cubic = calloc(lungs * count * count * count, sizeof(double));
  if (forms->linear == NULL || forms->quadratic == NULL || forms->cubic == NULL) {
    supine_physics_volume_forms_free(forms);
    return SUPINE_ERROR_MEMORY;
  }
  return SUPINE_OK;
}

/* Triangles are summed in so many parts, whatever the number of threads, and so are the parts. */
enum { PARTS = 16 };

typedef struct forms_work {
  const supine_lungs *lungs;
  const double *share; /* of each lung; NULL: 1 */
  const double *directions, *columns;
  size_t count, first; /* columns; first triangle of this lung */
  double centre[3];
  size_t triangles;                   /* of this lung */
  double *linear, *quadratic, *cubic; /* one set a part */
} forms_work;

/* Adds a range of one lung's triangles: det(p0 + F0 d0, p1 + F1 d1, p2 + F2 d2), by powers of F and
 * by axis: linear by that of d, quadratic by that of p. */
SUPINE_CLONES static void scalar_part(const forms_work *work, size_t begin, size_t end,
                                      size_t part) {
  const size_t count = work->count;
  double *linear = work->linear + 3 * part * count;
  double *quadratic = work->quadratic + 3 * part * count * count;
  double *cubic = work->cubic + part * count * count * count;
  for (size_t t = begin; t < end; ++t) {
    const uint32_t *corner = work->lungs->mesh.triangles + 3 * (work->first + t);
    double p[3][3];
    const double *d[3];
    const double *c[3];
    for (size_t v = 0; v < 3; ++v) {
      for (size_t k = 0; k < 3; ++k) {
        p[v][k] = work->lungs->mesh.vertices[3 * (size_t)corner[v] + k] - work->centre[k];
      }
      d[v] = work->directions + 3 * (size_t)corner[v];
      c[v] = work->columns + count * (size_t)corner[v];
    }
    double pp[3][3]; /* p x p of the two corners besides one */
    double dd[3][3];
    for (size_t v = 0; v < 3; ++v) {
      supine_cross(p[(v + 1) % 3], p[(v + 2) % 3], pp[v]);
      supine_cross(d[(v + 1) % 3], d[(v + 2) % 3], dd[v]);
    }
    const double all = supine_dot(d[0], dd[0]);
    for (size_t axis = 0; axis < 3; ++axis) {
      double *row = linear + axis * count;
      const double q01 = dd[2][axis] * p[2][axis];
      const double q02 = dd[1][axis] * p[1][axis];
      const double q12 = dd[0][axis] * p[0][axis];
      for (size_t k = 0; k < count; ++k) {
        row[k] += d[0][axis] * pp[0][axis] * c[0][k] + d[1][axis] * pp[1][axis] * c[1][k] +
                  d[2][axis] * pp[2][axis] * c[2][k];
        const double first = q01 * c[0][k];
        const double second = q02 * c[0][k] + q12 * c[1][k];
        double *square = quadratic + (axis * count + k) * count;
        for (size_t l = 0; l < count; ++l) {
          square[l] += first * c[1][l] + second * c[2][l];
        }
      }
    }
    for (size_t k = 0; k < count; ++k) {
      for (size_t l = 0; l < count; ++l) {
        const double third = all * c[0][k] * c[1][l];
        double *row = cubic + (k * count + l) * count;
        for (size_t m = 0; m < count; ++m) {
          row[m] += third * c[2][m];
        }
      }
    }
  }
}

/* The same for columns of three components: a determinant for each choice of columns. */
static void vector_part(const forms_work *work, size_t begin, size_t end, size_t part) {
  const size_t count = work->count;
  double *linear = work->linear + 3 * part * count;
  double *quadratic = work->quadratic + 3 * part * count * count;
  double *cubic = work->cubic + part * count * count * count;
  for (size_t t = begin; t < end; ++t) {
    const uint32_t *corner = work->lungs->mesh.triangles + 3 * (work->first + t);
    double p[3][3];
    double c[3][SUPINE_MODES_MADE_MAX][3]; /* columns at the corners */
    for (size_t v = 0; v < 3; ++v) {
      for (size_t a = 0; a < 3; ++a) {
        p[v][a] = work->lungs->mesh.vertices[3 * (size_t)corner[v] + a] - work->centre[a];
        for (size_t k = 0; k < count; ++k) {
          c[v][k][a] = work->columns[(3 * (size_t)corner[v] + a) * count + k];
        }
      }
    }
    for (size_t v = 0; v < 3; ++v) {
      const size_t a = (v + 1) % 3;
      const size_t b = (v + 2) % 3;
      double pp[3];
      supine_cross(p[a], p[b], pp);
      for (size_t k = 0; k < count; ++k) {
        for (size_t axis = 0; axis < 3; ++axis) {
          linear[axis * count + k] += c[v][k][axis] * pp[axis];
        }
        for (size_t l = 0; l < count; ++l) {
          double cross[3];
          supine_cross(c[a][k], c[b][l], cross);
          for (size_t axis = 0; axis < 3; ++axis) {
            quadratic[(axis * count + k) * count + l] += cross[axis] * p[v][axis];
          }
        }
      }
    }
    for (size_t k = 0; k < count; ++k) {
      for (size_t l = 0; l < count; ++l) {
        double cross[3];
        supine_cross(c[0][k], c[1][l], cross);
        double *row = cubic + (k * count + l) * count;
        for (size_t m = 0; m < count; ++m) {
          row[m] += supine_dot(cross, c[2][m]);
        }
      }
    }
  }
}

static void forms_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const forms_work *work = context;
  for (size_t part = begin; part < end; ++part) {
    (work->directions != NULL ? scalar_part : vector_part)(
        work, work->triangles * part / PARTS, work->triangles * (part + 1) / PARTS, part);
  }
}

/* Sums the parts and makes the forms symmetric. */
static void forms_collect(const forms_work *work, size_t lung, supine_volume_forms *forms) {
  const size_t n = work->count;
  const double unit = millilitres / 6.0 * (work->share == NULL ? 1.0 : work->share[lung]);
  double *linear = forms->linear + 3 * lung * n;
  double *quadratic = forms->quadratic + 3 * lung * n * n;
  double *cubic = forms->cubic + lung * n * n * n;
  for (size_t t = 0; t < PARTS; ++t) {
    const double *l = work->linear + 3 * t * n;
    const double *q = work->quadratic + 3 * t * n * n;
    const double *c = work->cubic + t * n * n * n;
    for (size_t i = 0; i < 3 * n; ++i) {
      linear[i] += unit * l[i];
      const double *square = q + i / n * n * n;
      for (size_t j = 0; j < n; ++j) {
        quadratic[i * n + j] += unit / 2.0 * (square[i % n * n + j] + square[j * n + i % n]);
      }
    }
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = 0; j < n; ++j) {
        for (size_t k = 0; k < n; ++k) {
          cubic[(i * n + j) * n + k] +=
              unit / 6.0 *
              (c[(i * n + j) * n + k] + c[(i * n + k) * n + j] + c[(j * n + i) * n + k] +
               c[(j * n + k) * n + i] + c[(k * n + i) * n + j] + c[(k * n + j) * n + i]);
        }
      }
    }
  }
}

static supine_status create(const supine_lungs *lungs, const double *share,
                            const double *directions, const double *columns, size_t count,
                            supine_volume_forms *forms, supine_error *error) {
  forms_work work = {
      .lungs = lungs, .share = share, .directions = directions, .columns = columns, .count = count};
  supine_volume_forms made = {0};
  supine_status status = SUPINE_OK;
  if (count > SUPINE_MODES_MADE_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "volume forms of %zu columns: at most %d",
                            count, SUPINE_MODES_MADE_MAX);
  }
  if (!lungs->topology.closed) {
    return supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                            "the surface is not closed: %zu boundary, %zu non-manifold and %zu "
                            "inconsistently oriented edges",
                            lungs->topology.boundary_edges, lungs->topology.non_manifold_edges,
                            lungs->topology.inconsistent_edges);
  }
  status = forms_allocate(lungs->lung_count, count, &made);
  work.linear = malloc(3 * PARTS * count * sizeof(double));
  work.quadratic = malloc(3 * PARTS * count * count * sizeof(double));
  work.cubic = malloc(PARTS * count * count * count * sizeof(double));
  if (status != SUPINE_OK || work.linear == NULL || work.quadratic == NULL || work.cubic == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY,
                              "no memory for volume forms of %zu columns", count);
    goto cleanup;
  }
  for (size_t k = 0; k < 3; ++k) {
    work.centre[k] = 0.5 * (lungs->minimum[k] + lungs->maximum[k]);
  }
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    memset(work.linear, 0, 3 * PARTS * count * sizeof(double));
    memset(work.quadratic, 0, 3 * PARTS * count * count * sizeof(double));
    memset(work.cubic, 0, PARTS * count * count * count * sizeof(double));
    work.first = lungs->triangle_begin[lung];
    work.triangles = lungs->triangle_begin[lung + 1] - work.first;
    supine_parallel_for(PARTS, 1, 0, forms_range, &work);
    forms_collect(&work, lung, &made);
  }
  *forms = made;
  made = (supine_volume_forms){0};
cleanup:
  supine_physics_volume_forms_free(&made);
  free(work.linear);
  free(work.quadratic);
  free(work.cubic);
  return status;
}

supine_status supine_physics_volume_forms_create(const supine_lungs *lungs, const double *share,
                                                 const double *directions, const double *columns,
                                                 size_t count, supine_volume_forms *forms,
                                                 supine_error *error) {
  return create(lungs, share, directions, columns, count, forms, error);
}

supine_status supine_physics_volume_forms_create_vector(const supine_lungs *lungs,
                                                        const double *columns, size_t count,
                                                        supine_volume_forms *forms,
                                                        supine_error *error) {
  return create(lungs, NULL, NULL, columns, count, forms, error);
}

/* out[a, j, b] = sum over i of in[a, i, b] mix[i, j]. */
static void mix_middle(const double *in, size_t outer, size_t n, size_t inner, const double *mix,
                       size_t count, double *out) {
  memset(out, 0, outer * count * inner * sizeof *out);
  for (size_t a = 0; a < outer; ++a) {
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = 0; j < count; ++j) {
        for (size_t b = 0; b < inner; ++b) {
          out[(a * count + j) * inner + b] += in[(a * n + i) * inner + b] * mix[i * count + j];
        }
      }
    }
  }
}

supine_status supine_physics_volume_forms_mix(const supine_volume_forms *forms, const double *mix,
                                              size_t count, supine_volume_forms *mixed) {
  const size_t g = forms->lung_count;
  const size_t n = forms->column_count;
  const size_t larger = n > count ? n : count;
  double *first = malloc(3 * g * larger * larger * larger * sizeof *first);
  double *second = malloc(g * larger * larger * larger * sizeof *second);
  supine_volume_forms made = {0};
  if (first == NULL || second == NULL || forms_allocate(g, count, &made) != SUPINE_OK) {
    free(first);
    free(second);
    return SUPINE_ERROR_MEMORY;
  }
  mix_middle(forms->linear, 3 * g, n, 1, mix, count, made.linear);
  mix_middle(forms->quadratic, 3 * g, n, n, mix, count, first);
  mix_middle(first, 3 * g * count, n, 1, mix, count, made.quadratic);
  mix_middle(forms->cubic, g, n, n * n, mix, count, first);
  mix_middle(first, g * count, n, n, mix, count, second);
  mix_middle(second, g * count * count, n, 1, mix, count, made.cubic);
  free(first);
  free(second);
  *mixed = made;
  return SUPINE_OK;
}

void supine_physics_volume_forms_contract_lung(const supine_volume_forms *forms, size_t lung,
                                               const double *weights, supine_volume_form *form) {
  const size_t n = forms->column_count;
  *form = (supine_volume_form){{0.0}};
  supine_volume_contract(n, 3, forms->linear + 3 * lung * n, forms->quadratic + 3 * lung * n * n,
                         forms->cubic + lung * n * n * n, weights, form);
}

void supine_physics_volume_forms_contract(const supine_volume_forms *forms, const double *weights,
                                          double cubic[3]) {
  static const double even[3] = {1.0, 1.0, 1.0};
  cubic[0] = cubic[1] = cubic[2] = 0.0;
  for (size_t lung = 0; lung < forms->lung_count; ++lung) {
    supine_volume_form form;
    double part[3];
    supine_physics_volume_forms_contract_lung(forms, lung, weights, &form);
    supine_volume_form_along(&form, even, part);
    for (size_t i = 0; i < 3; ++i) {
      cubic[i] += part[i];
    }
  }
}
