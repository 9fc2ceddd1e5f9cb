/* SPDX-License-Identifier: GPL-3.0-or-later */
/* All laws fitted, each held out, one kept. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_rng.h>
#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>

#include "precompute/patient/fit.h"

#include "sh/base/parallel.h"

enum {
  FOLDS = SUPINE_PATIENT_FOLDS,
  SEEDS = SUPINE_PATIENT_SEEDS,
  RIDGES = 5,
  REPLICATES = 100, /* of the bootstrap: a standard error is known to 7 % */
  FIT_STEPS = 200,
  REFIT_STEPS = 30,
  POLYNOMIAL = SUPINE_PATIENT_POLYNOMIAL
};

/* mm^2, per unit of a coefficient: data of n points weigh about n / 5. */
static const double quadratic_ridges[RIDGES] = {0.3, 1.0, 3.0, 10.0, 30.0};
static const double lung_ridges[RIDGES] = {1.0, 3.0, 10.0, 30.0, 1000.0};

static const double same_start = 0.01;

/* Relative, of a step: fits of parts of the data need not be sharper than what they show. */
static const double fit_tolerance = 1e-8;
static const double refit_tolerance = 1e-3;

/* Everything between the rows and the patient. */
typedef struct study {
  const supine_patient_frame *frame;
  supine_patient_row *rows;
  size_t row_count, components;
  supine_patient_moved moved;
  supine_patient_power power;      /* of all rows */
  size_t *fold;                    /* [SEEDS, row_count] */
  supine_patient_normals *normals; /* [SEEDS, FOLDS] */
  double *squares;                 /* [SEEDS * FOLDS] left of the paper's law in each fold */
  supine_patient_power *drawn;     /* [REPLICATES] */
  size_t blocks;
  supine_status *failed; /* [SEEDS * FOLDS or REPLICATES] */
} study;

void supine_patient_constants(const supine_patient *patient, double c[SUPINE_PATIENT_CONSTANTS]) {
  for (size_t a = 0; a < 3; ++a) {
    c[2 * a] = patient->lengths[a];
    c[2 * a + 1] = patient->powers[a];
    c[6 + a] = patient->powers[3 + a];
  }
}

/* Deals the blocks of a seed's grid to the folds, and sums up the normal equations of each. */
static supine_status deal(study *s, size_t seed, supine_error *error) {
  const size_t blocks = supine_patient_rows_block(s->frame, s->rows, s->row_count, seed + 1);
  size_t *fold_of = malloc((blocks + 1) * sizeof *fold_of);
  if (blocks == 0 || fold_of == NULL ||
      supine_patient_rows_deal(blocks, FOLDS, 1000 + seed, fold_of) != SUPINE_OK) {
    free(fold_of);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu blocks", blocks);
  }
  for (size_t i = 0; i < s->row_count; ++i) {
    const size_t fold = fold_of[s->rows[i].block];
    s->fold[seed * s->row_count + i] = fold;
    supine_patient_normals_add_row(&s->normals[seed * FOLDS + fold], &s->rows[i]);
  }
  s->blocks = blocks;
  free(fold_of);
  return SUPINE_OK;
}

/* --- polynomials ----------------------------------------------------------------------------- */

/* The normal equations of a seed's folds but for two (FOLDS: none). */
static void sum_but(const study *s, size_t seed, size_t first, size_t second,
                    supine_patient_normals *sum) {
  memset(sum, 0, sizeof *sum);
  for (size_t fold = 0; fold < FOLDS; ++fold) {
    if (fold != first && fold != second) {
      supine_patient_normals_add(sum, &s->normals[seed * FOLDS + fold]);
    }
  }
}

/* What a polynomial leaves of held-out folds, mm^2: those of one seed but `without`, each fitted on
 * the others but `without`. */
static double held_out_squares(const study *s, size_t seed, size_t without,
                               const double penalty[POLYNOMIAL]) {
  supine_patient_normals sum;
  double coefficients[POLYNOMIAL];
  double squares = 0.0;
  for (size_t fold = 0; fold < FOLDS; ++fold) {
    const supine_patient_normals *held = &s->normals[seed * FOLDS + fold];
    if (fold == without || held->weight == 0.0) {
      continue;
    }
    sum_but(s, seed, fold, without, &sum);
    if (supine_patient_polynomial_fit(&sum, penalty, coefficients) != SUPINE_OK) {
      return INFINITY;
    }
    squares += supine_patient_polynomial_squares(held, coefficients);
  }
  return squares;
}

