/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a displacement law with its kriging correction, and measure the error on held-out points. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <gsl/gsl_rng.h>
#include <lapacke.h>

#include "precompute/patient/krige.h"

#include "base/parallel.h"
#include "base/vec3.h"

enum {
  EXPECTED_MAX = 200, /* largest number of points used to compute the expected error */
  FOLDS = 5,
  SEEDS = 3,   /* number of cross-validations, each with new random folds */
  AFFINE = 12, /* number of constants of an affine map */
  ITEMS = SEEDS * FOLDS,
  SCORES = SUPINE_PATIENT_SCORES
};

/* Radius that contains 95 % of the errors of points in 3-D, and bound on 95 % of the errors along
 * one axis, both divided by the expected error. */
static const double bound_point = 1.8, bound_component = 1.96;
/* Ratio of measured to expected error of points within 8 mm of the surface, in ten patients. */
static const double near_surface = 1.3;

typedef struct squares {
  double residual[SCORES]; /* [predictor] weighted sum of squared residuals, mm^2 */
  double expected;         /* weighted sum of the expected variances of the residuals, mm^2 */
  double weight;
  double points, within; /* number of points, and of those with an error below the 95 % bound */
} squares;

typedef struct study {
  supine_patient_fit_options options;
  const supine_patient_row *rows;
  size_t row_count, components;
  size_t *fold;            /* [SEEDS, row_count] fold of each measurement */
  squares held_out[ITEMS]; /* [SEEDS, FOLDS] squared errors of held-out measurements, summed */
  supine_status failed[ITEMS];
} study;

/* Compute the derivatives x of axis . (t + M p) with respect to the 12 elements of the vector t
 * and the matrix M. p is row->place.offset in units of 100 mm. */
static void affine_design(const supine_patient_row *row, double x[AFFINE]) {
  for (size_t a = 0; a < 3; ++a) {
    x[a] = row->axis[a];
    for (size_t b = 0; b < 3; ++b) {
      x[3 + 3 * a + b] = row->axis[a] * 0.01 * row->place.offset[b];
    }
  }
}

/* Fit the affine map t + M p of a position p to measurements or, if `translation` is true, only t.
 * Write t and M into map, or zeros on failure. */
static void affine_fit(const supine_patient_row *rows, size_t count, bool translation,
                       double map[AFFINE]) {
  double matrix[AFFINE * AFFINE] = {0.0};
  double trace = 0.0;
  const lapack_int size = translation ? 3 : AFFINE;
  memset(map, 0, AFFINE * sizeof *map);
  for (size_t i = 0; i < count; ++i) {
    double x[AFFINE];
    affine_design(&rows[i], x);
    cblas_dsyr(CblasColMajor, CblasUpper, AFFINE, rows[i].weight, x, 1, matrix, AFFINE);
    cblas_daxpy(size, rows[i].weight * rows[i].value, x, 1, map, 1);
    trace += rows[i].weight * cblas_ddot(AFFINE, x, 1, x, 1);
  }
  for (size_t a = 0; a < AFFINE; ++a) {
    matrix[a * AFFINE + a] += 1e-9 * trace; /* makes the matrix positive definite */
  }
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', size, 1, matrix, AFFINE, map, AFFINE) != 0) {
    memset(map, 0, AFFINE * sizeof *map);
  }
}

static double affine_residual(const double map[AFFINE], const supine_patient_row *row) {
  double x[AFFINE];
  affine_design(row, x);
  return cblas_ddot(AFFINE, x, 1, map, 1) - row->value;
}

/* Group the measurements into cubes of 40 mm, and the cubes at random into folds. Write the fold of
 * each measurement into fold [count]. Return the number of cubes, or 0 if out of memory. */
static size_t assign_folds(const supine_patient_frame *frame, supine_patient_row *rows,
                           size_t count, unsigned long seed, size_t *fold) {
  const size_t blocks = supine_patient_rows_block(frame, rows, count, seed + 1);
  size_t *fold_of = malloc((blocks + 1) * sizeof *fold_of);
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  const bool able = fold_of != NULL && random != NULL;
  if (able) {
    gsl_rng_set(random, 1000 + seed);
    for (size_t b = 0; b < blocks; ++b) {
      const size_t other = gsl_rng_uniform_int(random, b + 1);
      fold_of[b] = fold_of[other];
      fold_of[other] = b % FOLDS;
    }
    for (size_t i = 0; i < count; ++i) {
      fold[i] = fold_of[rows[i].block];
    }
  }
  gsl_rng_free(random);
  free(fold_of);
  return able ? blocks : 0;
}

/* Fit each predictor of supine_patient_score (no displacement, translation, affine map,
 * displacement law, corrected law) to krige->rows. Add the squared errors at `rows` to the sums of
 * each. */
