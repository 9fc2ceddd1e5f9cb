/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit harmonics to another simulator's fields, and cross-validate the fit. */
#include <cblas.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/lapack.h"
#include "base/vec3.h"
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

/* Fit harmonics up to degree `band`. The arrays of the fit are valid until `kept` is freed. */
static supine_status fit_create(size_t band, size_t count, const double *directions,
                                supine_arena *kept, supine_fit_matrices *f) {
  const size_t terms = supine_sh_count(band);
  const int m = (int)count;
  const int p = (int)terms;
  SUPINE_ARENA arena = {0};
  *f = (supine_fit_matrices){.count = count, .terms = terms};
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

static double leverage(const supine_fit_matrices *f, size_t d) {
  return cblas_ddot((int)f->terms, f->harmonics + d * f->terms, 1, f->pinv + d, (int)f->count);
}

static bool fit_is_determined(const supine_fit_matrices *f) {
  bool determined = f->condition <= condition_max;
  for (size_t i = 0; i < f->count; ++i) {
    determined = determined && leverage(f, i) <= leverage_max;
  }
  return determined;
}

/* Predict the field for direction d of gravity from the fields for all other directions. Use the
 * harmonics if `modes` is 0, otherwise that number of principal modes of the fitted field. The
 * error, true minus predicted, is a weighted sum of all input fields. Write the weights to
 * residual [directions], and the squared norm of the error, mm^2, to `square`.
 *
 * Let A be f->pinv, h row d of f->harmonics x A, and e_d a vector that is 1 at d and 0 elsewhere.
 * The pseudo-inverse without direction d is
 *
 *     A_d = A - A e_d (e_d - h)^T / (1 - h_d) */
static supine_status predict(const double *gram, const supine_fit_matrices *f, size_t d,
                             size_t modes, double *residual, double *square) {
  const int m = (int)f->count;
  const int p = (int)f->terms;
  const double *y = f->harmonics + d * f->terms;
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
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, p, m, m, 1.0, pinv, m, gram, m, 0.0,
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
  cblas_dsymv(CblasRowMajor, CblasUpper, m, 1.0, gram, m, residual, 1, 0.0, gram_residual, 1);
  *square = fmax(cblas_ddot(m, gram_residual, 1, residual, 1), 0.0);
  return SUPINE_OK;
}

/* Sum the squared displacements of all fields, mm^2. */
static double square_sum(const supine_fit *fit) {
  const int m = (int)fit->fields->direction_count;
  return cblas_dasum(m, fit->gram, m + 1);
}

/* Compute the relative RMS leave-one-out error of a fit before its compression to modes. */
static supine_status leave_one_out(const supine_fit *fit, const supine_fit_matrices *f,
                                   double *error) {
  double sum = 0.0;
  SUPINE_ARENA arena = {0};
  double *residual = supine_arena_take(&arena, f->count, sizeof *residual);
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t d = 0; d < f->count; ++d) {
    double square;
    SUPINE_TRY(predict(fit->gram, f, d, 0, residual, &square));
    sum += square;
  }
  *error = sqrt(sum / square_sum(fit));
  return SUPINE_OK;
}

/* Fit harmonics up to each degree (band) that the directions determine. Choose band `wanted`. If it
 * is negative, prefer a higher band only if its leave-one-out error is over 1 % lower. */
static supine_status choose_band(supine_fit *fit, int wanted, supine_error *error) {
  const size_t m = fit->fields->direction_count;
  supine_fit_report *report = &fit->report;
  double least = INFINITY;
  size_t determined_count = 0;
  for (size_t band = 0; band <= SUPINE_FIT_BAND_MAX && supine_sh_count(band) < m; ++band) {
    supine_fit_matrices trial;
    supine_status status = fit_create(band, m, fit->fields->directions, &fit->memory, &trial);
    const bool determined = status == SUPINE_OK && fit_is_determined(&trial);
    if (determined) {
      status = leave_one_out(fit, &trial, &report->error[band]);
    }
    SUPINE_REFUSE_IF(status != SUPINE_OK, error, status, "fit of band %zu: %s", band,
                     supine_status_string(status));
    if (!determined) {
      break;
    }
    determined_count = band + 1;
    const bool better = report->error[band] < worthwhile * least && least > exact;
    if ((wanted < 0 && better) || (wanted >= 0 && (size_t)wanted == band)) {
      least = report->error[band];
      fit->chosen = trial;
      report->band = band;
    }
  }
  SUPINE_REFUSE_IF(fit->chosen.harmonics == NULL, error, SUPINE_ERROR_ARGUMENT,
                   "%zu directions do not determine band %d (%d harmonics); the highest band that "
                   "they determine is %d: give more directions, or leave --band out",
                   m, wanted, (wanted + 1) * (wanted + 1), (int)determined_count - 1);
  report->band_highest = determined_count - 1;
  return SUPINE_OK;
}

