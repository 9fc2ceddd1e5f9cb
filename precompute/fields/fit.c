/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit functions of gravity and volume to another simulator's fields, and cross-validate the fit. */
#include <cblas.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/remedy.h"
#include "precompute/fields/fields.h"
#include "precompute/fields/frame.h"
#include "precompute/fields/suspects.h"
#include "precompute/fields/volumes.h"

/* More terms replace the chosen ones if their error is below `worthwhile` times that of the chosen
 * ones. A chosen fit with an error of at most `exact` is kept, because such an error is rounding
 * error. */
static const double worthwhile = 0.99;
static const double exact = 1e-6;

/* Relative error that is small beside that of any simulator. Modes are not kept to lower it. */
static const double negligible = 1e-4;

static double *lung_gram(const supine_fit *fit, size_t lung) {
  return fit->gram + lung * fit->fields->run_count * fit->fields->run_count;
}

/* Compute the scalar products of the displacements of any two runs, in each lung. */
static void find_gram(supine_fit *fit) {
  const int m = (int)fit->fields->run_count;
  const int row = 3 * (int)fit->fields->vertex_count;
  for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
    const size_t begin = fit->lungs->lung_begin[lung];
    const int width = 3 * (int)(fit->lungs->lung_begin[lung + 1] - begin);
    const double *u = fit->fields->displacement + 3 * begin;
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, m, m, width, 1.0, u, row, u, row, 0.0,
                lung_gram(fit, lung), m);
  }
}

/* Sum the squared displacements of a run, or of all runs if `run` is their number, mm^2. */
static double square_sum(const supine_fit *fit, size_t run) {
  const size_t m = fit->fields->run_count;
  double sum = 0.0;
  for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
    const double *gram = lung_gram(fit, lung);
    sum += run < m ? gram[run * m + run] : cblas_dasum((int)m, gram, (int)m + 1);
  }
  return sum;
}

double supine_fields_size(const supine_fit *fit) {
  const size_t m = fit->fields->run_count;
  return sqrt(square_sum(fit, m) / ((double)m * (double)fit->fields->vertex_count));
}

/* Squared errors of runs that were left out, and squared displacements of the same runs, mm^2. */
typedef struct left_sums {
  double left, whole;
} left_sums;

static double relative_error(left_sums sums) {
  return sums.whole > 0.0 ? sqrt(sums.left / sums.whole) : 0.0;
}

static left_sums add_sums(left_sums a, left_sums b) {
  return (left_sums){a.left + b.left, a.whole + b.whole};
}

/* Sum the squared errors of the runs of groups, each group predicted from all other runs, before
 * compression to modes. */
static supine_status leave_out_all(const supine_fit *fit, const supine_regression *r,
                                   const supine_run_groups *groups, left_sums *sums) {
  const size_t m = r->run_count;
  SUPINE_ARENA arena = {0};
  double *residual = supine_arena_take(&arena, r->part_count * m * m, sizeof *residual);
  double *square = supine_arena_take(&arena, m, sizeof *square);
  SUPINE_TRY(supine_arena_status(&arena));
  *sums = (left_sums){0.0, 0.0};
  for (size_t group = 0; group < groups->count; ++group) {
    SUPINE_TRY(supine_fields_regression_predict(r, groups, group, fit->gram, 0, residual, square));
    for (size_t i = groups->begin[group]; i < groups->begin[group + 1]; ++i) {
      sums->left += square[i - groups->begin[group]];
      sums->whole += square_sum(fit, groups->run[i]);
    }
  }
  return SUPINE_OK;
}

/* Sum the squared errors of all runs, each predicted from all others. */
static supine_status leave_out_each(const supine_fit *fit, const supine_regression *r,
                                    left_sums *sums) {
  SUPINE_ARENA arena = {0};
  double *square = supine_arena_take(&arena, r->run_count, sizeof *square);
  SUPINE_TRY(supine_arena_status(&arena));
  SUPINE_TRY(supine_fields_regression_leave_each(r, fit->gram, square));
  *sums = (left_sums){cblas_dasum((int)r->run_count, square, 1), square_sum(fit, r->run_count)};
  return SUPINE_OK;
}

/* Return the groups of runs of one direction, and those of one volume between the smallest and the
 * largest. */
static supine_run_groups directions_of(const supine_fit *fit) {
  return (supine_run_groups){fit->direction_groups, fit->groups.begin, fit->groups.run};
}

static supine_run_groups inner_volumes_of(const supine_fit *fit) {
  return (supine_run_groups){fit->inner_groups, fit->groups.begin + fit->direction_groups,
                             fit->groups.run};
}

/* A choice of the band and the order. */
typedef struct choice {
  supine_runs runs;
  int wanted;         /* band, or negative */
  size_t order_least; /* lower orders are only compared */
  double least;       /* error of the chosen fit in single runs and inner volumes */
  double whole;       /* its error in whole directions and inner volumes */
  /* Relative errors of inner volumes that were left out; 0 if the others do not determine them. */
  double inner[SUPINE_FIT_ORDER_MAX + 1][SUPINE_FIT_BAND_MAX + 1];
} choice;

