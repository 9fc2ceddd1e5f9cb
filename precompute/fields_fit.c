/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Harmonics fitted to fields at any directions, and their leave-one-out error. */
#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/fields.h"
#include "sh/base/vec3.h"
#include "sh/grid.h"
#include <supine/sh.h>

#include "precompute/projection/compression.h"
#include "precompute/projection/tally.h"

/* Directions determine a band while the harmonics there are no closer to dependent than this, and
 * no direction is fitted by itself alone. */
static const double condition_max = 100.0;
static const double leverage_max = 0.999;

/* A higher band has to win by this factor, and there is nothing to win below the rounding of
 * float coefficients. */
static const double worthwhile = 0.99;
static const double exact = 1e-6;

/* What a weighted least-squares fit of one band is made of: with A = sqrt(W) Y = U S V^T,
 * C^T = V S^-1 U^T sqrt(W) F. On a product grid with its rule's weights A is orthonormal. */
typedef struct fit {
  size_t count, terms;
  double *y;        /* [M, P] harmonics at the directions */
  double *inverse;  /* [P, P] (A^T A)^-1 */
  double *analysis; /* [P, M] C^T = analysis F */
  double *leverage; /* [M] h_ii */
  double condition;
} fit;

static void fit_free(fit *f) {
  free(f->y);
  free(f->inverse);
  free(f->analysis);
  free(f->leverage);
  *f = (fit){0};
}

static supine_status fit_create(size_t band, size_t count, const double *directions,
                                const double *weight, fit *f) {
  const size_t terms = supine_sh_count(band);
  *f = (fit){.count = count, .terms = terms};
  f->y = calloc(count * terms, sizeof *f->y);
  f->inverse = malloc(terms * terms * sizeof *f->inverse);
  f->analysis = malloc(terms * count * sizeof *f->analysis);
  f->leverage = malloc(count * sizeof *f->leverage);
  double *a = malloc(count * terms * sizeof *a);
  double *u = malloc(count * terms * sizeof *u);
  double *vt = malloc(terms * terms * sizeof *vt);
  double *s = calloc(terms, sizeof *s);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (f->y == NULL || f->inverse == NULL || f->analysis == NULL || f->leverage == NULL ||
      a == NULL || u == NULL || vt == NULL || s == NULL) {
    goto cleanup;
  }
  status = supine_sh_evaluate_many(band, count, directions, f->y);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  for (size_t i = 0; i < count; ++i) {
    for (size_t t = 0; t < terms; ++t) {
      a[i * terms + t] = sqrt(weight[i]) * f->y[i * terms + t];
    }
  }
  const int m = (int)count;
  const int p = (int)terms;
  if (LAPACKE_dgesdd(LAPACK_ROW_MAJOR, 'S', m, p, a, p, s, u, p, vt, p) != 0) {
    status = SUPINE_ERROR_NUMERICAL;
    goto cleanup;
  }
  f->condition = s[terms - 1] > 0.0 ? s[0] / s[terms - 1] : INFINITY;
  for (size_t i = 0; i < count; ++i) {
    f->leverage[i] = 0.0;
    for (size_t t = 0; t < terms; ++t) {
      f->leverage[i] += u[i * terms + t] * u[i * terms + t];
    }
  }
  for (size_t t = 0; t < terms; ++t) { /* V^T by rows over S */
    cblas_dscal(p, 1.0 / s[t], vt + t * terms, 1);
  }
  cblas_dgemm(CblasRowMajor, CblasTrans, CblasTrans, p, m, p, 1.0, vt, p, u, p, 0.0, f->analysis,
              m);
  cblas_dgemm(CblasRowMajor, CblasTrans, CblasNoTrans, p, p, p, 1.0, vt, p, vt, p, 0.0, f->inverse,
              p);
  for (size_t i = 0; i < count; ++i) {
    cblas_dscal(p, sqrt(weight[i]), f->analysis + i, m);
  }
cleanup:
  free(a);
  free(u);
  free(vt);
  free(s);
  if (status != SUPINE_OK) {
    fit_free(f);
  }
  return status;
}

static bool fit_is_determined(const fit *f) {
  if (!(f->condition <= condition_max)) {
    return false;
  }
  for (size_t i = 0; i < f->count; ++i) {
    if (f->leverage[i] > leverage_max) {
      return false;
    }
  }
  return true;
}

