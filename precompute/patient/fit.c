/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a law and its correction, and hold blocks out. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/patient/fit.h"

#include "precompute/patient/krige.h"
#include "precompute/physics/model.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"

enum { FOLDS = SUPINE_PATIENT_FOLDS, SEEDS = SUPINE_PATIENT_SEEDS, ITEMS = SEEDS * FOLDS };

/* Half widths of the 95 % interval over the expected error: of a point, of one component. */
static const double band_point = 1.8;
static const double band_component = 1.96;

/* Factor on the expected error within 8 mm of the surface, measured on ten patients. */
static const double near_surface = 1.3;

/* Sums over rows of weighted squares, mm^2. */
typedef struct squares {
  double none, translation, affine, law, corrected, expected, weight;
  size_t points, within;
} squares;

/* Inputs and working space of one fit. */
typedef struct study {
  const supine_patient_frame *frame;
  const supine_patient_fit_options *options;
  supine_patient_row *rows;
  size_t single, row_count, components;
  double sill;   /* variance of the correction, of all rows; below 0: to be found */
  size_t *fold;  /* [SEEDS, row_count] */
  squares *left; /* [ITEMS] residuals of held-out folds */
  size_t blocks;
  supine_status *failed; /* [ITEMS] */
} study;

supine_patient_power supine_patient_deep(const double gravity[3], const double way[3]) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  supine_patient_power law = {0};
  const double *g = supine_length(gravity) > 0.0 ? gravity : supine;
  for (size_t k = 0; k < 3; ++k) {
    law.linear[k] = model.direction.c[2 * k] * (supine_length(way) > 0.0 ? way[k] : 1.0);
    law.powers[k] = model.direction.c[2 * k + 1];
    /* With gravity along +y the heights fall along Y, along +z they fall along Z (lungs.h). */
    law.powers[3 + k] = model.force.box[k] - (k > 0 ? model.force.gain * g[k] : 0.0);
  }
  return law;
}

