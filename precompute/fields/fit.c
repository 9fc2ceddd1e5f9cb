/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit harmonics to another simulator's fields, cross-validate the fit, and write a basis file. */
#include <cblas.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/lapack.h"
#include "base/vec3.h"
#include "precompute/basis_file.h"
#include "precompute/fields/fields.h"
#include "precompute/projection/tally.h"
#include <supine/sh.h>

/* The directions of gravity determine a fit if the condition number of the matrix of harmonics and
 * the leverage of each direction are at most these limits. At leverage 1, a direction always has
 * residual 0, whatever its field. */
static const double condition_max = 100.0;
static const double leverage_max = 0.999;

/* A higher band replaces the chosen one if its leave-one-out error is below `worthwhile` times that
 * of the chosen band. A chosen band with an error of at most `exact` is kept, because such an error
 * is rounding error. */
static const double worthwhile = 0.99;
static const double exact = 1e-6;

/* Relative error that is small beside that of any simulator. Modes are not kept to lower it. */
static const double negligible = 1e-4;

/* A least-squares fit of harmonics to displacement fields for several directions of gravity. The
 * coefficient of each harmonic is a field; the coefficients are `pinv` times the given fields. */
typedef struct fit {
  size_t count;      /* number of directions of gravity */
  size_t terms;      /* number of harmonics */
  double *harmonics; /* [count, terms] value of each harmonic at each direction */
  double *pinv;      /* [terms, count] pseudo-inverse of `harmonics` */
  double condition;  /* condition number of `harmonics` */
} fit;

typedef struct fitting {
  const supine_fields *fields;
  size_t rows;  /* 3 x number of vertices */
  double *gram; /* [directions, directions] scalar products of any two input fields, mm^2 */
  fit chosen;
  double
      *residual; /* [directions] the prediction error is the sum of these times the input fields */
  supine_arena *arena;
} fitting;

/* Fit harmonics up to degree `band`. The arrays of the fit are valid until `kept` is freed. */
static supine_status fit_create(size_t band, size_t count, const double *directions,
                                supine_arena *kept, fit *f) {
  const size_t terms = supine_sh_count(band);
  const int m = (int)count;
  const int p = (int)terms;
  SUPINE_ARENA arena = {0};
  *f = (fit){.count = count, .terms = terms};
  f->harmonics = supine_arena_zeros(kept, count * terms, sizeof *f->harmonics);
  f->pinv = supine_arena_take(kept, terms * count, sizeof *f->pinv);
  double *a = supine_arena_take(&arena, count * terms, sizeof *a);
  double *u = supine_arena_take(&arena, count * terms, sizeof *u);
  double *vt = supine_arena_take(&arena, terms * terms, sizeof *vt);
  double *s = supine_arena_zeros(&arena, terms, sizeof *s);
  SUPINE_TRY(supine_arena_status(kept));
  SUPINE_TRY(supine_arena_status(&arena));
  SUPINE_TRY(supine_sh_evaluate_many(band, count, directions, f->harmonics));
  memcpy(a, f->harmonics, count * terms * sizeof *a);
  SUPINE_TRY(
      supine_lapack_status(LAPACKE_dgesdd(LAPACK_ROW_MAJOR, 'S', m, p, a, p, s, u, p, vt, p)));
  f->condition = s[terms - 1] > 0.0 ? s[0] / s[terms - 1] : INFINITY;
  for (size_t t = 0; t < terms; ++t) {
    cblas_dscal(p, 1.0 / s[t], vt + t * terms, 1);
  }
  cblas_dgemm(CblasRowMajor, CblasTrans, CblasTrans, p, m, p, 1.0, vt, p, u, p, 0.0, f->pinv, m);
  return SUPINE_OK;
}

static double leverage(const fit *f, size_t d) {
  return cblas_ddot((int)f->terms, f->harmonics + d * f->terms, 1, f->pinv + d, (int)f->count);
}

static bool fit_is_determined(const fit *f) {
  bool determined = f->condition <= condition_max;
  for (size_t i = 0; determined && i < f->count; ++i) {
    determined = leverage(f, i) <= leverage_max;
  }
  return determined;
}