/* Leave-one-out error of the fit, relative RMS, from the fields' Gram matrix [M, M] alone: the
 * residual at a direction that is left out is that of the whole fit over 1 - h. */
static supine_status leave_one_out(const fit *f, const double *gram, double *relative) {
  const int m = (int)f->count;
  const int p = (int)f->terms;
  double *remove = malloc(f->count * f->count * sizeof *remove); /* I - Y analysis */
  double *product = malloc(f->count * f->count * sizeof *product);
  if (remove == NULL || product == NULL) {
    free(remove);
    free(product);
    return SUPINE_ERROR_MEMORY;
  }
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, m, m, p, -1.0, f->y, p, f->analysis, m,
              0.0, remove, m);
  for (size_t i = 0; i < f->count; ++i) {
    remove[i * f->count + i] += 1.0;
  }
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, m, m, m, 1.0, remove, m, gram, m, 0.0,
              product, m);
  double error2 = 0.0;
  double field2 = 0.0;
  for (size_t i = 0; i < f->count; ++i) {
    const double square = cblas_ddot(m, product + i * f->count, 1, remove + i * f->count, 1);
    const double left = 1.0 - f->leverage[i];
    error2 += fmax(square, 0.0) / (left * left);
    field2 += gram[i * f->count + i];
  }
  free(remove);
  free(product);
  *relative = sqrt(error2 / field2);
  return SUPINE_OK;
}

/* Find the product grid that the directions are, if any, and its rule's weights [M]. */
static bool find_grid(const supine_fields *fields, double *weight) {
  static const double same = 1e-5;
  const size_t m = fields->direction_count;
  size_t found = 0;
  for (size_t latitudes = 2; latitudes <= m / 3 && found < m; ++latitudes) {
    supine_sh_grid *grid = NULL;
    if (m % latitudes != 0 || supine_sh_grid_create(latitudes, m / latitudes, &grid) != SUPINE_OK) {
      continue;
    }
    found = 0;
    for (size_t j = 0; j < m && found == j; ++j) { /* nodes are distinct: each finds one at most */
      double g[3];
      supine_sh_grid_direction(grid, j / grid->longitudes, j % grid->longitudes, g);
      for (size_t d = 0; d < m && found == j; ++d) {
        if (supine_distance(g, fields->directions + 3 * d) < same) {
          weight[d] = grid->weight[j / grid->longitudes] * 2.0 * M_PI / (double)grid->longitudes;
          ++found;
        }
      }
    }
    supine_sh_grid_destroy(grid);
  }
  return found == m;
}

/* Unit direction of each vertex that its displacements follow best, (the leading eigenvector of the
 * sum of u u^T), turned so that they are positive on average; u . d into values [M, N]; what is
 * lost of the squared displacement. */
static double best_directions(const supine_fields *fields, double *directions, double *values) {
  const size_t n = fields->vertex_count;
  double lost = 0.0;
  for (size_t i = 0; i < n; ++i) {
    double sums[9] = {0.0};
    double mean[3] = {0.0};
    for (size_t m = 0; m < fields->direction_count; ++m) {
      const double *u = fields->displacement + 3 * (m * n + i);
      for (size_t a = 0; a < 3; ++a) {
        mean[a] += u[a];
        for (size_t b = 0; b < 3; ++b) {
          sums[3 * a + b] += u[a] * u[b];
        }
      }
    }
    double eigenvalues[3];
    (void)LAPACKE_dsyev(LAPACK_COL_MAJOR, 'V', 'U', 3, sums, 3, eigenvalues);
    double *d = directions + 3 * i;
    const double *leading = sums + 6;
    const double along = supine_dot(leading, mean);
    for (size_t a = 0; a < 3; ++a) {
      d[a] = along < 0.0 ? -leading[a] : leading[a];
    }
    lost += fmax(eigenvalues[0], 0.0) + fmax(eigenvalues[1], 0.0);
    for (size_t m = 0; m < fields->direction_count; ++m) {
      const double *u = fields->displacement + 3 * (m * n + i);
      values[m * n + i] = supine_dot(u, d);
    }
  }
  return lost;
}

