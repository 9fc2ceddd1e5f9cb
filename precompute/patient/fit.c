/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A law fitted, corrected and held out. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_rng.h>
#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>

#include "precompute/patient/fit.h"

#include "precompute/patient/krige.h"
#include "precompute/physics/model.h"
#include "sh/base/parallel.h"

enum {
  FOLDS = SUPINE_PATIENT_FOLDS,
  SEEDS = SUPINE_PATIENT_SEEDS,
  ITEMS = SEEDS * FOLDS,
  REPLICATES = 100, /* of the bootstrap: a standard error is known to 7 % */
  FIT_STEPS = 200,
  REFIT_STEPS = 30
};

static const double same_start = 0.01;

/* Half widths of the 95 % band, in the expected error of a point and of one component. */
static const double band_point = 1.8;
static const double band_component = 1.96;

/* Relative, of a step: fits of parts of the data need not be sharper than what they show. */
static const double fit_tolerance = 1e-8;
static const double refit_tolerance = 1e-3;

/* Weighted sums of squares, mm^2, over rows. */
typedef struct squares {
  double none, translation, affine, law, corrected, expected, weight;
  size_t points, within;
} squares;

/* Everything between the rows and the patient. */
typedef struct study {
  const supine_patient_frame *frame;
  const supine_patient_fit_options *options;
  supine_patient_row *rows;
  size_t single, triples, row_count, components;
  supine_patient_power law;    /* of all rows */
  size_t *fold;                /* [SEEDS, row_count] */
  squares *left;               /* [ITEMS] of held-out folds */
  supine_patient_power *drawn; /* [REPLICATES] */
  size_t blocks;
  supine_status *failed; /* [ITEMS or REPLICATES] */
} study;

supine_patient_power supine_patient_deep(const double gravity[3]) {
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  supine_patient_power law = {0};
  for (size_t k = 0; k < 3; ++k) {
    law.linear[k] = model.direction.c[2 * k];
    law.powers[k] = model.direction.c[2 * k + 1];
    /* Heights fall along Y and Z (lungs.h) where gravity is along +y and +z. */
    law.powers[3 + k] = model.force.box[k] - (k > 0 ? model.force.gain * gravity[k] : 0.0);
  }
  return law;
}

/* --- fits ------------------------------------------------------------------------------------ */

/* Fit rows of a copy: of the paper's law from where the fit of all rows ended, and, afresh, from
 * the first start. */
static supine_status refit(const study *s, const supine_patient_row *rows, size_t count,
                           bool afresh, supine_patient_power *fit) {
  const supine_patient_moved moved = s->options->moved;
  supine_patient_power other;
  if (s->options->law == SUPINE_PATIENT_DEEP) {
    return supine_patient_scale_fit(rows, count, moved, &s->law, fit, NULL);
  }
  supine_status status = supine_patient_power_fit(rows, count, moved, s->law.powers, REFIT_STEPS,
                                                  refit_tolerance, fit, NULL);
  if (afresh && status == SUPINE_OK) {
    status = supine_patient_power_fit(rows, count, moved, supine_patient_starts[0], REFIT_STEPS,
                                      refit_tolerance, &other, NULL);
    if (status == SUPINE_OK && other.squares < fit->squares) {
      *fit = other;
    }
  }
  return status;
}

static supine_patient_krige_options krige_options(const study *s) {
  return (supine_patient_krige_options){.moved = s->options->moved,
                                        .scale_known = s->options->law == SUPINE_PATIENT_PAPER};
}

/* The rows of a fold or all others, single ones first; how many of each. */
static void split(const study *s, const size_t *fold, size_t which, bool inside,
                  supine_patient_row *rows, size_t count[2]) {
  size_t at = 0;
  count[0] = count[1] = 0;
  for (size_t i = 0; i < s->row_count; ++i) {
    if ((fold[i] == which) == inside) {
      rows[at++] = s->rows[i];
      ++count[i < s->single ? 0 : 1];
    }
  }
  count[1] /= 3;
}