/* Sum the squared errors of the inner volumes. If the other volumes do not determine the fit, as
 * four do not determine a cubic, continue the errors of the two orders below: as much smaller
 * again.
 * @param between  written: the relative error that is such a guess; 0 if it was measured */
static supine_status leave_out_volumes(const supine_fit *fit, choice *c, const supine_regression *r,
                                       left_sums *sums, double *between) {
  const supine_run_groups inner = inner_volumes_of(fit);
  double *error = &c->inner[r->order][r->band];
  *sums = (left_sums){0.0, 0.0};
  *between = 0.0;
  if (supine_fields_regression_is_determined(r, &inner)) {
    SUPINE_TRY(leave_out_all(fit, r, &inner, sums));
    *error = relative_error(*sums);
    return SUPINE_OK;
  }
  for (size_t i = inner.begin[0]; i < inner.begin[inner.count]; ++i) {
    sums->whole += square_sum(fit, inner.run[i]);
  }
  const double one_below = r->order >= 1 ? c->inner[r->order - 1][r->band] : 0.0;
  const double two_below = r->order >= 2 ? c->inner[r->order - 2][r->band] : 0.0;
  *between = two_below > one_below ? one_below * one_below / two_below : one_below;
  sums->left = *between * *between * sums->whole;
  return SUPINE_OK;
}

/* Fit up to a band and an order. Choose the fit if it is wanted or clearly better, by the errors of
 * single runs and of inner volumes. The error with whole directions in place of single runs must
 * not grow, as it does where the harmonics are almost as many as the directions.
 * @param determined  written: whether the runs determine this fit */
static supine_status try_fit(supine_fit *fit, choice *c, size_t band, size_t order,
                             bool *determined) {
  supine_fit_report *report = &fit->report;
  const supine_run_groups directions = directions_of(fit);
  supine_regression trial;
  left_sums each;
  left_sums whole;
  left_sums volumes = {0.0, 0.0};
  double between = 0.0;
  *determined = supine_sh_terms(band, order) < c->runs.count;
  if (!*determined) {
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_fields_regression_create(&c->runs, band, order, &fit->memory, &trial));
  *determined = supine_fields_regression_is_determined(&trial, &directions);
  if (!*determined) {
    return SUPINE_OK;
  }
  if (fit->inner_groups > 0) {
    SUPINE_TRY(leave_out_volumes(fit, c, &trial, &volumes, &between));
  }
  if (order < c->order_least) {
    return SUPINE_OK;
  }
  SUPINE_TRY(leave_out_each(fit, &trial, &each));
  SUPINE_TRY(leave_out_all(fit, &trial, &directions, &whole));
  const double error = relative_error(add_sums(each, volumes));
  report->error[order][band] = between > 0.0 ? hypot(relative_error(whole), between)
                                             : relative_error(add_sums(whole, volumes));
  const double in_directions = report->error[order][band];
  const bool better = error < worthwhile * c->least && in_directions <= c->whole;
  if ((c->wanted < 0 || (size_t)c->wanted == band) && better && c->least > exact) {
    c->least = error;
    c->whole = in_directions;
    fit->chosen = trial;
    report->band = band;
    report->order = order;
    report->between = between;
  }
  return SUPINE_OK;
}

/* Guess the error between volumes with six of them, which determine the highest order: each further
 * order divides it as the chosen one does. */
static void guess_six(const choice *c, supine_fit_report *report) {
  enum { SIX = 6 };
  const size_t order = report->order;
  report->volume_error = report->between > 0.0 ? report->between : c->inner[order][report->band];
  if (report->volume_count < SIX && order >= 1 && order < SUPINE_FIT_ORDER_MAX) {
    const double below = c->inner[order - 1][report->band];
    if (below > report->volume_error) {
      report->six_volumes = report->volume_error * pow(report->volume_error / below,
                                                       (double)(SUPINE_FIT_ORDER_MAX - order));
    }
  }
}

/* Judge the chosen fit. */
static supine_status judge_chosen(supine_fit *fit) {
  const supine_run_groups inner = inner_volumes_of(fit);
  supine_fit_report *report = &fit->report;
  while (report->band_highest < SUPINE_FIT_BAND_MAX &&
         report->error[report->order][report->band_highest + 1] > 0.0) {
    ++report->band_highest;
  }
  if (!supine_fields_regression_is_determined(&fit->chosen, &inner)) {
    fit->groups.count = fit->direction_groups;
  }
  if (fit->ends.count > 0 && supine_fields_regression_is_determined(&fit->chosen, &fit->ends)) {
    left_sums sums;
    SUPINE_TRY(leave_out_all(fit, &fit->chosen, &fit->ends, &sums));
    report->extrapolated = relative_error(sums);
  }
  SUPINE_TRY(supine_fields_find_suspects(fit, supine_fields_size(fit)));
  return supine_fields_find_frame(fit);
}