/* The work of one call. */
typedef struct fitting {
  const supine_fields *fields;
  const supine_fit_options *options;
  size_t rows;          /* N or 3 N */
  const double *values; /* [M, rows] */
  double *owned;        /* the values of scalar fields */
  double *weight;       /* [M] */
  bool grid;            /* the directions are a product grid */
  double *gram;         /* [M, M] of the values */
  double field2;        /* sum of the squared displacements */
  double lost2;         /* what scalar fields lose of it */
  fit chosen;
  supine_projection projection;
} fitting;

static void fitting_free(fitting *w) {
  free(w->owned);
  free(w->weight);
  free(w->gram);
  fit_free(&w->chosen);
  supine_projection_free(&w->projection);
}

static supine_status prepare(fitting *w, double *directions, supine_error *error) {
  const supine_fields *fields = w->fields;
  const size_t m = fields->direction_count;
  const size_t n = fields->vertex_count;
  w->rows = w->options->scalar ? n : 3 * n;
  w->values = fields->displacement;
  w->weight = calloc(m, sizeof *w->weight);
  w->gram = calloc(m * m, sizeof *w->gram);
  w->owned = w->options->scalar ? malloc(m * n * sizeof *w->owned) : NULL;
  if (w->weight == NULL || w->gram == NULL || (w->options->scalar && w->owned == NULL)) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu fields", m);
  }
  for (size_t i = 0; i < 3 * m * n; ++i) {
    w->field2 += fields->displacement[i] * fields->displacement[i];
  }
  if (!(w->field2 > 0.0)) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL, "nothing moves in these fields");
  }
  if (w->options->scalar) {
    w->lost2 = best_directions(fields, directions, w->owned);
    w->values = w->owned;
  }
  w->grid = find_grid(fields, w->weight);
  for (size_t i = 0; i < m && !w->grid; ++i) {
    w->weight[i] = 1.0;
  }
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)m, (int)m, (int)w->rows, 1.0, w->values,
              (int)w->rows, w->values, (int)w->rows, 0.0, w->gram, (int)m);
  return SUPINE_OK;
}

/* Tries the bands that the directions determine, and keeps the fit that was asked for or is best.
 */
static supine_status choose_band(fitting *w, supine_fit_report *report, supine_error *error) {
  const size_t m = w->fields->direction_count;
  double least = INFINITY;
  size_t determined = 0; /* bands 0 to determined - 1 */
  for (size_t band = 0; band <= SUPINE_FIT_BAND_MAX && supine_sh_count(band) < m; ++band) {
    fit trial;
    supine_status status = fit_create(band, m, w->fields->directions, w->weight, &trial);
    if (status == SUPINE_OK && !fit_is_determined(&trial)) {
      fit_free(&trial);
      break;
    }
    if (status == SUPINE_OK) {
      status = leave_one_out(&trial, w->gram, &report->error[band]);
    }
    if (status != SUPINE_OK) {
      fit_free(&trial);
      return supine_error_set(error, status, "fit of band %zu: %s", band,
                              supine_status_string(status));
    }
    determined = band + 1;
    const bool better = report->error[band] < worthwhile * least && least > exact;
    const bool wanted = w->options->band < 0 ? better : (size_t)w->options->band == band;
    if (wanted) {
      least = report->error[band];
      fit_free(&w->chosen);
      w->chosen = trial;
      report->band = band;
    } else {
      fit_free(&trial);
    }
  }
  if (determined == 0 || w->chosen.y == NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%zu directions do not determine band %d (%d harmonics): they reach "
                            "band %d",
                            m, w->options->band, (w->options->band + 1) * (w->options->band + 1),
                            (int)determined - 1);
  }
  report->band_highest = determined - 1;
  report->condition = w->chosen.condition;
  report->grid = w->grid;
  return SUPINE_OK;
}