/* The ridge that leaves least of held-out folds: of all seeds, or of one without a fold, so that
 * what judges the law has not chosen its ridge. */
static void choose_ridge(const study *s, size_t seed, size_t without, double *quadratic,
                         double *lung) {
  const bool one = s->frame->only_side != 0;
  double least = INFINITY;
  for (size_t i = 0; i < RIDGES; ++i) {
    for (size_t j = 0; j < (one ? 1 : RIDGES); ++j) {
      double penalty[POLYNOMIAL];
      double squares = 0.0;
      supine_patient_penalty_quadratic(quadratic_ridges[i], lung_ridges[j], one, penalty);
      for (size_t k = 0; k < SEEDS; ++k) {
        if (seed == SEEDS || k == seed) {
          squares += held_out_squares(s, k, without, penalty);
        }
      }
      if (squares < least) {
        least = squares;
        *quadratic = quadratic_ridges[i];
        *lung = lung_ridges[j];
      }
    }
  }
}

static double quadratic_held_out(const study *s) {
  double squares = 0.0;
  for (size_t item = 0; item < SEEDS * FOLDS; ++item) {
    supine_patient_normals sum;
    double penalty[POLYNOMIAL];
    double coefficients[POLYNOMIAL];
    double quadratic = quadratic_ridges[RIDGES - 1];
    double lung = lung_ridges[RIDGES - 1];
    if (s->normals[item].weight == 0.0) {
      continue;
    }
    choose_ridge(s, item / FOLDS, item % FOLDS, &quadratic, &lung);
    supine_patient_penalty_quadratic(quadratic, lung, s->frame->only_side != 0, penalty);
    sum_but(s, item / FOLDS, item % FOLDS, FOLDS, &sum);
    squares += supine_patient_polynomial_fit(&sum, penalty, coefficients) == SUPINE_OK
                   ? supine_patient_polynomial_squares(&s->normals[item], coefficients)
                   : INFINITY;
  }
  return squares;
}

/* --- the paper's law ------------------------------------------------------------------------- */

/* Fits the rows of a copy from where the fit of all rows ended, and from the first start. */
static supine_status refit(const study *s, const supine_patient_row *rows, size_t count,
                           bool afresh, supine_patient_power *fit) {
  supine_patient_power other;
  supine_status status = supine_patient_power_fit(rows, count, s->moved, s->power.powers,
                                                  REFIT_STEPS, refit_tolerance, fit, NULL);
  if (afresh && status == SUPINE_OK) {
    status = supine_patient_power_fit(rows, count, s->moved, supine_patient_starts[0], REFIT_STEPS,
                                      refit_tolerance, &other, NULL);
    if (status == SUPINE_OK && other.squares < fit->squares) {
      *fit = other;
    }
  }
  return status;
}

static void hold_out_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  study *s = context;
  for (size_t item = begin; item < end; ++item) {
    const size_t *fold = s->fold + item / FOLDS * s->row_count;
    supine_patient_power fit;
    supine_patient_row *kept = malloc(s->row_count * sizeof *kept);
    size_t count = 0;
    s->failed[item] = SUPINE_ERROR_MEMORY;
    for (size_t i = 0; kept != NULL && i < s->row_count; ++i) {
      if (fold[i] != item % FOLDS) {
        kept[count++] = s->rows[i];
      }
    }
    if (kept != NULL && count == s->row_count) {
      s->failed[item] = SUPINE_OK; /* an empty fold */
    } else if (kept != NULL) {
      s->failed[item] = refit(s, kept, count, true, &fit);
      for (size_t i = 0; s->failed[item] == SUPINE_OK && i < s->row_count; ++i) {
        if (fold[i] == item % FOLDS) {
          s->squares[item] +=
              s->rows[i].weight * pow(supine_patient_power_residual(&fit, &s->rows[i]), 2.0);
        }
      }
    }
    free(kept);
  }
}