/* Fit the law alone, the baseline of the correction, and the corrected law. */
static supine_status fit_rows(const study *s, const supine_patient_row *rows, size_t count,
                              supine_patient_power *law, supine_patient_krige **krige,
                              supine_error *error) {
  const supine_patient_fit_options *wanted = s->options;
  const supine_patient_power shape = supine_patient_deep(wanted->gravity, wanted->way);
  supine_status status = supine_patient_scale_fit(rows, count, wanted->moved, &shape, law, error);
  supine_patient_krige_options options =
      supine_patient_krige_prior(wanted->law, law, wanted->moved);
  if (status == SUPINE_OK && wanted->law == SUPINE_PATIENT_PAPER) {
    status = supine_patient_law_fit(&options, rows, count, law, error);
  }
  options.sill = wanted->uncorrected ? 0.0 : s->sill;
  return status == SUPINE_OK ? supine_patient_krige_create(&options, rows, count, krige, error)
                             : status;
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

/* Gather the rows of one fold, or all others, scalar rows first; return how many. */
static size_t split(const study *s, const size_t *fold, size_t which, bool inside,
                    supine_patient_row *rows) {
  size_t count = 0;
  for (size_t i = 0; i < s->row_count; ++i) {
    if ((fold[i] == which) == inside) {
      rows[count++] = s->rows[i];
    }
  }
  return count;
}

static supine_status hold_out(const study *s, const size_t *fold, size_t which, squares *to) {
  supine_patient_row *kept = malloc(2 * s->row_count * sizeof *kept);
  double *scratch = malloc(s->row_count * sizeof *scratch);
  supine_patient_krige *krige = NULL;
  supine_patient_power law;
  supine_status status = kept == NULL || scratch == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  if (status == SUPINE_OK) {
    supine_patient_row *held = kept + s->row_count;
    const size_t count = split(s, fold, which, false, kept);
    const size_t out = split(s, fold, which, true, held);
    status = out > 0 ? fit_rows(s, kept, count, &law, &krige, NULL) : SUPINE_OK;
    if (status == SUPINE_OK && out > 0) {
      add_points(s, held, out, &law, krige, scratch, to);
    }
  }
  supine_patient_krige_destroy(krige);
  free(kept);
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

static supine_status hold_all_out(study *s, squares *held, supine_error *error) {
  supine_parallel_for(ITEMS, 1, 0, hold_out_range, s);
  for (size_t item = 0; item < ITEMS; ++item) {
    const squares *of = &s->left[item];
    if (s->failed[item] != SUPINE_OK) {
      return supine_error_set(error, s->failed[item],
                              "fitting without the held-out blocks failed: %s",
                              supine_status_string(s->failed[item]));
    }
    held->law += of->law;
    held->corrected += of->corrected;
    held->expected += of->expected;
    held->points += of->points;
    held->within += of->within;
  }
  return SUPINE_OK;
}

static double root_mean(const study *s, double sum, double weight) {
  return weight > 0.0 ? sqrt(sum * (double)s->components / weight) : 0.0;
}

/* Score the maps without a law, fitted and held out. */
static void score_maps(const study *s, squares *fitted, squares *held) {
  for (size_t seed = 0; seed <= SEEDS; ++seed) { /* the last item fits all rows */
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
  const size_t points = s->single + (s->row_count - s->single) / 3;
  return points >= needed
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%zu points are fewer than the %zu unknowns of the %s law: give "
                                "more, or --law deep",
                                points, needed, supine_patient_law_names[s->options->law]);
}

/* Assign the blocks of each seed's grid to folds. */
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

/* Find the expected error of a surface's points in three dimensions, mm RMS, and their mean
 * displacement. */
static void expect(const study *s, const supine_patient_krige *krige, double *scratch,
                   supine_patient_fit_report *report) {
  double variance = 0.0;
  double moved = 0.0;
  for (size_t i = 0; i < s->row_count; i += s->components) {
    supine_patient_row row = s->rows[i];
    double u[3];
    supine_patient_power_displacement(supine_patient_krige_law(krige), &row, u);
    moved += supine_length(u) * (double)s->components / (double)s->row_count;
    for (size_t a = 0; a < 3; ++a) {
      double of = 0.0;
      row.axis[0] = row.axis[1] = row.axis[2] = 0.0;
      row.axis[a] = 1.0;
      (void)supine_patient_krige_predict(krige, &row, &of, scratch);
      variance += of * (double)s->components / (double)s->row_count;
    }
  }
  report->moved = moved;
  report->expected_point = near_surface * sqrt(variance);
}

/* Fit all rows; `fitted` gets the residuals of law and correction. */
static supine_status fit_all(study *s, supine_patient *patient, squares *fitted,
                             supine_patient_fit_report *report, supine_error *error) {
  double *scratch = malloc(s->row_count * sizeof *scratch);
  supine_patient_krige *krige = NULL;
  supine_patient_power law;
  supine_status status = scratch == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY,
                                                            "no memory for %zu rows", s->row_count)
                                         : fit_rows(s, s->rows, s->row_count, &law, &krige, error);
  if (status == SUPINE_OK) {
    s->sill = supine_patient_krige_sill(krige);

    add_points(s, s->rows, s->row_count, &law, krige, scratch, fitted);
    expect(s, krige, scratch, report);
    supine_patient_krige_errors(krige, report->error);
    supine_patient_krige_take(krige, patient);
  }
  supine_patient_krige_destroy(krige);
  free(scratch);
  return status;
}

static void conclude(const study *s, const squares *fitted, const squares *held,
                     supine_patient_fit_report *report) {
  const bool moved = s->options->moved != SUPINE_PATIENT_STILL;
  report->blocks = s->blocks;
  report->fitted = scores_of(s, fitted);
  report->held_out = scores_of(s, held);
  report->expected = root_mean(s, held->expected, held->weight);
  report->band = held->points > 0 ? (double)held->within / (double)held->points : 0.0;
  const supine_patient_scores *of = &report->held_out;
  report->explained = 1.0 - pow(of->corrected / (moved ? of->translation : of->none), 2.0);
  of = &report->fitted;
  report->explained_fitted = 1.0 - pow(of->corrected / (moved ? of->translation : of->none), 2.0);
}

static supine_status study_run(study *s, supine_patient *patient, supine_patient_fit_report *report,
                               supine_error *error) {
  squares fitted = {0};
  squares held = {0};
  supine_status status = check_count(s, error);
  *patient = (supine_patient){.law = s->options->law, .frame = *s->frame};
  if (status == SUPINE_OK) {
    status = deal(s, error);
  }
  if (status == SUPINE_OK) {
    score_maps(s, &fitted, &held);
    status = fit_all(s, patient, &fitted, report, error);
  }
  if (status == SUPINE_OK) {
    status = hold_all_out(s, &held, error);
  }
  if (status == SUPINE_OK) {
    conclude(s, &fitted, &held, report);
  }
  return status;
}

/* Eight parameters: the data, the options and the outputs of the fit. */
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
             .row_count = count,
             .components = single > 0 ? 1 : 3,
             .sill = -1.0,
             .fold = malloc(SEEDS * count * sizeof(size_t)),
             .left = calloc(ITEMS, sizeof(squares)),
             .failed = calloc(ITEMS, sizeof(supine_status))};
  *report = (supine_patient_fit_report){.count = single > 0 ? count : triples,
                                        .components = s.components};
  const supine_status status =
      s.fold == NULL || s.left == NULL || s.failed == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", count)
          : study_run(&s, patient, report, error);
  free(s.fold);
  free(s.left);
  free(s.failed);
  return status;
}