/* Compute the coefficients [rows, P] by the fit's analysis matrix. */
static supine_status project(fitting *w, size_t band, supine_error *error) {
  const size_t m = w->fields->direction_count;
  const size_t terms = w->chosen.terms;
  supine_projection *made = &w->projection;
  *made = (supine_projection){.vertex_count = w->rows, .band = band, .rank = terms};
  made->columns = calloc(w->rows * terms + 1, sizeof *made->columns);
  if (made->columns == NULL) {
    (void)supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu coefficients",
                           w->rows * terms);
    return SUPINE_ERROR_MEMORY;
  }
  cblas_dgemm(CblasRowMajor, CblasTrans, CblasTrans, (int)w->rows, (int)terms, (int)m, 1.0,
              w->values, (int)w->rows, w->chosen.analysis, (int)m, 0.0, made->columns, (int)terms);
  return SUPINE_OK;
}

/* The whole procedure without one direction, in closed form: with r its residual in the whole fit
 * and a = (A^T A)^-1 y w / (1 - h), the coefficients are C - r a^T, and their modes come from the
 * Gram matrix of those. */
typedef struct without {
  double *removed;  /* [P] a */
  double *residual; /* [rows] r */
  double *seen;     /* [P] V V^T y: the harmonics there as the modes see them */
  double *overlap;  /* [P] C^T r */
  double *gram;     /* [P, P] */
  double *values;   /* [P] */
  double *vectors;  /* [K, P] */
} without;

static void without_free(without *o) {
  free(o->removed);
  free(o->residual);
  free(o->seen);
  free(o->overlap);
  free(o->gram);
  free(o->values);
  free(o->vectors);
}

static bool without_create(size_t rows, size_t terms, size_t modes, without *o) {
  *o = (without){malloc(terms * sizeof(double)),         malloc(rows * sizeof(double)),
                 malloc(terms * sizeof(double)),         malloc(terms * sizeof(double)),
                 malloc(terms * terms * sizeof(double)), malloc(terms * sizeof(double)),
                 malloc(modes * terms * sizeof(double))};
  return o->removed != NULL && o->residual != NULL && o->seen != NULL && o->overlap != NULL &&
         o->gram != NULL && o->values != NULL && o->vectors != NULL;
}

/* Leaves direction `d` out; `gram` is that of the whole fit. */
static supine_status leave_out(const fitting *w, const double *gram, size_t d, size_t modes,
                               without *o) {
  const int terms = (int)w->chosen.terms;
  const int rows = (int)w->rows;
  const double *y = w->chosen.y + d * w->chosen.terms;
  const double *c = w->projection.columns;
  cblas_dgemv(CblasRowMajor, CblasNoTrans, terms, terms,
              w->weight[d] / (1.0 - w->chosen.leverage[d]), w->chosen.inverse, terms, y, 1, 0.0,
              o->removed, 1);
  memcpy(o->residual, w->values + d * w->rows, w->rows * sizeof *o->residual);
  cblas_dgemv(CblasRowMajor, CblasNoTrans, rows, terms, -1.0, c, terms, y, 1, 1.0, o->residual, 1);
  if (w->options->modes == 0) {
    memcpy(o->seen, y, w->chosen.terms * sizeof *o->seen);
    return SUPINE_OK;
  }
  cblas_dgemv(CblasRowMajor, CblasTrans, rows, terms, 1.0, c, terms, o->residual, 1, 0.0,
              o->overlap, 1);
  memcpy(o->gram, gram, w->chosen.terms * w->chosen.terms * sizeof *o->gram);
  cblas_dger(CblasRowMajor, terms, terms, -1.0, o->removed, 1, o->overlap, 1, o->gram, terms);
  cblas_dger(CblasRowMajor, terms, terms, -1.0, o->overlap, 1, o->removed, 1, o->gram, terms);
  cblas_dger(CblasRowMajor, terms, terms, cblas_ddot(rows, o->residual, 1, o->residual, 1),
             o->removed, 1, o->removed, 1, o->gram, terms);
  const supine_status status =
      supine_projection_leading_eigenpairs(w->chosen.terms, o->gram, modes, o->values, o->vectors);
  memset(o->seen, 0, w->chosen.terms * sizeof *o->seen);
  for (size_t k = 0; k < modes && status == SUPINE_OK; ++k) {
    const double *mode = o->vectors + k * w->chosen.terms;
    cblas_daxpy(terms, cblas_ddot(terms, mode, 1, y, 1), mode, 1, o->seen, 1);
  }
  return status;
}