/* Predict the field for direction d of gravity from the fields for all other directions. Use the
 * harmonics if `modes` is 0, otherwise that number of principal modes of the fitted field. The
 * error, true minus predicted, is a weighted sum of all input fields. Write the weights to
 * w->residual, and the squared norm of the error, mm^2, to `square`.
 *
 * Let A be f->pinv, h row d of f->harmonics x A, and e_d a vector that is 1 at d and 0 elsewhere.
 * The pseudo-inverse without direction d is
 *
 *     A_d = A - A e_d (e_d - h)^T / (1 - h_d) */
static supine_status predict(const fitting *w, const fit *f, size_t d, size_t modes,
                             double *square) {
  const int m = (int)f->count;
  const int p = (int)f->terms;
  const double *y = f->harmonics + d * f->terms;
  double *residual = w->residual;
  SUPINE_ARENA arena = {0};
  double *pinv = supine_arena_take(&arena, f->terms * f->count, sizeof *pinv);
  double *pinv_gram = supine_arena_take(&arena, f->terms * f->count, sizeof *pinv_gram);
  double *coefficient_gram =
      supine_arena_take(&arena, f->terms * f->terms, sizeof(double)); /* mm^2 */
  double *eigenvalues = supine_arena_take(&arena, f->terms, sizeof *eigenvalues);
  double *eigenvectors = supine_arena_take(&arena, f->terms * f->terms, sizeof *eigenvectors);
  double *target = supine_arena_take(&arena, f->terms, sizeof *target); /* y, or y on the modes */
  double *gram_residual = supine_arena_take(&arena, f->count, sizeof *gram_residual);
  SUPINE_TRY(supine_arena_status(&arena));
  cblas_dgemv(CblasRowMajor, CblasTrans, p, m, -1.0, f->pinv, m, y, 1, 0.0, residual, 1);
  residual[d] += 1.0;
  memcpy(pinv, f->pinv, f->terms * f->count * sizeof *pinv);
  cblas_dger(CblasRowMajor, p, m, -1.0 / residual[d], f->pinv + d, m, residual, 1, pinv, m);
  memcpy(target, y, f->terms * sizeof *target);
  if (modes > 0) {
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, p, m, m, 1.0, pinv, m, w->gram, m, 0.0,
                pinv_gram, m);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, p, p, m, 1.0, pinv_gram, m, pinv, m, 0.0,
                coefficient_gram, p);
    SUPINE_TRY(
        supine_sh_leading_eigenpairs(f->terms, coefficient_gram, modes, eigenvalues, eigenvectors));
    memset(target, 0, f->terms * sizeof *target);
    for (size_t k = 0; k < modes; ++k) {
      const double *mode = eigenvectors + k * f->terms;
      cblas_daxpy(p, cblas_ddot(p, mode, 1, y, 1), mode, 1, target, 1);
    }
  }
  cblas_dgemv(CblasRowMajor, CblasTrans, p, m, -1.0, pinv, m, target, 1, 0.0, residual, 1);
  residual[d] += 1.0;
  cblas_dsymv(CblasRowMajor, CblasUpper, m, 1.0, w->gram, m, residual, 1, 0.0, gram_residual, 1);
  *square = fmax(cblas_ddot(m, gram_residual, 1, residual, 1), 0.0);
  return SUPINE_OK;
}

/* Sum the squared displacements of all fields, mm^2. */
static double square_sum(const fitting *w) {
  const int m = (int)w->fields->direction_count;
  return cblas_dasum(m, w->gram, m + 1);
}

/* Compute the relative RMS leave-one-out error of a fit before its compression to modes. */
static supine_status leave_one_out(const fitting *w, const fit *f, double *error) {
  double sum = 0.0;
  for (size_t d = 0; d < f->count; ++d) {
    double square;
    SUPINE_TRY(predict(w, f, d, 0, &square));
    sum += square;
  }
  *error = sqrt(sum / square_sum(w));
  return SUPINE_OK;
}

/* Fit harmonics up to each degree (band) that the directions determine. Choose band `wanted`. If it
 * is negative, prefer a higher band only if its leave-one-out error is over 1 % lower. */