static void add_residuals(const study *s, const supine_patient_row *rows, size_t count,
                          supine_patient_krige *krige, squares *sums) {
  const double bound = s->components == 3 ? bound_point : bound_component;
  double map[2][AFFINE];
  affine_fit(krige->rows, krige->count, true, map[0]);
  affine_fit(krige->rows, krige->count, false, map[1]);
  for (size_t i = 0; i < count; i += s->components) {
    double square = 0.0;
    double expected = 0.0;
    double weight = 0.0;
    for (size_t j = i; j < i + s->components; ++j) {
      const supine_patient_row *row = &rows[j];
      double variance;
      double x[SUPINE_PATIENT_TERMS];
      const double residual[SCORES] = {
          row->value, affine_residual(map[0], row), affine_residual(map[1], row),
          supine_patient_power_design(&krige->uncorrected_law, row, x),
          supine_patient_krige_predict(krige, row, &variance) - row->value};
      for (size_t k = 0; k < SCORES; ++k) {
        sums->residual[k] += row->weight * residual[k] * residual[k];
      }
      variance += pow(krige->noise * row->noise, 2.0);
      sums->expected += row->weight * variance;
      square += pow(residual[SUPINE_PATIENT_SCORE_CORRECTED], 2.0);
      expected += variance;
      weight += row->weight;
    }
    sums->weight += weight;
    sums->points += weight > 0.0 ? 1.0 : 0.0;
    sums->within += weight > 0.0 && square <= bound * bound * expected ? 1.0 : 0.0;
  }
}

static supine_status hold_out(const study *s, const size_t *fold, size_t which, squares *sums) {
  const size_t n = s->row_count;
  /* First the measurements to which the law is fitted, then the held-out ones. */
  supine_patient_row *rows = malloc(n * sizeof *rows);
  supine_patient_krige krige = {0};
  supine_status status = rows == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  size_t fitted_count = 0;
  size_t count = 0;
  for (int held_out = 0; held_out < 2 && status == SUPINE_OK; ++held_out) {
    for (size_t i = 0; i < n; ++i) {
      if ((fold[i] == which) == (held_out == 1)) {
        rows[count++] = s->rows[i];
      }
    }
    fitted_count = held_out ? fitted_count : count;
  }
  if (status == SUPINE_OK && fitted_count < n) {
    status = supine_patient_krige_fit(&s->options, rows, fitted_count, &krige, NULL);
    if (status == SUPINE_OK) {
      add_residuals(s, rows + fitted_count, n - fitted_count, &krige, sums);
    }
  }
  supine_patient_krige_free(&krige);
  free(rows);
  return status;
}

static void hold_out_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  study *s = context;
  for (size_t item = begin; item < end; ++item) {
    s->failed[item] =
        hold_out(s, s->fold + item / FOLDS * s->row_count, item % FOLDS, &s->held_out[item]);
  }
}

static supine_status hold_all_out(study *s, squares *held_out, supine_error *error) {
  supine_parallel_for(ITEMS, 1, 0, hold_out_range, s);
  for (size_t item = 0; item < ITEMS; ++item) {
    const squares *item_sums = &s->held_out[item];
    if (s->failed[item] != SUPINE_OK) {
      return supine_error_set(error, s->failed[item],
                              "the points outside some blocks of 40 mm do not determine the law "
                              "(%s): give more points, spread over both lungs",
                              supine_status_string(s->failed[item]));
    }
    for (size_t k = 0; k < sizeof *item_sums / sizeof(double); ++k) {
      ((double *)held_out)[k] += ((const double *)item_sums)[k];
    }
  }
  return SUPINE_OK;
}

/* Return the mean length of the displacements by `law`, mm. Write into `expected` the RMS error of
 * the corrected displacement, mm, that the kriging variance predicts. For landmarks, write 0. */
static double find_expected_error(const study *s, const supine_patient_power *law,
                                  supine_patient_krige *krige, double *expected) {
  const size_t step = s->components * (1 + s->row_count / (s->components * EXPECTED_MAX));
  const double share = 1.0 / ceil((double)s->row_count / (double)step);
  double variance = 0.0;
  double mean = 0.0;
  for (size_t i = 0; i < s->row_count; i += step) {
    supine_patient_row row = s->rows[i];
    double u[3];
    supine_patient_direction(law, &row.place, supine_patient_force_at(law, &row.place), u);
    mean += supine_length(u) * share;
    for (size_t a = 0; a < 3 && s->components == 1; ++a) {
      double axis_variance;
      for (size_t b = 0; b < 3; ++b) {
        row.axis[b] = a == b ? 1.0 : 0.0;
      }
      (void)supine_patient_krige_predict(krige, &row, &axis_variance);
      variance += axis_variance * share;
    }
  }
  *expected = near_surface * sqrt(variance);
  return mean;
}