/* Blocks drawn with replacement, as many as there are. */
static void draw_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  study *s = context;
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  size_t *times = malloc(s->blocks * sizeof *times);
  supine_patient_row *drawn = malloc(s->row_count * sizeof *drawn);
  for (size_t item = begin; item < end; ++item) {
    size_t count = 0;
    s->failed[item] = SUPINE_ERROR_MEMORY;
    if (random == NULL || times == NULL || drawn == NULL) {
      continue;
    }
    gsl_rng_set(random, 1 + item);
    memset(times, 0, s->blocks * sizeof *times);
    for (size_t b = 0; b < s->blocks; ++b) {
      ++times[gsl_rng_uniform_int(random, s->blocks)];
    }
    for (size_t i = 0; i < s->row_count; ++i) {
      if (times[s->rows[i].block] > 0) {
        drawn[count] = s->rows[i];
        drawn[count++].weight *= (double)times[s->rows[i].block];
      }
    }
    s->failed[item] = refit(s, drawn, count, false, &s->drawn[item]);
  }
  free(times);
  free(drawn);
  if (random != NULL) {
    gsl_rng_free(random);
  }
}

static supine_status failure(const study *s, size_t count, const char *what, supine_error *error) {
  for (size_t i = 0; i < count; ++i) {
    if (s->failed[i] != SUPINE_OK) {
      return supine_error_set(error, s->failed[i], "%s failed: %s", what,
                              supine_status_string(s->failed[i]));
    }
  }
  return SUPINE_OK;
}

static double constant_of(const supine_patient_power *fit, size_t c) {
  return c >= 6 ? fit->powers[c - 3] : c % 2 == 0 ? fit->linear[c / 2] : fit->powers[c / 2];
}

static supine_status bootstrap(study *s, supine_patient_fit_report *report, supine_error *error) {
  supine_parallel_for(REPLICATES, 1, 0, draw_range, s);
  const supine_status status = failure(s, REPLICATES, "the bootstrap", error);
  for (size_t c = 0; c < SUPINE_PATIENT_CONSTANTS && status == SUPINE_OK; ++c) {
    double values[REPLICATES];
    for (size_t i = 0; i < REPLICATES; ++i) {
      values[i] = constant_of(&s->drawn[i], c);
    }
    gsl_sort(values, 1, REPLICATES);
    report->error[c] = gsl_stats_sd(values, 1, REPLICATES);
    report->low[c] = gsl_stats_quantile_from_sorted_data(values, 1, REPLICATES, 0.025);
    report->high[c] = gsl_stats_quantile_from_sorted_data(values, 1, REPLICATES, 0.975);
  }
  return status;
}

/* Largest difference between two fits over the rows. */
static double apart(const study *s, const supine_patient_power *a, const supine_patient_power *b) {
  double most = 0.0;
  for (size_t i = 0; i < s->row_count; ++i) {
    most = fmax(most, fabs(supine_patient_power_residual(a, &s->rows[i]) -
                           supine_patient_power_residual(b, &s->rows[i])));
  }
  return most;
}

static double root_mean(const study *s, double squares, double weight) {
  return sqrt(squares * (double)s->components / weight);
}

static supine_status fit_power(study *s, double weight, supine_patient_fit_report *report,
                               supine_error *error) {
  supine_patient_power fits[SUPINE_PATIENT_STARTS];
  size_t best = 0;
  for (size_t k = 0; k < SUPINE_PATIENT_STARTS; ++k) {
    const supine_status status =
        supine_patient_power_fit(s->rows, s->row_count, s->moved, supine_patient_starts[k],
                                 FIT_STEPS, fit_tolerance, &fits[k], error);
    if (status != SUPINE_OK) {
      return status;
    }
    report->starts[k] = root_mean(s, fits[k].squares, weight);
    best = fits[k].squares < fits[best].squares ? k : best;
  }
  for (size_t k = 0; k < SUPINE_PATIENT_STARTS; ++k) {
    report->starts_agreeing +=
        report->starts[k] <= (1.0 + same_start) * report->starts[best] + 1e-6;
    report->start_apart = fmax(report->start_apart, apart(s, &fits[k], &fits[best]));
  }
  s->power = fits[best];
  memcpy(report->at_bound, s->power.at_bound, sizeof report->at_bound);
  return SUPINE_OK;
}