static supine_status choose_band(fitting *w, int wanted, supine_fit_report *report,
                                 supine_error *error) {
  const size_t m = w->fields->direction_count;
  double least = INFINITY;
  size_t determined_count = 0;
  for (size_t band = 0; band <= SUPINE_FIT_BAND_MAX && supine_sh_count(band) < m; ++band) {
    fit trial;
    supine_status status = fit_create(band, m, w->fields->directions, w->arena, &trial);
    const bool determined = status == SUPINE_OK && fit_is_determined(&trial);
    if (determined) {
      status = leave_one_out(w, &trial, &report->error[band]);
    }
    SUPINE_REFUSE_IF(status != SUPINE_OK, error, status, "fit of band %zu: %s", band,
                     supine_status_string(status));
    if (!determined) {
      break;
    }
    determined_count = band + 1;
    if (wanted < 0 ? report->error[band] < worthwhile * least && least > exact
                   : (size_t)wanted == band) {
      least = report->error[band];
      w->chosen = trial;
      report->band = band;
    }
  }
  SUPINE_REFUSE_IF(w->chosen.harmonics == NULL, error, SUPINE_ERROR_ARGUMENT,
                   "%zu directions do not determine band %d (%d harmonics); the highest band that "
                   "they determine is %d: give more directions, or leave --band out",
                   m, wanted, (wanted + 1) * (wanted + 1), (int)determined_count - 1);
  report->band_highest = determined_count - 1;
  return SUPINE_OK;
}

/* Make an expansion (sh/expansion.h) from the chosen fit. Its columns are the input fields. Its
 * functions are the transpose of the chosen fit's `pinv`. */
static supine_status project(const fitting *w, size_t band, supine_expansion *made,
                             supine_error *error) {
  const size_t m = w->chosen.count;
  const size_t terms = w->chosen.terms;
  *made = (supine_expansion){.row_count = w->rows, .band = band, .rank = m};
  made->columns = malloc(w->rows * m * sizeof *made->columns);
  made->functions = malloc(m * terms * sizeof *made->functions);
  if (made->columns == NULL || made->functions == NULL) {
    return supine_error_memory(error, "%zu fields", m);
  }
  for (size_t d = 0; d < m; ++d) {
    for (size_t i = 0; i < w->rows; ++i) {
      made->columns[i * m + d] = w->fields->displacement[d * w->rows + i];
    }
    for (size_t t = 0; t < terms; ++t) {
      made->functions[d * terms + t] = w->chosen.pinv[t * m + d];
    }
  }
  return SUPINE_OK;
}

static supine_status cross_validate(const fitting *w, size_t modes, supine_accuracy *accuracy,
                                    supine_error *error) {
  const size_t m = w->fields->direction_count;
  const double samples = (double)m * (double)w->fields->vertex_count;
  SUPINE_ARENA arena = {0};
  supine_tally *tally = supine_arena_zeros(&arena, 1, sizeof *tally);
  double *residual = supine_arena_take(&arena, w->rows, sizeof *residual);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", w->fields->vertex_count));
  for (size_t d = 0; d < m; ++d) {
    double square;
    const supine_status status = predict(w, &w->chosen, d, modes, &square);
    SUPINE_REFUSE_IF(status != SUPINE_OK, error, status, "cross-validation: %s",
                     supine_status_string(status));
    cblas_dgemv(CblasRowMajor, CblasTrans, (int)m, (int)w->rows, 1.0, w->fields->displacement,
                (int)w->rows, w->residual, 1, 0.0, residual, 1);
    for (size_t i = 0; i < w->rows; i += 3) {
      const double length = supine_length(residual + i);
      supine_accuracy_tally_add(tally, 1, &length);
    }
  }
  const double size = sqrt(square_sum(w) / samples);
  *accuracy = (supine_accuracy){.direction_count = m,
                                .rms_mm = sqrt(tally->square_sum / samples),
                                .p95_mm = supine_accuracy_tally_percentile(tally, 0.95),
                                .max_mm = tally->largest};
  accuracy->relative_rms = accuracy->rms_mm / size;
  accuracy->relative_p95 = accuracy->p95_mm / size;
  accuracy->relative_max = accuracy->max_mm / size;
  return SUPINE_OK;
}

