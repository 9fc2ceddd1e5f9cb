/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a displacement law with its kriging correction, and measure the error on held-out points. */
#include <math.h>
#include <string.h>

#include <cblas.h>
#include <gsl/gsl_rng.h>
#include <lapacke.h>

#include "precompute/patient/krige.h"

#include "base/arena.h"
#include "base/parallel.h"
#include "base/remedy.h"
#include "base/vec3.h"

enum {
  FOLDS = 5,
  SEEDS = 3,   /* number of cross-validations, each with new random folds */
  AFFINE = 12, /* number of constants of an affine map */
  ITEMS = SEEDS * FOLDS,
  SCORES = SUPINE_PATIENT_SCORES
};

/* Constant c of the expected error (supine/locate.h), mm, by tests/evidence/error.py from five
 * people with COPD, 300 landmarks each. Of a fit to surfaces alone, which do not show sliding: they
 * need 2.0 to 13.6, geometric mean 5.3; leaving out one of them, the mean of the others states 0.56
 * to 1.84 of its error. Of a fit to landmarks, where it counts as measured on `prior_points`
 * landmarks before: at 100 held-out landmarks they need 0.4 to 4.1, about 1. */
static const double constant_of_surfaces = 5.3, constant_of_landmarks = 1.0, prior_points = 10.0;
static const double displacement_least = 2.0; /* shorter displacements count as this, mm */
static const double bound = 1.8; /* 95 % of all points err by less than 1.8 expected errors */
static const double full_breath = 18.0; /* largest report->expected_from, mm (supine/locate.h) */

typedef struct squares {
  double residual[SCORES]; /* [predictor] weighted sum of squared residuals, mm^2 */
  double weight;
  double back;  /* sum of the squared errors of landmarks that are moved back, mm^2 */
  double path;  /* sum of their predicted displacements, mm */
  double share; /* sum of the shares of the variance that the other landmarks leave there */
} squares;

