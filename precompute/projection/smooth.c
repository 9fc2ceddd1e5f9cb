/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The smooth route: solves for a few directions, and a polynomial through them.
 *
 * The field has kinks over the sphere, where another vertex becomes the lowest or highest, but all
 * of them are in two functions of gravity,
 *
 *     v = g / (max - min),    a = (g.c - min) / (max - min) - 1/2        c: the box's centre
 *
 * of which heights are h_i = v.(p_i - c) + a + 1/2. The stiffness, free of its scale, depends on v
 * alone and analytically; the force is affine in v and a, and F linear in the force. So
 *
 *     F_i(g) = P_i(v) + a Q_i(v)
 *
 * whose power series converge as those of the stiffness, (soften / 2)^n / n!: a polynomial through
 * a tenth of a grid's directions is far closer than the harmonics that come after it. */
#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/clones.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"
#include "sh/transform.h"
#include <supine/sh.h>

#include "precompute/projection/sampler.h"

enum {
  DEGREE_MIN = 2,
  DEGREE_MAX = 8,          /* beyond it a grid is as cheap, and powers are too alike */
  DIRECTIONS_PER_TERM = 2, /* for a fit that is as good between its directions as at them */
  CHUNK = 32,              /* directions whose fields are held at a time */
  LATITUDES_PER_BAND = 8,  /* of the functions' rule, as in the linear route: */
  LATITUDES_MIN = 32,      /* kinks cost no solves there */
  VERTICES_GRAIN = 512
};

/* The first term of the series that is left out: of fits of made and real lungs the error is then
 * below 2e-4 of the field, a tenth of what 16 modes leave. With a reach, stiffness counts only over
 * its length, and a degree less does. */
static const double left_out = 3e-5;
static const double left_out_reach = 3e-4;

/* Singular values below this share of the first are rounding: of lungs as wide as high as deep,
 * powers of v differ less. */
static const double rank_tolerance = 1e-9;

/* Polynomials in v of degree `degree`, and a times those of degree - 2, as a is about a tenth. */
typedef struct powers {
  const supine_lungs *lungs;
  const supine_force_law *law;
  size_t degree, count;
  double centre[3], radius;
} powers;

static size_t terms_of(size_t degree) {
  return (degree + 1) * (degree + 2) * (degree + 3) / 6;
}

static size_t degree_of(const supine_model *model) {
  const double limit = model->reach > 0.0 ? left_out_reach : left_out;
  const double half = 0.5 * fabs(model->force.soften);
  double term = half * half * half / 6.0;
  size_t degree = DEGREE_MIN;
  for (; term > limit; ++degree) {
    term *= half / (double)(degree + 2);
  }
  return degree;
}

size_t supine_projection_smooth_directions(const supine_model *model) {
  const size_t degree = degree_of(model);
  return degree > DEGREE_MAX ? 0 : DIRECTIONS_PER_TERM * (terms_of(degree) + terms_of(degree - 2));
}

static powers powers_of(const supine_lungs *lungs, const supine_model *model) {
  powers made = {.lungs = lungs, .law = &model->force, .degree = degree_of(model)};
  double square = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    const double half = 0.5 * (lungs->maximum[k] - lungs->minimum[k]);
    made.centre[k] = lungs->minimum[k] + half;
    square += half * half;
  }
  made.radius = sqrt(square);
  made.count = terms_of(made.degree) + terms_of(made.degree - 2);
  return made;
}

/* All powers x^i y^j z^k of i + j + k <= degree times `factor`; returns their number. */
static size_t monomials(const double v[3], size_t degree, double factor, double *out) {
  size_t count = 0;
  double x = factor;
  for (size_t i = 0; i <= degree; ++i, x *= v[0]) {
    double y = x;
    for (size_t j = 0; i + j <= degree; ++j, y *= v[1]) {
      double z = y;
      for (size_t k = 0; i + j + k <= degree; ++k, z *= v[2]) {
        out[count++] = z;
      }
    }
  }
  return count;
}

/* The powers at some directions, [count, powers]. */
static void powers_at(const powers *p, size_t count, const double *directions,
                      const double *minimum, const double *maximum, double *out) {
  for (size_t d = 0; d < count; ++d) {
    const double *g = directions + 3 * d;
    const double scale = p->radius / (maximum[d] - minimum[d]);
    const double v[3] = {scale * g[0], scale * g[1], scale * g[2]};
    const double middle = g[0] * p->centre[0] + g[1] * p->centre[1] + g[2] * p->centre[2];
    const double offset = (middle - minimum[d]) / (maximum[d] - minimum[d]) - 0.5;
    double *row = out + d * p->count;
    const size_t first = monomials(v, p->degree, 1.0, row);
    (void)monomials(v, p->degree - 2, offset, row + first);
  }
}