/* Compress the chosen fit to modes, or use its harmonics. */
static supine_status compress(const supine_expansion *expansion, const supine_fit_options *options,
                              double fit_error, supine_compression *made, supine_error *error) {
  double singular[SUPINE_MODES_MADE_MAX];
  double total = 0.0;
  if (options->modes == 0) {
    return supine_sh_compress_harmonics(expansion, made, error);
  }
  SUPINE_TRY(
      supine_sh_compress_modes(expansion, NULL, options->modes, made, singular, &total, error));
  if (options->fewest_modes) {
    supine_sh_compression_truncate(
        made, expansion->rank,
        supine_sh_modes_needed(made->mode_count, singular, total, fmax(fit_error, negligible)));
  }
  return SUPINE_OK;
}

/* Subtract from each mode its weight w in the posture of the scan. The constant harmonic is
 * 1 / sqrt(4 pi), so that its coefficient falls by sqrt(4 pi) w. */
static void subtract_scan(const double scan_gravity[3], supine_compression *made) {
  static const double sqrt_4pi = 3.5449077018110321;
  double weights[SUPINE_MODES_MADE_MAX];
  supine_sh_compression_weights(made, scan_gravity, weights);
  for (size_t k = 0; k < made->mode_count; ++k) {
    made->modes[k * supine_sh_count(made->band)] -= sqrt_4pi * weights[k];
  }
}

supine_status supine_fields_fit(const supine_fields *fields, const supine_fit_options *options,
                                supine_compression *compression, supine_fit_report *report,
                                supine_error *error) {
  const int m = (int)fields->direction_count;
  SUPINE_ARENA arena = {0};
  fitting w = {.fields = fields, .rows = 3 * fields->vertex_count, .arena = &arena};
  const int rows = (int)w.rows;
  SUPINE_FREED_BY(supine_sh_expansion_free) supine_expansion expansion = {0};
  SUPINE_FREED_BY(supine_sh_compression_free) supine_compression made = {0};
  supine_fit_report found = {0};
  SUPINE_REFUSE_IF(m < 2, error, SUPINE_ERROR_ARGUMENT,
                   "too few directions of gravity (%d): give fields for at least two", m);
  w.gram = supine_arena_take(&arena, (size_t)m * (size_t)m, sizeof *w.gram);
  w.residual = supine_arena_take(&arena, (size_t)m, sizeof *w.residual);
  SUPINE_TRY(supine_arena_check(&arena, error, "%d fields", m));
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, m, m, rows, 1.0, fields->displacement, rows,
              fields->displacement, rows, 0.0, w.gram, m);
  SUPINE_REFUSE_IF(!(square_sum(&w) > 0.0), error, SUPINE_ERROR_NUMERICAL,
                   "all displacements are zero: give fields that move the surface");
  SUPINE_TRY(choose_band(&w, options->band, &found, error));
  SUPINE_TRY(project(&w, found.band, &expansion, error));
  SUPINE_TRY(compress(&expansion, options, found.error[found.band], &made, error));
  SUPINE_TRY(cross_validate(&w, options->modes == 0 ? 0 : made.mode_count, &found.accuracy, error));
  if (options->scan_gravity != NULL) {
    subtract_scan(options->scan_gravity, &made);
  }
  found.mode_count = made.mode_count;
  *compression = made;
  *report = found;
  made = (supine_compression){0};
  return SUPINE_OK;
}

supine_status supine_fields_write(const supine_prepared *prepared, const supine_fields *fields,
                                  const supine_fit_options *options,
                                  const supine_basis_choice *basis, supine_fit_report *report,
                                  supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  SUPINE_FREED_BY(supine_sh_compression_free) supine_compression field = {0};
  SUPINE_FREED_BY(supine_physics_volume_forms_free) supine_volume_forms forms = {0};
  SUPINE_TRY(supine_fields_fit(fields, options, &field, report, error));
  SUPINE_TRY(supine_projection_volume_forms(&field, lungs, NULL, NULL, &forms, error));
  const supine_basis_content content = {.lungs = lungs,
                                        .prepared = prepared,
                                        .choice = basis,
                                        .is_fields = true,
                                        .scan_gravity = options->scan_gravity,
                                        .compression = &field,
                                        .forms = &forms,
                                        .accuracy = &report->accuracy};
  return supine_writer_basis_write(basis->path, &content, error);
}