typedef struct study {
  supine_patient_fit_options options;
  const supine_patient_frame *frame;
  const supine_patient_row *rows;
  size_t row_count, triples;
  double *ratio; /* [SEEDS, triples] squared error of a held-out landmark that is moved back / what
                    it is in proportion to: the share that is left there (supine_patient_shares) or,
                    without a correction, its displacement, mm */
  size_t *fold;  /* [SEEDS, row_count] fold of each measurement */
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
 * each measurement into fold [count], and the number of cubes into `blocks`. */
static supine_status assign_folds(const supine_patient_frame *frame, supine_patient_row *rows,
                                  size_t count, unsigned long seed, size_t *fold, size_t *blocks,
                                  supine_error *error) {
  SUPINE_TRY(supine_patient_rows_block(frame, rows, count, seed + 1, blocks, error));
  SUPINE_ARENA arena = {0};
  size_t *fold_of = supine_arena_take(&arena, *blocks, sizeof *fold_of);
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  if (arena.failed || random == NULL) {
    gsl_rng_free(random);
    return supine_error_memory(error, "%zu values", count);
  }
  gsl_rng_set(random, 1000 + seed);
  for (size_t b = 0; b < *blocks; ++b) {
    const size_t other = gsl_rng_uniform_int(random, b + 1);
    fold_of[b] = fold_of[other];
    fold_of[other] = b % FOLDS;
  }
  gsl_rng_free(random);
  for (size_t i = 0; i < count; ++i) {
    fold[i] = fold_of[rows[i].block];
  }
  return SUPINE_OK;
}

/* Move a landmark, given by its three measurements, from the emptier scan back to the fuller one,
 * as a basis of the emptier scan does. Return the squared error, mm^2. Write the length of the
 * predicted displacement, mm. */
static double move_back(const supine_patient *patient, const supine_patient_row row[3],
                        double *size) {
  const supine_patient_frame *frame = &patient->frame;
  double from[3];
  double point[3];
  double at[3];
  double u[3];
  for (size_t k = 0; k < 3; ++k) {
    from[k] = row->place.offset[k] + 0.5 * (frame->minimum[k] + frame->maximum[k]);
    at[k] = point[k] = from[k] + row[k].value;
  }
  supine_patient_find_in_fuller(patient, point, row->place.side, 1.0, at, u);
  *size = fmax(displacement_least, supine_length(u));
  return pow(supine_distance(at, from), 2.0);
}

/* Return the residual of a measurement after the displacement law with its correction, mm. */
static double corrected_residual(const supine_patient *patient, const supine_patient_row *row) {
  double u[3];
  double motion[3];
  supine_patient_displacement(patient, &row->place, 1.0, u);
  supine_patient_motion(&patient->power, &row->place, motion);
  return supine_dot(row->axis, u) + supine_dot(row->axis, motion) - row->value;
}

/* Fit each predictor of supine_patient_score (no displacement, translation, affine map,
 * displacement law, corrected law) to krige->rows. Add the squared errors at `rows` to the sums of
 * each. If there are landmarks, use only these.
 * @param patient  the law and the correction of `krige` */
static void add_residuals(const study *s, const supine_patient_row *rows, size_t count,
                          const supine_patient_krige *krige, const supine_patient *patient,
                          squares *sums) {
  double map[2][AFFINE];
  affine_fit(krige->rows, krige->count, true, map[0]);
  affine_fit(krige->rows, krige->count, false, map[1]);
  for (size_t i = 0; i < count; ++i) {
    const supine_patient_row *row = &rows[i];
    double x[SUPINE_PATIENT_TERMS];
    if (s->triples > 0 && row->landmark == 0) {
      continue;
    }
    const double residual[SCORES] = {row->value, affine_residual(map[0], row),
                                     affine_residual(map[1], row),
                                     supine_patient_power_design(&krige->uncorrected_law, row, x),
                                     corrected_residual(patient, row)};
    for (size_t k = 0; k < SCORES; ++k) {
      sums->residual[k] += row->weight * residual[k] * residual[k];
    }
    sums->weight += row->weight;
  }
}

/* Move the landmarks among measurements back to the fuller scan. Add their squared errors, their
 * displacements and the shares that the fitted landmarks leave there to the sums of each, and write
 * the ratio of each. */
static supine_status add_landmarks(const supine_patient_row *rows, size_t count,
                                   const supine_patient *patient, squares *sums, double *ratio) {
  const bool corrected = patient->landmark_count > 0;
  SUPINE_ARENA arena = {0};
  double *offsets = supine_arena_take(&arena, count, 3 * sizeof *offsets);
  double *shares = supine_arena_take(&arena, count, sizeof *shares);
  int *sides = supine_arena_take(&arena, count, sizeof *sides);
  if (arena.failed) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t i = 0; i < count; ++i) {
    memcpy(offsets + 3 * i, rows[i].place.offset, 3 * sizeof *offsets);
    sides[i] = rows[i].place.side;
  }
  SUPINE_TRY(supine_patient_shares(patient, count, offsets, sides, shares, NULL));
  for (size_t i = 0; i < count; ++i) {
    if (rows[i].landmark > 0 && rows[i].axis[0] == 1.0) { /* x, y and z follow each other */
      double size;
      const double square = move_back(patient, &rows[i], &size);
      sums->back += square;
      sums->path += size;
      sums->share += shares[i];
      ratio[rows[i].landmark - 1] = square / (corrected ? shares[i] : size);
    }
  }
  return SUPINE_OK;
}