/* --- all of it ------------------------------------------------------------------------------- */

static void score_polynomials(const study *s, double weight, supine_patient_fit_report *report,
                              double affine[POLYNOMIAL], double quadratic[POLYNOMIAL]) {
  double penalty[4][POLYNOMIAL];
  double coefficients[4][POLYNOMIAL];
  double *held[4] = {&report->held_out.translation, &report->held_out.law[SUPINE_PATIENT_AFFINE],
                     &report->held_out.affine_lungs, NULL};
  double *fitted[4] = {&report->fitted.translation, &report->fitted.law[SUPINE_PATIENT_AFFINE],
                       &report->fitted.affine_lungs, &report->fitted.law[SUPINE_PATIENT_QUADRATIC]};
  const bool one = s->frame->only_side != 0;
  supine_patient_normals all;
  sum_but(s, 0, FOLDS, FOLDS, &all);
  choose_ridge(s, SEEDS, FOLDS, &report->ridge_quadratic, &report->ridge_lung);
  supine_patient_penalty_translation(penalty[0]);
  supine_patient_penalty_affine(false, penalty[1]);
  supine_patient_penalty_affine(!one, penalty[2]);
  supine_patient_penalty_quadratic(report->ridge_quadratic, report->ridge_lung, one, penalty[3]);
  for (size_t k = 0; k < 4; ++k) {
    if (supine_patient_polynomial_fit(&all, penalty[k], coefficients[k]) != SUPINE_OK) {
      memset(coefficients[k], 0, sizeof coefficients[k]);
    }
    *fitted[k] = root_mean(s, supine_patient_polynomial_squares(&all, coefficients[k]), weight);
    for (size_t seed = 0; seed < SEEDS && held[k] != NULL; ++seed) {
      *held[k] += held_out_squares(s, seed, FOLDS, penalty[k]);
    }
    if (held[k] != NULL) {
      *held[k] = root_mean(s, *held[k], SEEDS * weight);
    }
  }
  report->held_out.law[SUPINE_PATIENT_QUADRATIC] =
      root_mean(s, quadratic_held_out(s), SEEDS * weight);
  report->fitted.none = report->held_out.none = root_mean(s, all.squares, weight);
  report->fitted.affine = report->fitted.law[SUPINE_PATIENT_AFFINE];
  report->held_out.affine = report->held_out.law[SUPINE_PATIENT_AFFINE];
  memcpy(affine, coefficients[1], sizeof coefficients[1]);
  memcpy(quadratic, coefficients[3], sizeof coefficients[3]);
}

/* Points that a law needs: as many as its unknowns would be if each point gave one number, so that
 * each is three times overdetermined by landmarks. */
static size_t points_needed(supine_patient_law law, supine_patient_moved moved, bool one) {
  static const size_t unknowns[SUPINE_PATIENT_LAW_COUNT] = {9, 12, 30};
  const size_t motion = moved == SUPINE_PATIENT_STILL ? 0 : moved == SUPINE_PATIENT_RIGID ? 6 : 3;
  return law == SUPINE_PATIENT_PAPER               ? unknowns[law] + motion
         : law == SUPINE_PATIENT_QUADRATIC && !one ? 2 * unknowns[law]
                                                   : unknowns[law];
}

static supine_status choose_law(const study *s, const supine_patient_fit_options *options,
                                const supine_patient_fit_report *report, supine_patient_law *law,
                                supine_error *error) {
  const bool one = s->frame->only_side != 0;
  const char *name = supine_patient_law_names[options->law];
  if (options->law_given) {
    const size_t needed = points_needed(options->law, options->moved, one);
    *law = options->law;
    return report->count >= needed
               ? SUPINE_OK
               : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                  "%zu points are fewer than the %zu unknowns of the %s law: give "
                                  "more, or a law of fewer",
                                  report->count, needed, name);
  }
  double least = INFINITY;
  for (int k = 0; k < SUPINE_PATIENT_LAW_COUNT; ++k) {
    if (report->count >= points_needed((supine_patient_law)k, options->moved, one) &&
        report->held_out.law[k] < least) {
      least = report->held_out.law[k];
      *law = (supine_patient_law)k;
    }
  }
  return isfinite(least)
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%zu points determine no law: give more", report->count);
}