static void add_points(const study *s, const supine_patient_row *rows, size_t count,
                       const supine_patient_power *law, const supine_patient_krige *krige,
                       double *scratch, squares *to) {
  const double factor = supine_patient_krige_noise(krige);
  for (size_t i = 0; i < count; i += s->components) {
    double square = 0.0;
    double expected = 0.0;
    double weight = 0.0;
    for (size_t j = i; j < i + s->components; ++j) {
      const supine_patient_row *row = &rows[j];
      double variance;
      const double left = supine_patient_krige_predict(krige, row, &variance, scratch) - row->value;
      to->law += row->weight * pow(supine_patient_power_residual(law, row), 2.0);
      to->corrected += row->weight * left * left;
      variance += pow(factor * row->noise, 2.0);
      to->expected += row->weight * variance;
      square += left * left;
      expected += variance;
      weight += row->weight;
    }
    const double band = s->components == 3 ? band_point : band_component;
    to->points += weight > 0.0;
    to->within += weight > 0.0 && square <= band * band * expected;
  }
}

static supine_status hold_out(const study *s, const size_t *fold, size_t which, squares *to) {
  supine_patient_row *kept = malloc(s->row_count * sizeof *kept);
  supine_patient_row *held = malloc(s->row_count * sizeof *held);
  supine_patient_row *thinned = malloc(s->row_count * sizeof *thinned);
  double *scratch = malloc(s->row_count * sizeof *scratch);
  supine_patient_krige *krige = NULL;
  supine_patient_power law;
  supine_status status = kept == NULL || held == NULL || thinned == NULL || scratch == NULL
                             ? SUPINE_ERROR_MEMORY
                             : SUPINE_OK;
  if (status == SUPINE_OK) {
    size_t count[2];
    size_t out[2];
    split(s, fold, which, false, kept, count);
    split(s, fold, which, true, held, out);
    const size_t rows = count[0] + 3 * count[1];
    if (rows == s->row_count) {
      goto cleanup; /* an empty fold */
    }
    status = refit(s, kept, rows, true, &law);
    if (status == SUPINE_OK) {
      const supine_patient_krige_options options = krige_options(s);
      const size_t thin = supine_patient_krige_thin(kept, count[0], count[1], thinned);
      status = supine_patient_krige_create(&law, thinned, thin, &options, &krige, NULL);
    }
    if (status == SUPINE_OK) {
      add_points(s, held, out[0] + 3 * out[1], &law, krige, scratch, to);
    }
  }
cleanup:
  supine_patient_krige_destroy(krige);
  free(kept);
  free(held);
  free(thinned);
  free(scratch);
  return status;
}

static void hold_out_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  study *s = context;
  for (size_t item = begin; item < end; ++item) {
    s->failed[item] =
        hold_out(s, s->fold + item / FOLDS * s->row_count, item % FOLDS, &s->left[item]);
  }
}

/* Draw blocks with replacement, as many as there are, and fit them. */
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

static double root_mean(const study *s, double sum, double weight) {
  return weight > 0.0 ? sqrt(sum * (double)s->components / weight) : 0.0;
}