/* Combinations of the powers that are orthonormal at the directions of the solves: with
 * Phi = U S V^T there, psi = S^-1 V^T phi, and the least squares are columns = U^T F. */
typedef struct fit {
  size_t count, rank;
  double *directions; /* [count, 3] */
  double *at;         /* [count, rank] U */
  double *mix;        /* [powers, rank] V S^-1 */
} fit;

static void fit_free(fit *made) {
  free(made->directions);
  free(made->at);
  free(made->mix);
}

static supine_status fit_create(const powers *p, fit *made) {
  const size_t count = DIRECTIONS_PER_TERM * p->count;
  const lapack_int rows = (lapack_int)count;
  const lapack_int terms = (lapack_int)p->count;
  *made = (fit){.count = count};
  double *range = malloc(2 * count * sizeof *range);
  double *phi = malloc(count * p->count * sizeof *phi);
  double *u = malloc(count * p->count * sizeof *u);
  double *vt = malloc(p->count * p->count * sizeof *vt);
  double *size = malloc(2 * p->count * sizeof *size);
  supine_status status = SUPINE_ERROR_MEMORY;
  made->directions = malloc(3 * count * sizeof *made->directions);
  if (range == NULL || phi == NULL || u == NULL || vt == NULL || size == NULL ||
      made->directions == NULL) {
    goto cleanup;
  }
  for (size_t i = 0; i < count; ++i) {
    supine_spiral((double)i, (double)(count), 0.0, made->directions + 3 * i);
  }
  status = supine_physics_height_range(p->lungs, p->law->pair, count, made->directions, range,
                                       range + count);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  powers_at(p, count, made->directions, range, range + count, phi);
  if (LAPACKE_dgesvd(LAPACK_ROW_MAJOR, 'S', 'S', rows, terms, phi, terms, size, u, terms, vt, terms,
                     size + p->count) != 0) {
    status = SUPINE_ERROR_NUMERICAL;
    goto cleanup;
  }
  while (made->rank < p->count && size[made->rank] > rank_tolerance * size[0]) {
    ++made->rank;
  }
  made->at = malloc(count * made->rank * sizeof *made->at);
  made->mix = malloc(p->count * made->rank * sizeof *made->mix);
  if (made->at == NULL || made->mix == NULL) {
    status = SUPINE_ERROR_MEMORY;
    goto cleanup;
  }
  for (size_t r = 0; r < made->rank; ++r) {
    for (size_t m = 0; m < count; ++m) {
      made->at[m * made->rank + r] = u[m * p->count + r];
    }
    for (size_t t = 0; t < p->count; ++t) {
      made->mix[t * made->rank + r] = vt[r * p->count + t] / size[r];
    }
  }
cleanup:
  free(range);
  free(phi);
  free(u);
  free(vt);
  free(size);
  return status;
}

/* columns += fields^T at, of a few directions. */
typedef struct add_work {
  size_t vertices, rank, count;
  const double *fields; /* [count, vertices] */
  const double *at;     /* [count, rank] */
  double *columns;      /* [vertices, rank] */
} add_work;

SUPINE_CLONES static void add_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const add_work *work = context;
  for (size_t i = begin; i < end; ++i) {
    double *restrict row = work->columns + i * work->rank;
    for (size_t d = 0; d < work->count; ++d) {
      const double value = work->fields[d * work->vertices + i];
      const double *at = work->at + d * work->rank;
      for (size_t r = 0; r < work->rank; ++r) {
        row[r] += value * at[r];
      }
    }
  }
}

/* Solves for the directions of the fit. */
static supine_status find_columns(const supine_lungs *lungs, const supine_model *model,
                                  const fit *wanted, supine_progress_function *progress,
                                  void *context, supine_projection *made, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  supine_sampler *sampler = NULL;
  supine_solve_report worst = {0};
  supine_status status = supine_projection_sampler_create(lungs, model, &sampler, error);
  double *fields = malloc(CHUNK * n * sizeof *fields);
  made->columns = calloc(n * wanted->rank, sizeof *made->columns);
  if (status == SUPINE_OK && (fields == NULL || made->columns == NULL)) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to sample %zu vertices", n);
  }
  for (size_t first = 0; first < wanted->count && status == SUPINE_OK; first += CHUNK) {
    const size_t left = wanted->count - first;
    const size_t count = left < CHUNK ? left : CHUNK;
    if (progress != NULL && !progress(context, (double)first / (double)wanted->count)) {
      status =
          supine_error_set(error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
      break;
    }
    status = supine_projection_sampler_solve(sampler, count, wanted->directions + 3 * first, false,
                                             fields, &worst, error);
    if (status == SUPINE_OK) {
      add_work work = {
          n, wanted->rank, count, fields, wanted->at + first * wanted->rank, made->columns};
      supine_parallel_for(n, VERTICES_GRAIN, 0, add_range, &work);
    }
  }
  made->rank = wanted->rank;
  made->solve_count = wanted->count;
  made->iterations = worst.iterations;
  made->residual = worst.residual;
  supine_projection_sampler_destroy(sampler);
  free(fields);
  return status;
}