/* Fit all bands and orders that the runs determine. Choose band `wanted` or, if it is negative, the
 * band by the error; and the order by the error. */
static supine_status choose(supine_fit *fit, int wanted, supine_error *error) {
  const size_t levels = fit->report.volume_count;
  const size_t order_most = levels - 1 < SUPINE_FIT_ORDER_MAX ? levels - 1 : SUPINE_FIT_ORDER_MAX;
  choice c = {.runs = {.count = fit->fields->run_count,
                       .part_count = fit->lungs->lung_count,
                       .gravity = fit->fields->directions,
                       .volume = fit->parameter},
              .wanted = wanted,
              .order_least = levels > 1 ? 1 : 0,
              .least = INFINITY,
              .whole = INFINITY};
  size_t highest = 0; /* band that the runs determine with any order, plus 1 */
  fit->inner_groups = fit->groups.count - fit->direction_groups;
  for (size_t order = 0; order <= order_most; ++order) {
    bool determined = true;
    for (size_t band = 0; band <= SUPINE_FIT_BAND_MAX && determined; ++band) {
      const supine_status status = try_fit(fit, &c, band, order, &determined);
      SUPINE_REFUSE_IF(status != SUPINE_OK, error, status, "fit of band %zu, order %zu: %s", band,
                       order, supine_status_string(status));
      highest = determined && order >= c.order_least && band + 1 > highest ? band + 1 : highest;
    }
  }
  SUPINE_REFUSE_IF(
      fit->chosen.values == NULL && wanted < 0, error, SUPINE_ERROR_ARGUMENT,
      "%zu runs for %zu directions of gravity determine no fit: simulate more directions",
      fit->fields->run_count, fit->report.direction_count);
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_omit("band")};
  SUPINE_REFUSE_ADVISE(
      fit->chosen.values == NULL, error, advice, SUPINE_ERROR_ARGUMENT,
      "%zu directions of gravity do not determine band %d (%d harmonics); the highest band that "
      "they determine is %d: use more directions",
      fit->report.direction_count, wanted, (wanted + 1) * (wanted + 1), (int)highest - 1);
  guess_six(&c, &fit->report);
  return judge_chosen(fit);
}

supine_status supine_fields_fit(const supine_fields *fields, const supine_lungs *lungs, int band,
                                supine_fit *fit, supine_error *error) {
  const size_t m = fields->run_count;
  *fit = (supine_fit){.fields = fields, .lungs = lungs};
  SUPINE_REFUSE_IF(m < 2, error, SUPINE_ERROR_ARGUMENT,
                   "too few directions of gravity (%zu): give fields for at least two", m);
  fit->gram = supine_arena_take(&fit->memory, lungs->lung_count * m * m, sizeof *fit->gram);
  SUPINE_TRY(supine_arena_check(&fit->memory, error, "%zu fields", m));
  find_gram(fit);
  SUPINE_REFUSE_IF(!(square_sum(fit, m) > 0.0), error, SUPINE_ERROR_NUMERICAL,
                   "all displacements are zero: give fields that move the surface");
  SUPINE_TRY(supine_fields_volumes_measure(fit, error));
  return choose(fit, band, error);
}

void supine_fields_fit_free(supine_fit *fit) {
  supine_arena_free(&fit->memory);
}

double supine_fields_fit_error(const supine_fit *fit) {
  return fmax(fit->report.error[fit->report.order][fit->report.band], negligible);
}

supine_status supine_fields_field(const supine_fit *fit, supine_gravity_field *field,
                                  supine_error *error) {
  const int m = (int)fit->chosen.run_count;
  const size_t terms = fit->chosen.terms;
  const size_t rows = 3 * fit->fields->vertex_count;
  supine_expansion *made = &field->expansion;
  field->rows = (supine_rows){.kind = SUPINE_ROWS_VECTOR};
  *made = (supine_expansion){
      .row_count = rows, .band = fit->report.band, .order = fit->report.order, .rank = terms};
  made->columns = malloc(rows * terms * sizeof *made->columns);
  made->functions = calloc(terms * terms, sizeof *made->functions);
  if (made->columns == NULL || made->functions == NULL) {
    return supine_error_memory(error, "%zu terms of %zu vertices", terms, rows / 3);
  }
  for (size_t t = 0; t < terms; ++t) { /* the columns are the coefficients of the terms */
    made->functions[t * terms + t] = 1.0;
  }
  for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
    const size_t begin = fit->lungs->lung_begin[lung];
    const int width = 3 * (int)(fit->lungs->lung_begin[lung + 1] - begin);
    cblas_dgemm(CblasRowMajor, CblasTrans, CblasTrans, width, (int)terms, m, 1.0,
                fit->fields->displacement + 3 * begin, (int)rows,
                fit->chosen.pinv + lung * terms * (size_t)m, m, 0.0,
                made->columns + 3 * begin * terms, (int)terms);
  }
  return SUPINE_OK;
}