/* Search the paper's nine constants from every start. */
static supine_status fit_power(study *s, double weight, supine_patient_fit_report *report,
                               supine_error *error) {
  supine_patient_power fits[SUPINE_PATIENT_STARTS];
  size_t best = 0;
  for (size_t k = 0; k < SUPINE_PATIENT_STARTS; ++k) {
    const supine_status status =
        supine_patient_power_fit(s->rows, s->row_count, s->options->moved, supine_patient_starts[k],
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
  s->law = fits[best];
  memcpy(report->at_bound, s->law.at_bound, sizeof report->at_bound);
  return SUPINE_OK;
}

/* --- all of it ------------------------------------------------------------------------------- */

/* What no model needs: fitted and held out. */
static void score_maps(const study *s, squares *fitted, squares *held) {
  for (size_t seed = 0; seed <= SEEDS; ++seed) { /* the last: of all rows */
    const size_t *fold = s->fold + (seed % SEEDS) * s->row_count;
    for (size_t which = 0; which < (seed < SEEDS ? FOLDS : 1); ++which) {
      double map[2][SUPINE_PATIENT_AFFINE];
      for (int kind = 0; kind < 2; ++kind) {
        if (!supine_patient_affine_fit(s->rows, s->row_count, seed < SEEDS ? fold : NULL, which,
                                       kind == 0, map[kind])) {
          memset(map[kind], 0, sizeof map[kind]);
        }
      }
      squares *to = seed < SEEDS ? held : fitted;
      for (size_t i = 0; i < s->row_count; ++i) {
        const supine_patient_row *row = &s->rows[i];
        if (seed == SEEDS || fold[i] == which) {
          to->none += row->weight * row->value * row->value;
          to->translation += row->weight * pow(supine_patient_affine_residual(map[0], row), 2.0);
          to->affine += row->weight * pow(supine_patient_affine_residual(map[1], row), 2.0);
          to->weight += row->weight;
        }
      }
    }
  }
}

static supine_patient_scores scores_of(const study *s, const squares *of) {
  return (supine_patient_scores){.none = root_mean(s, of->none, of->weight),
                                 .translation = root_mean(s, of->translation, of->weight),
                                 .affine = root_mean(s, of->affine, of->weight),
                                 .law = root_mean(s, of->law, of->weight),
                                 .corrected = root_mean(s, of->corrected, of->weight)};
}

static supine_status check_count(const study *s, supine_error *error) {
  static const size_t motion[] = {0, 3, 6};
  const size_t needed =
      (s->options->law == SUPINE_PATIENT_PAPER ? 9 : 1) + motion[s->options->moved];
  const size_t points = s->single + s->triples;
  return points >= needed
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%zu points are fewer than the %zu unknowns of the %s law: give "
                                "more, or --law deep",
                                points, needed, supine_patient_law_names[s->options->law]);
}

/* Deal the blocks of each seed's grid to the folds. */
static supine_status deal(study *s, supine_error *error) {
  for (size_t seed = 0; seed < SEEDS; ++seed) {
    const size_t blocks = supine_patient_rows_block(s->frame, s->rows, s->row_count, seed + 1);
    size_t *fold_of = malloc((blocks + 1) * sizeof *fold_of);
    if (blocks == 0 || fold_of == NULL ||
        supine_patient_rows_deal(blocks, FOLDS, 1000 + seed, fold_of) != SUPINE_OK) {
      free(fold_of);
      return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu blocks", blocks);
    }
    for (size_t i = 0; i < s->row_count; ++i) {
      s->fold[seed * s->row_count + i] = fold_of[s->rows[i].block];
    }
    s->blocks = blocks;
    free(fold_of);
  }
  return SUPINE_OK;
}

/* Correct the law of all rows; `fitted` gets what law and correction leave. */
static supine_status correct(const study *s, supine_patient *patient, squares *fitted,
                             supine_error *error) {
  supine_patient_row *thinned = malloc(s->row_count * sizeof *thinned);
  double *scratch = malloc(s->row_count * sizeof *scratch);
  supine_patient_krige *krige = NULL;
  supine_status status =
      thinned == NULL || scratch == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", s->row_count)
          : SUPINE_OK;
  if (status == SUPINE_OK) {
    const supine_patient_krige_options options = krige_options(s);
    const size_t count = supine_patient_krige_thin(s->rows, s->single, s->triples, thinned);
    status = supine_patient_krige_create(&s->law, thinned, count, &options, &krige, error);
  }
  if (status == SUPINE_OK) {
    add_points(s, s->rows, s->row_count, &s->law, krige, scratch, fitted);
    supine_patient_krige_take(krige, patient);
  }
  supine_patient_krige_destroy(krige);
  free(thinned);
  free(scratch);
  return status;
}

static supine_status hold_all_out(study *s, squares *held, supine_error *error) {
  supine_parallel_for(ITEMS, 1, 0, hold_out_range, s);
  for (size_t item = 0; item < ITEMS; ++item) {
    const squares *of = &s->left[item];
    held->law += of->law;
    held->corrected += of->corrected;
    held->expected += of->expected;
    held->points += of->points;
    held->within += of->within;
  }
  return failure(s, ITEMS, "holding blocks out", error);
}

static void conclude(const study *s, const squares *fitted, const squares *held,
                     supine_patient_fit_report *report) {
  const bool moved = s->options->moved != SUPINE_PATIENT_STILL;
  report->blocks = s->blocks;
  report->fitted = scores_of(s, fitted);
  report->held_out = scores_of(s, held);
  report->expected = root_mean(s, held->expected, held->weight);
  report->band = held->points > 0 ? (double)held->within / (double)held->points : 0.0;
  if (s->options->uncorrected) {
    report->fitted.corrected = report->fitted.law;
    report->held_out.corrected = report->held_out.law;
  }
  const supine_patient_scores *of = &report->held_out;
  report->explained = 1.0 - pow(of->corrected / (moved ? of->translation : of->none), 2.0);
  of = &report->fitted;
  report->explained_fitted = 1.0 - pow(of->corrected / (moved ? of->translation : of->none), 2.0);
}

static supine_status fit_law(study *s, double weight, supine_patient_fit_report *report,
                             supine_error *error) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  const double *g = s->options->gravity;
  if (s->options->law == SUPINE_PATIENT_PAPER) {
    return fit_power(s, weight, report, error);
  }
  const bool given = g[0] != 0.0 || g[1] != 0.0 || g[2] != 0.0;
  const supine_patient_power shape = supine_patient_deep(given ? g : supine);
  return supine_patient_scale_fit(s->rows, s->row_count, s->options->moved, &shape, &s->law, error);
}