supine_status supine_fields_fit(const supine_fields *fields, int band, supine_fit *fit,
                                supine_error *error) {
  const int m = (int)fields->direction_count;
  const int rows = 3 * (int)fields->vertex_count;
  *fit = (supine_fit){.fields = fields, .report = {.direction_count = fields->direction_count}};
  SUPINE_REFUSE_IF(m < 2, error, SUPINE_ERROR_ARGUMENT,
                   "too few directions of gravity (%d): give fields for at least two", m);
  fit->gram = supine_arena_take(&fit->memory, (size_t)m * (size_t)m, sizeof *fit->gram);
  SUPINE_TRY(supine_arena_check(&fit->memory, error, "%d fields", m));
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, m, m, rows, 1.0, fields->displacement, rows,
              fields->displacement, rows, 0.0, fit->gram, m);
  SUPINE_REFUSE_IF(!(square_sum(fit) > 0.0), error, SUPINE_ERROR_NUMERICAL,
                   "all displacements are zero: give fields that move the surface");
  return choose_band(fit, band, error);
}

void supine_fields_fit_free(supine_fit *fit) {
  supine_arena_free(&fit->memory);
}

double supine_fields_fit_error(const supine_fit *fit) {
  return fmax(fit->report.error[fit->report.band], negligible);
}

supine_status supine_fields_field(const supine_fit *fit, supine_gravity_field *field,
                                  supine_error *error) {
  const size_t m = fit->chosen.count;
  const size_t terms = fit->chosen.terms;
  const size_t rows = 3 * fit->fields->vertex_count;
  supine_expansion *made = &field->expansion;
  field->rows = (supine_rows){.kind = SUPINE_ROWS_VECTOR};
  *made = (supine_expansion){.row_count = rows, .band = fit->report.band, .rank = m};
  made->columns = malloc(rows * m * sizeof *made->columns);
  made->functions = malloc(m * terms * sizeof *made->functions);
  if (made->columns == NULL || made->functions == NULL) {
    return supine_error_memory(error, "%zu fields", m);
  }
  for (size_t d = 0; d < m; ++d) {
    for (size_t i = 0; i < rows; ++i) {
      made->columns[i * m + d] = fit->fields->displacement[d * rows + i];
    }
    for (size_t t = 0; t < terms; ++t) {
      made->functions[d * terms + t] = fit->chosen.pinv[t * m + d];
    }
  }
  return SUPINE_OK;
}

supine_status supine_fields_measure(const supine_fit *fit, size_t modes, supine_accuracy *accuracy,
                                    supine_error *error) {
  const size_t m = fit->fields->direction_count;
  const size_t rows = 3 * fit->fields->vertex_count;
  const double samples = (double)m * (double)fit->fields->vertex_count;
  SUPINE_ARENA arena = {0};
  supine_tally *tally = supine_arena_zeros(&arena, 1, sizeof *tally);
  double *weights = supine_arena_take(&arena, m, sizeof *weights);
  double *residual = supine_arena_take(&arena, rows, sizeof *residual); /* mm */
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", rows / 3));
  for (size_t d = 0; d < m; ++d) {
    double square;
    const supine_status status = predict(fit->gram, &fit->chosen, d, modes, weights, &square);
    SUPINE_REFUSE_IF(status != SUPINE_OK, error, status, "cross-validation: %s",
                     supine_status_string(status));
    cblas_dgemv(CblasRowMajor, CblasTrans, (int)m, (int)rows, 1.0, fit->fields->displacement,
                (int)rows, weights, 1, 0.0, residual, 1);
    for (size_t i = 0; i < rows; i += 3) {
      const double length = supine_length(residual + i);
      supine_accuracy_tally_add(tally, 1, &length);
    }
  }
  const double size = sqrt(square_sum(fit) / samples);
  *accuracy = (supine_accuracy){.direction_count = m,
                                .rms_mm = sqrt(tally->square_sum / samples),
                                .p95_mm = supine_accuracy_tally_percentile(tally, 0.95),
                                .max_mm = tally->largest};
  accuracy->relative_rms = accuracy->rms_mm / size;
  accuracy->relative_p95 = accuracy->p95_mm / size;
  accuracy->relative_max = accuracy->max_mm / size;
  return SUPINE_OK;
}