static supine_status hold_out(const study *s, const size_t *fold, size_t which, squares *sums,
                              double *ratio) {
  const size_t n = s->row_count;
  SUPINE_ARENA arena = {0};
  /* First the measurements to which the law is fitted, then the held-out ones. */
  supine_patient_row *rows = supine_arena_take(&arena, n, sizeof *rows);
  supine_patient *patient = supine_arena_take(&arena, 1, sizeof *patient);
  SUPINE_FREED_BY(supine_patient_krige_free) supine_patient_krige krige = {0};
  size_t fitted_count = 0;
  size_t count = 0;
  if (arena.failed) {
    return SUPINE_ERROR_MEMORY;
  }
  for (int held_out = 0; held_out < 2; ++held_out) {
    fitted_count = count;
    for (size_t i = 0; i < n; ++i) {
      if ((fold[i] == which) == (held_out == 1)) {
        rows[count++] = s->rows[i];
      }
    }
  }
  if (fitted_count < n) {
    SUPINE_TRY(supine_patient_krige_fit(&s->options, rows, fitted_count, &krige, NULL));
    patient->frame = *s->frame;
    supine_patient_krige_copy_law(&krige, patient);
    add_residuals(s, rows + fitted_count, n - fitted_count, &krige, patient, sums);
    SUPINE_TRY(add_landmarks(rows + fitted_count, n - fitted_count, patient, sums, ratio));
  }
  return SUPINE_OK;
}

static void hold_out_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  study *s = context;
  for (size_t item = begin; item < end; ++item) {
    s->failed[item] = hold_out(s, s->fold + item / FOLDS * s->row_count, item % FOLDS,
                               &s->held_out[item], s->ratio + item / FOLDS * s->triples);
  }
}

static supine_status hold_all_out(study *s, squares *held_out, supine_error *error) {
  supine_parallel_for(ITEMS, 1, 0, hold_out_range, s);
  for (size_t item = 0; item < ITEMS; ++item) {
    const squares *item_sums = &s->held_out[item];
    SUPINE_REFUSE_IF(s->failed[item] != SUPINE_OK, error, s->failed[item],
                     "the points outside some blocks of 40 mm do not determine the law (%s): give "
                     "more points, spread over both lungs",
                     supine_status_string(s->failed[item]));
    for (size_t k = 0; k < SCORES; ++k) {
      held_out->residual[k] += item_sums->residual[k];
    }
    held_out->weight += item_sums->weight;
    held_out->back += item_sums->back;
    held_out->path += item_sums->path;
    held_out->share += item_sums->share;
  }
  return SUPINE_OK;
}

/* Set the constant c of the expected error, from the held-out landmarks or, without landmarks, to
 * that of other patients; the RMS displacement to which it applies; the expected error; and the
 * share of the held-out landmarks that err by less than 1.8 times as much. With c, the sum of the
 * squared errors that are expected of the held-out landmarks is the sum of those that they have,
 * if they are moved back from the emptier to the fuller scan. After a correction by landmarks, an
 * error is in proportion to the share that these leave there, not to the displacement. */
static void set_expected(const study *s, const squares *held_out, const supine_patient *patient,
                         supine_patient_fit_report *report) {
  const size_t count = SEEDS * s->triples;
  double mean = 0.0;
  double square = 0.0;
  double points = 0.0;
  double within = 0.0;
  for (size_t i = 0; i < s->row_count; ++i) {
    if (s->triples == 0 || s->rows[i].landmark > 0) {
      double u[3];
      supine_patient_displacement(patient, &s->rows[i].place, 1.0, u);
      const double size = fmax(displacement_least, supine_length(u));
      mean += size;
      square += size * size;
      points += 1.0;
    }
  }
  const bool corrected = patient->landmark_count > 0;
  const double rms = sqrt(square / points);
  report->expected_constant = constant_of_surfaces;
  if (count > 0) {
    const double path = corrected ? rms * (double)count : held_out->path;
    const double own = held_out->back / path;
    report->expected_constant = (prior_points * constant_of_landmarks + (double)s->triples * own) /
                                (prior_points + (double)s->triples);
    report->stretch =
        sqrt(held_out->back / (double)count) / report->held_out[SUPINE_PATIENT_SCORE_CORRECTED];
  }
  double per_ratio = report->expected_constant; /* expected square divided by s->ratio's divisor */
  if (count > 0 && corrected) {
    report->expected_share = held_out->share / (double)count;
    per_ratio *= rms / report->expected_share;
  }
  for (size_t i = 0; i < count; ++i) {
    within += s->ratio[i] <= bound * bound * per_ratio ? 1.0 : 0.0;
  }
  report->has_band = count > 0;
  if (report->has_band) {
    report->band = 100.0 * within / (double)count;
  }
  report->expected_from = fmin(full_breath, rms);
  report->expected_point = sqrt(report->expected_constant * (corrected ? rms : mean / points));
}

