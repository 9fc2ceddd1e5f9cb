/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a law and its correction, and measure its error on held-out blocks. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/patient/krige.h"

#include "sh/base/parallel.h"
#include "sh/base/vec3.h"

enum {
  EXPECTED_MAX = 200, /* points at which the expected error is computed, about */
  FOLDS = SUPINE_PATIENT_FOLDS,
  ITEMS = SUPINE_PATIENT_SEEDS * FOLDS,
  SCORES = SUPINE_PATIENT_SCORES
};

/* Half widths of the 95 % interval over the expected error, for a point and for one component. */
static const double band_point = 1.8;
static const double band_component = 1.96;

/* Factor on the expected error within 8 mm of the surface, measured on ten patients. */
static const double near_surface = 1.3;

/* Sums over rows of weighted squares, mm^2, and of weights; numbers of points. All are doubles, so
 * that sums can be added. */
typedef struct squares {
  double of[SCORES], expected, weight, points, within;
} squares;

/* Inputs and working space of one fit. */
typedef struct study {
  supine_patient_fit_options options;
  const supine_patient_row *rows;
  size_t row_count, components;
  size_t *fold;        /* [SEEDS, row_count] */
  squares held[ITEMS]; /* residuals of held-out folds */
  supine_status failed[ITEMS];
} study;

/* Add the squared residuals of rows predicted by a fit, and by maps fitted to the same rows. */
static void add_rows(const study *s, const supine_patient_row *rows, size_t count,
                     supine_patient_krige *krige, squares *to) {
  const double band = s->components == 3 ? band_point : band_component;
  double map[2][SUPINE_PATIENT_AFFINE];
  supine_patient_affine_fit(krige->rows, krige->count, true, map[0]);
  supine_patient_affine_fit(krige->rows, krige->count, false, map[1]);
  for (size_t i = 0; i < count; i += s->components) {
    double square = 0.0;
    double expected = 0.0;
    double weight = 0.0;
    for (size_t j = i; j < i + s->components; ++j) {
      const supine_patient_row *row = &rows[j];
      double variance;
      double x[SUPINE_PATIENT_TERMS];
      const double residual[SCORES] = {row->value, supine_patient_affine_residual(map[0], row),
                                       supine_patient_affine_residual(map[1], row),
                                       supine_patient_power_design(&krige->alone, row, x),
                                       supine_patient_krige_predict(krige, row, &variance) -
                                           row->value};
      for (size_t k = 0; k < SCORES; ++k) {
        to->of[k] += row->weight * residual[k] * residual[k];
      }
      variance += pow(krige->noise * row->noise, 2.0);
      to->expected += row->weight * variance;
      square += pow(residual[SUPINE_PATIENT_SCORE_CORRECTED], 2.0);
      expected += variance;
      weight += row->weight;
    }
    to->weight += weight;
    to->points += weight > 0.0 ? 1.0 : 0.0;
    to->within += weight > 0.0 && square <= band * band * expected ? 1.0 : 0.0;
  }
}