/* The fit's functions over a whole rule, ring by ring, to harmonics [rank, (band + 1)^2]. */
static supine_status find_functions(const powers *p, const fit *wanted, size_t band,
                                    double *functions, supine_error *error) {
  const size_t least = LATITUDES_PER_BAND * (band + 1);
  const size_t latitudes = least < LATITUDES_MIN ? LATITUDES_MIN : least;
  const size_t longitudes = 2 * latitudes;
  const size_t count = latitudes * longitudes;
  const supine_sh_batch batch = {.fields = wanted->rank};
  supine_sh_grid *grid = NULL;
  supine_sh_transform *plan = NULL;
  double *directions = malloc(3 * count * sizeof *directions);
  double *range = malloc(2 * count * sizeof *range);
  double *phi = malloc(longitudes * p->count * sizeof *phi);
  double *ring = malloc(longitudes * wanted->rank * sizeof *ring);
  supine_status status = supine_sh_grid_create(latitudes, longitudes, &grid);
  if (status == SUPINE_OK) {
    status = supine_sh_transform_create(band, grid, &plan, error);
  }
  if (status == SUPINE_OK && (directions == NULL || range == NULL || phi == NULL || ring == NULL)) {
    status = SUPINE_ERROR_MEMORY;
  }
  for (size_t d = 0; d < count && status == SUPINE_OK; ++d) {
    supine_sh_grid_direction(grid, d / longitudes, d % longitudes, directions + 3 * d);
  }
  if (status == SUPINE_OK) {
    status = supine_physics_height_range(p->lungs, p->law->pair, count, directions, range,
                                         range + count);
  }
  memset(functions, 0, wanted->rank * supine_sh_count(band) * sizeof *functions);
  for (size_t j = 0; j < latitudes && status == SUPINE_OK; ++j) {
    const size_t first = j * longitudes;
    powers_at(p, longitudes, directions + 3 * first, range + first, range + count + first, phi);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (int)longitudes, (int)wanted->rank,
                (int)p->count, 1.0, phi, (int)p->count, wanted->mix, (int)wanted->rank, 0.0, ring,
                (int)wanted->rank);
    status = supine_sh_forward_ring(plan, &batch, j, ring, functions, error);
  }
  supine_sh_transform_destroy(plan);
  supine_sh_grid_destroy(grid);
  free(directions);
  free(range);
  free(phi);
  free(ring);
  return status == SUPINE_OK ? status
                             : supine_error_set(error, status, "projection to band %zu: %s", band,
                                                supine_status_string(status));
}

supine_status supine_projection_smooth(const supine_lungs *lungs, const supine_model *model,
                                       size_t band, supine_progress_function *progress,
                                       void *context, supine_projection *projection,
                                       supine_error *error) {
  supine_projection made = {.vertex_count = lungs->mesh.vertex_count, .band = band};
  if (supine_projection_smooth_directions(model) == 0) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "soften %g is too much for a polynomial: take the sampled route",
                            model->force.soften);
  }
  const powers p = powers_of(lungs, model);
  fit wanted;
  supine_status status = fit_create(&p, &wanted);
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "polynomials of degree %zu: %s", p.degree,
                           supine_status_string(status));
    goto cleanup;
  }
  made.functions = malloc(wanted.rank * supine_sh_count(band) * sizeof *made.functions);
  status = made.functions == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY,
                                                     "no memory for functions of band %zu", band)
                                  : find_functions(&p, &wanted, band, made.functions, error);
  if (status == SUPINE_OK) {
    status = find_columns(lungs, model, &wanted, progress, context, &made, error);
  }
  if (status == SUPINE_OK) {
    *projection = made;
    made = (supine_projection){0};
  }
cleanup:
  supine_projection_free(&made);
  fit_free(&wanted);
  return status;
}