static supine_patient_score baseline_of(const study *s) {
  return s->options.scan_motion != SUPINE_PATIENT_STILL ? SUPINE_PATIENT_SCORE_TRANSLATION
                                                        : SUPINE_PATIENT_SCORE_NONE;
}

/* Compute the RMS error of each predictor, mm, from the sums of squared residuals. Return by how
 * many percent the kriging-corrected law reduces the mean square error of the baseline. */
static double find_rms(const study *s, const squares *sums, double score[SCORES]) {
  for (size_t k = 0; k < SCORES; ++k) {
    score[k] = sqrt(sums->residual[k] * (double)s->components / sums->weight);
  }
  return 100.0 * (1.0 - pow(score[SUPINE_PATIENT_SCORE_CORRECTED] / score[baseline_of(s)], 2.0));
}

/* Fit to all measurements. Then leave out each fold in turn, and measure the error on this fold. */
static supine_status run(study *s, size_t triples, supine_patient *patient,
                         supine_patient_fit_report *report, supine_error *error) {
  squares fitted = {.points = 0};
  squares held_out = {.points = 0};
  double mean_displacement = 0.0;
  supine_patient_krige krige = {0};
  const bool sliding_unseen = triples == 0;
  supine_patient_krige population = {0}; /* a fit with the covariance found in other patients */
  supine_status status =
      supine_patient_krige_fit(&s->options, s->rows, s->row_count, &krige, error);
  if (status == SUPINE_OK) {
    add_residuals(s, s->rows, s->row_count, &krige, &fitted);
    s->options.sill = krige.sill;
    s->options.uncorrected = krige.sill == 0.0;
    supine_patient_krige_errors(&krige, report->error);
    supine_patient_krige_copy_law(&krige, patient);
  }
  if (status == SUPINE_OK && sliding_unseen) {
    supine_patient_fit_options options = s->options;
    options.sill = 1.0;
    options.noise = krige.noise;
    options.uncorrected = false;
    status = supine_patient_krige_fit(&options, s->rows, s->row_count, &population, error);
  }
  if (status == SUPINE_OK) {
    mean_displacement = find_expected_error(s, &krige.law, sliding_unseen ? &population : &krige,
                                            &report->expected_point);
  }
  if (status == SUPINE_OK) {
    status = hold_all_out(s, &held_out, error);
  }
  if (status == SUPINE_OK) {
    (void)find_rms(s, &fitted, report->fitted);
    report->explained = find_rms(s, &held_out, report->held_out);
    report->baseline = report->held_out[baseline_of(s)];
    if (s->components == 3) {
      report->expected_point = sqrt(held_out.expected * 3.0 / held_out.weight);
    }
    report->expected_constant =
        mean_displacement > 0.0 ? pow(report->expected_point, 2.0) / mean_displacement : 0.0;
    report->band = held_out.points > 0.0 ? 100.0 * held_out.within / held_out.points : 0.0;
  }
  supine_patient_krige_free(&population);
  supine_patient_krige_free(&krige);
  return status;
}

supine_status supine_patient_fit(const supine_patient_fit_options *options,
                                 supine_patient_row *rows, size_t single, size_t triples,
                                 supine_patient *patient, supine_patient_fit_report *report,
                                 supine_error *error) {
  const size_t count = single + 3 * triples;
  const size_t needed = (options->law == SUPINE_PATIENT_PAPER ? 9 : 1) + options->scan_motion;
  study s = {.options = *options,
             .rows = rows,
             .row_count = count,
             .components = single > 0 ? 1 : 3,
             .fold = malloc(SEEDS * count * sizeof(size_t))};
  supine_status status = SUPINE_OK;
  *report = (supine_patient_fit_report){.points = (double)(single > 0 ? count : triples)};
  patient->law = options->law;
  if (single + triples < needed) {
    status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "points: %zu, fewer than the %zu unknowns of the %s law: give more "
                              "points, or use --law deep",
                              single + triples, needed, supine_patient_law_names[options->law]);
  }
  for (size_t seed = 0; seed < SEEDS && status == SUPINE_OK; ++seed) {
    const size_t blocks =
        s.fold == NULL ? 0
                       : assign_folds(&patient->frame, rows, count, seed, s.fold + seed * count);
    report->blocks = (double)blocks;
    if (blocks == 0) {
      status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu values", count);
    }
  }
  if (status == SUPINE_OK) {
    status = run(&s, triples, patient, report, error);
  }
  free(s.fold);
  return status;
}