static void fill(const study *s, supine_patient_law law, const double *affine,
                 const double *quadratic, supine_patient *patient) {
  *patient = (supine_patient){.law = law, .frame = *s->frame};
  memcpy(patient->powers, s->power.powers, sizeof patient->powers);
  memcpy(patient->lengths, s->power.linear, sizeof patient->lengths);
  memcpy(patient->motion, s->power.linear + 3, sizeof patient->motion);
  memcpy(patient->polynomial, law == SUPINE_PATIENT_QUADRATIC ? quadratic : affine,
         sizeof patient->polynomial);
}

static supine_status prepare(study *s, supine_error *error) {
  const size_t items = SEEDS * FOLDS > REPLICATES ? SEEDS * FOLDS : REPLICATES;
  s->fold = malloc(SEEDS * s->row_count * sizeof *s->fold);
  s->normals = calloc(SEEDS * FOLDS, sizeof *s->normals);
  s->squares = calloc(SEEDS * FOLDS, sizeof *s->squares);
  s->drawn = calloc(REPLICATES, sizeof *s->drawn);
  s->failed = calloc(items, sizeof *s->failed);
  if (s->fold == NULL || s->normals == NULL || s->squares == NULL || s->drawn == NULL ||
      s->failed == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", s->row_count);
  }
  supine_status status = SUPINE_OK;
  for (size_t seed = 0; seed < SEEDS && status == SUPINE_OK; ++seed) {
    status = deal(s, seed, error);
  }
  return status;
}

/* Eight parameters: what is fitted, to what, how, and what comes of it. */
supine_status supine_patient_fit(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, size_t components,
                                 const supine_patient_fit_options *options, supine_patient *patient,
                                 supine_patient_fit_report *report, supine_error *error) {
  supine_patient_fit_report unused;
  report = report != NULL ? report : &unused;
  *report = (supine_patient_fit_report){.count = count, .components = components};
  study s = {.frame = frame,
             .rows = rows,
             .row_count = components * count,
             .components = components,
             .moved = options->moved};
  double affine[POLYNOMIAL];
  double quadratic[POLYNOMIAL];
  double weight = 0.0;
  supine_patient_law law = SUPINE_PATIENT_QUADRATIC;
  for (size_t i = 0; i < s.row_count; ++i) {
    weight += rows[i].weight;
  }
  supine_status status = prepare(&s, error);
  if (status == SUPINE_OK) {
    report->blocks = s.blocks;
    score_polynomials(&s, weight, report, affine, quadratic);
    status = fit_power(&s, weight, report, error);
  }
  if (status == SUPINE_OK) {
    supine_parallel_for(SEEDS * FOLDS, 1, 0, hold_out_range, &s);
    status = failure(&s, SEEDS * FOLDS, "holding blocks out", error);
  }
  if (status == SUPINE_OK) {
    double squares = 0.0;
    for (size_t item = 0; item < SEEDS * FOLDS; ++item) {
      squares += s.squares[item];
    }
    report->fitted.law[SUPINE_PATIENT_PAPER] = root_mean(&s, s.power.squares, weight);
    report->held_out.law[SUPINE_PATIENT_PAPER] = root_mean(&s, squares, SEEDS * weight);
    status = bootstrap(&s, report, error);
  }
  if (status == SUPINE_OK) {
    status = choose_law(&s, options, report, &law, error);
  }
  if (status == SUPINE_OK) {
    const bool moved = options->moved != SUPINE_PATIENT_STILL;
    const supine_patient_scores *held = &report->held_out;
    const supine_patient_scores *fitted = &report->fitted;
    report->explained = 1.0 - pow(held->law[law] / (moved ? held->translation : held->none), 2.0);
    report->explained_fitted =
        1.0 - pow(fitted->law[law] / (moved ? fitted->translation : fitted->none), 2.0);
    fill(&s, law, affine, quadratic, patient);
  }
  free(s.fold);
  free(s.normals);
  free(s.squares);
  free(s.drawn);
  free(s.failed);
  return status;
}