/* Squared miss of each vertex at a direction that is left out, into the tally. */
static void tally_misses(const fitting *w, const without *o, size_t d, supine_tally *tally) {
  const size_t n = w->fields->vertex_count;
  const size_t each = w->rows / n; /* components */
  const size_t terms = w->chosen.terms;
  const double influence = cblas_ddot((int)terms, o->removed, 1, o->seen, 1);
  for (size_t i = 0; i < n; ++i) {
    double square = 0.0;
    for (size_t row = each * i; row < each * (i + 1); ++row) {
      const double evaluated =
          cblas_ddot((int)terms, w->projection.columns + row * terms, 1, o->seen, 1) -
          o->residual[row] * influence;
      const double difference = w->values[d * w->rows + row] - evaluated;
      square += difference * difference;
    }
    if (w->options->scalar) { /* and what no magnitude along one direction can give */
      const double *u = w->fields->displacement + 3 * (d * n + i);
      const double along = w->values[d * n + i];
      square += fmax(supine_dot(u, u) - along * along, 0.0);
    }
    const double miss = sqrt(square);
    supine_accuracy_tally_add(tally, 1, &miss);
  }
}

/* Leave-one-out error of what run time will evaluate. */
static supine_status cross_validate(const fitting *w, size_t modes, supine_accuracy *accuracy,
                                    supine_error *error) {
  const size_t m = w->fields->direction_count;
  const size_t terms = w->chosen.terms;
  without out = {0};
  supine_tally *tally = calloc(1, sizeof *tally);
  double *gram = malloc(terms * terms * sizeof *gram);
  supine_status status = SUPINE_OK;
  if (tally == NULL || gram == NULL || !without_create(w->rows, terms, modes, &out)) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to cross-validate");
    goto cleanup;
  }
  cblas_dgemm(CblasRowMajor, CblasTrans, CblasNoTrans, (int)terms, (int)terms, (int)w->rows, 1.0,
              w->projection.columns, (int)terms, w->projection.columns, (int)terms, 0.0, gram,
              (int)terms);
  for (size_t d = 0; d < m && w->chosen.leverage != NULL && status == SUPINE_OK; ++d) {
    status = leave_out(w, gram, d, modes, &out);
    if (status == SUPINE_OK) {
      tally_misses(w, &out, d, tally);
    }
  }
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "cross-validation: %s", supine_status_string(status));
    goto cleanup;
  }
  const double samples = (double)m * (double)w->fields->vertex_count;
  const double size = sqrt(w->field2 / samples);
  *accuracy = (supine_accuracy){.direction_count = m,
                                .rms_mm = sqrt(tally->square_sum / samples),
                                .p95_mm = supine_accuracy_tally_percentile(tally, 0.95),
                                .max_mm = tally->largest};
  accuracy->relative_rms = accuracy->rms_mm / size;
  accuracy->relative_p95 = accuracy->p95_mm / size;
  accuracy->relative_max = accuracy->max_mm / size;
cleanup:
  without_free(&out);
  free(tally);
  free(gram);
  return status;
}

supine_status supine_fields_fit(const supine_fields *fields, const supine_fit_options *options,
                                double *directions, supine_compression *compression,
                                supine_fit_report *report, supine_error *error) {
  fitting w = {.fields = fields, .options = options};
  supine_compression made = {0};
  supine_fit_report found = {0};
  if (fields->direction_count < 2) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "%zu direction: at least two are needed",
                            fields->direction_count);
  }
  supine_status status = prepare(&w, directions, error);
  if (status == SUPINE_OK) {
    status = choose_band(&w, &found, error);
  }
  if (status == SUPINE_OK) {
    status = project(&w, found.band, error);
  }
  if (status == SUPINE_OK) {
    status = options->modes == 0
                 ? supine_projection_compress_harmonics(&w.projection, &made, error)
                 : supine_projection_compress_modes(&w.projection, NULL, options->modes, &made,
                                                    NULL, NULL, error);
  }
  if (status == SUPINE_OK) {
    status = cross_validate(&w, made.mode_count, &found.accuracy, error);
  }
  if (status == SUPINE_OK) {
    found.scalar_loss = sqrt(w.lost2 / w.field2);
    *compression = made;
    *report = found;
    made = (supine_compression){0};
  }
  supine_projection_compression_free(&made);
  fitting_free(&w);
  return status;
}