static supine_status study_run(study *s, supine_patient *patient, supine_patient_fit_report *report,
                               supine_error *error) {
  squares fitted = {0};
  squares held = {0};
  double weight = 0.0;
  supine_status status = check_count(s, error);
  if (status == SUPINE_OK) {
    status = deal(s, error);
  }
  for (size_t i = 0; i < s->row_count; ++i) {
    weight += s->rows[i].weight;
  }
  if (status == SUPINE_OK) {
    score_maps(s, &fitted, &held);
    status = fit_law(s, weight, report, error);
  }
  if (status == SUPINE_OK) {
    status = hold_all_out(s, &held, error);
  }
  if (status == SUPINE_OK && s->options->law == SUPINE_PATIENT_PAPER) {
    status = bootstrap(s, report, error);
  }
  *patient = (supine_patient){.law = s->options->law, .frame = *s->frame};
  if (status == SUPINE_OK) {
    status = correct(s, patient, &fitted, error);
  }
  if (status == SUPINE_OK && s->options->uncorrected) {
    patient->correction.count = 0;
    memcpy(patient->lengths, s->law.linear, sizeof patient->lengths);
    memcpy(patient->motion, s->law.linear + 3, sizeof patient->motion);
  }
  if (status == SUPINE_OK) {
    conclude(s, &fitted, &held, report);
  }
  return status;
}

/* Eight parameters: what is fitted, to what, how, and what comes of it. */
supine_status supine_patient_fit(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t single, size_t triples,
                                 const supine_patient_fit_options *options, supine_patient *patient,
                                 supine_patient_fit_report *report, supine_error *error) {
  supine_patient_fit_report unused;
  const size_t count = single + 3 * triples;
  report = report != NULL ? report : &unused;
  study s = {.frame = frame,
             .options = options,
             .rows = rows,
             .single = single,
             .triples = triples,
             .row_count = count,
             .components = single > 0 ? 1 : 3,
             .fold = malloc(SEEDS * count * sizeof(size_t)),
             .left = calloc(ITEMS, sizeof(squares)),
             .drawn = calloc(REPLICATES, sizeof(supine_patient_power)),
             .failed = calloc(REPLICATES, sizeof(supine_status))};
  *report = (supine_patient_fit_report){.count = single > 0 ? count : triples,
                                        .components = s.components};
  const supine_status status =
      s.fold == NULL || s.left == NULL || s.drawn == NULL || s.failed == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", count)
          : study_run(&s, patient, report, error);
  free(s.fold);
  free(s.left);
  free(s.drawn);
  free(s.failed);
  return status;
}