static supine_patient_score baseline_of(const study *s) {
  return s->options.scan_motion != SUPINE_PATIENT_STILL ? SUPINE_PATIENT_SCORE_TRANSLATION
                                                        : SUPINE_PATIENT_SCORE_NONE;
}

/* Compute the RMS error of each predictor, mm, from the sums of squared residuals. Return by how
 * many percent the kriging-corrected law reduces the mean square error of the baseline. */
static double find_rms(const study *s, const squares *sums, double score[SCORES]) {
  for (size_t k = 0; k < SCORES; ++k) {
    score[k] = sqrt(sums->residual[k] * (s->triples > 0 ? 3.0 : 1.0) / sums->weight);
  }
  return 100.0 * (1.0 - pow(score[SUPINE_PATIENT_SCORE_CORRECTED] / score[baseline_of(s)], 2.0));
}

/* Fit to all measurements. Then leave out each fold in turn, and measure the error on this fold. */
static supine_status run(study *s, supine_patient *patient, supine_patient_fit_report *report,
                         supine_error *error) {
  squares fitted = {.weight = 0.0};
  squares held_out = {.weight = 0.0};
  SUPINE_FREED_BY(supine_patient_krige_free) supine_patient_krige krige = {0};
  SUPINE_TRY(supine_patient_krige_fit(&s->options, s->rows, s->row_count, &krige, error));
  supine_patient_krige_copy_law(&krige, patient);
  add_residuals(s, s->rows, s->row_count, &krige, patient, &fitted);
  s->options.sill = krige.sill;
  s->options.uncorrected = krige.sill == 0.0;
  supine_patient_krige_errors(&krige, report->error);
  for (size_t c = 0; c < SUPINE_PATIENT_CONSTANTS; ++c) {
    report->has_errors = report->has_errors || report->error[c] > 0.0;
  }
  SUPINE_TRY(hold_all_out(s, &held_out, error));
  (void)find_rms(s, &fitted, report->fitted);
  report->explained = find_rms(s, &held_out, report->held_out);
  report->baseline = report->held_out[baseline_of(s)];
  set_expected(s, &held_out, patient, report);
  return SUPINE_OK;
}

supine_status supine_patient_fit(const supine_patient_fit_options *options,
                                 supine_patient_row *rows, size_t single, size_t triples,
                                 supine_patient *patient, supine_patient_fit_report *report,
                                 supine_error *error) {
  const size_t count = single + 3 * triples;
  const size_t points = single + triples;
  const size_t constants = options->law == SUPINE_PATIENT_PAPER ? SUPINE_PATIENT_CONSTANTS : 1;
  const size_t unknowns = constants + options->scan_motion;
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_give("law", "deep", "")};
  SUPINE_REFUSE_ADVISE(points < unknowns, error, advice, SUPINE_ERROR_FORMAT,
                       "points: %zu, fewer than the %zu unknowns of the %s law: give more points",
                       points, unknowns, supine_patient_law_names[options->law]);
  SUPINE_ARENA arena = {0};
  double *ratio = supine_arena_zeros(&arena, SEEDS * triples, sizeof *ratio);
  size_t *fold = supine_arena_take(&arena, SEEDS * count, sizeof *fold);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu values", count));
  *report = (supine_patient_fit_report){.points = triples > 0 ? triples : single};
  for (size_t seed = 0; seed < SEEDS; ++seed) {
    SUPINE_TRY(assign_folds(&patient->frame, rows, count, seed, fold + seed * count,
                            &report->blocks, error));
  }
  patient->law = options->law;
  study s = {.options = *options,
             .frame = &patient->frame,
             .rows = rows,
             .row_count = count,
             .triples = triples,
             .ratio = ratio,
             .fold = fold};
  return run(&s, patient, report, error);
}