static supine_status hold_out(const study *s, const size_t *fold, size_t which, squares *to) {
  const size_t n = s->row_count;
  supine_patient_row *rows = malloc(n * sizeof *rows); /* kept rows, then held-out rows */
  supine_patient_krige krige = {0};
  supine_status status = rows == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  size_t kept = 0;
  size_t count = 0;
  for (int held = 0; held < 2 && status == SUPINE_OK; ++held) {
    for (size_t i = 0; i < n; ++i) {
      if ((fold[i] == which) == (held == 1)) {
        rows[count++] = s->rows[i];
      }
    }
    kept = held ? kept : count;
  }
  if (status == SUPINE_OK && kept < n) {
    status = supine_patient_krige_fit(&s->options, rows, kept, &krige, NULL);
    if (status == SUPINE_OK) {
      add_rows(s, rows + kept, n - kept, &krige, to);
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
        hold_out(s, s->fold + item / FOLDS * s->row_count, item % FOLDS, &s->held[item]);
  }
}

static supine_status hold_all_out(study *s, squares *held, supine_error *error) {
  supine_parallel_for(ITEMS, 1, 0, hold_out_range, s);
  for (size_t item = 0; item < ITEMS; ++item) {
    const squares *of = &s->held[item];
    if (s->failed[item] != SUPINE_OK) {
      return supine_error_set(error, s->failed[item],
                              "fitting without the held-out blocks failed: %s",
                              supine_status_string(s->failed[item]));
    }
    for (size_t k = 0; k < sizeof *of / sizeof(double); ++k) {
      ((double *)held)[k] += ((const double *)of)[k];
    }
  }
  return SUPINE_OK;
}

/* Compute the expected error of a surface's points in three dimensions, mm RMS, and their mean
 * displacement, mm. Without landmarks, the rows hold nothing of the motion along the surface, so
 * the covariance of g is that of other patients. */
static supine_status expect(const study *s, size_t triples, const supine_patient_krige *fitted,
                            double *expected, double *mean, supine_error *error) {
  const size_t step = s->components * (1 + s->row_count / (s->components * EXPECTED_MAX));
  const double share = 1.0 / ceil((double)s->row_count / (double)step);
  supine_patient_fit_options options = s->options;
  supine_patient_krige krige = {0};
  double variance = 0.0;
  options.noise = fitted->noise;
  if (triples == 0) {
    options.sill = 1.0;
    options.uncorrected = false;
  }
  const supine_status status =
      supine_patient_krige_fit(&options, s->rows, s->row_count, &krige, error);
  *mean = 0.0;
  for (size_t i = 0; i < s->row_count && status == SUPINE_OK; i += step) {
    supine_patient_row row = s->rows[i];
    double u[3];
    supine_patient_direction(&fitted->law, &row.place,
                             supine_patient_force_at(&fitted->law, &row.place), u);
    *mean += supine_length(u) * share;
    for (size_t a = 0; a < 3; ++a) {
      double of;
      for (size_t b = 0; b < 3; ++b) {
        row.axis[b] = a == b ? 1.0 : 0.0;
      }
      (void)supine_patient_krige_predict(&krige, &row, &of);
      variance += of * share;
    }
  }
  *expected = near_surface * sqrt(variance);
  supine_patient_krige_free(&krige);
  return status;
}

static supine_patient_score baseline_of(const study *s) {
  return s->options.moved != SUPINE_PATIENT_STILL ? SUPINE_PATIENT_SCORE_TRANSLATION
                                                  : SUPINE_PATIENT_SCORE_NONE;
}

/* Convert sums to RMS; return the share of the squared displacement that is explained, %. */
static double conclude(const study *s, const squares *sums, double score[SCORES]) {
  for (size_t k = 0; k < SCORES; ++k) {
    score[k] = sqrt(sums->of[k] * (double)s->components / sums->weight);
  }
  return 100.0 * (1.0 - pow(score[SUPINE_PATIENT_SCORE_CORRECTED] / score[baseline_of(s)], 2.0));
}

/* Fit all rows, then without each fold. */
static supine_status run(study *s, size_t triples, supine_patient *patient,
                         supine_patient_fit_report *report, supine_error *error) {
  squares fitted = {.points = 0};
  squares held = {.points = 0};
  double moved = 0.0;
  supine_patient_krige krige = {0};
  supine_status status =
      supine_patient_krige_fit(&s->options, s->rows, s->row_count, &krige, error);
  if (status == SUPINE_OK) {
    add_rows(s, s->rows, s->row_count, &krige, &fitted);
    s->options.sill = krige.sill;
    s->options.uncorrected = krige.sill == 0.0;
    status = expect(s, triples, &krige, &report->expected_point, &moved, error);
    supine_patient_krige_errors(&krige, report->error);
    supine_patient_krige_take(&krige, patient);
  }
  if (status == SUPINE_OK) {
    status = hold_all_out(s, &held, error);
  }
  if (status == SUPINE_OK) {
    (void)conclude(s, &fitted, report->fitted);
    report->explained = conclude(s, &held, report->held_out);
    report->baseline = report->held_out[baseline_of(s)];
    if (s->components == 3) {
      report->expected_point = sqrt(held.expected * 3.0 / held.weight);
    }
    report->expected_constant = moved > 0.0 ? pow(report->expected_point, 2.0) / moved : 0.0;
    report->band = held.points > 0.0 ? 100.0 * held.within / held.points : 0.0;
  }
  supine_patient_krige_free(&krige);
  return status;
}

/* Seven parameters: the data, the options and the outputs of the fit. */
supine_status supine_patient_fit(const supine_patient_fit_options *options,
                                 supine_patient_row *rows, size_t single, size_t triples,
                                 supine_patient *patient, supine_patient_fit_report *report,
                                 supine_error *error) {
  static const size_t motion[] = {0, 3, 6};
  const size_t count = single + 3 * triples;
  const size_t needed = (options->law == SUPINE_PATIENT_PAPER ? 9 : 1) + motion[options->moved];
  study s = {.options = *options,
             .rows = rows,
             .row_count = count,
             .components = single > 0 ? 1 : 3,
             .fold = malloc(SUPINE_PATIENT_SEEDS * count * sizeof(size_t))};
  supine_status status = SUPINE_OK;
  *report = (supine_patient_fit_report){.points = (double)(single > 0 ? count : triples)};
  patient->law = options->law;
  if (single + triples < needed) {
    status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%zu points are fewer than the %zu unknowns of the %s law: give "
                              "more, or --law deep",
                              single + triples, needed, supine_patient_law_names[options->law]);
  }
  for (size_t seed = 0; seed < SUPINE_PATIENT_SEEDS && status == SUPINE_OK; ++seed) {
    const size_t blocks = s.fold == NULL ? 0
                                         : supine_patient_rows_fold(&patient->frame, rows, count,
                                                                    seed, s.fold + seed * count);
    report->blocks = (double)blocks;
    if (blocks == 0) {
      status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", count);
    }
  }
  if (status == SUPINE_OK) {
    status = run(&s, triples, patient, report, error);
  }
  free(s.fold);
  return status;
}
