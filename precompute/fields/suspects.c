/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find runs that all others do not predict.
 *
 * A wrong run spoils the fit to the others, and the choice of its terms with it: its own error then
 * looks usual. Therefore the worst runs are taken out, one after the other, and the terms are
 * chosen anew for those that are left. These predict right runs with their usual error.
 *
 * A prediction is a weighted sum of runs. Runs beside a gap, or at the smallest or the largest
 * volume, are predicted with large weights, which enlarge the errors of the other runs. Errors are
 * therefore compared after division by the norm of the weights, 1 for the run itself included. For
 * a run that is left out alone this is its error times the root of 1 - h, with h the diagonal of
 * the hat matrix. The upper quartile of these errors is the usual one: runs at the ends of the
 * volumes may err several times as much as the median, and a quarter of the runs may be wrong. */
#include <cblas.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "precompute/fields/fields.h"
#include "precompute/fields/suspects.h"
#include "sh/expansion.h"

/* Condition number up to which runs determine a fit, as in regression.c. */
static const double condition_max = 100.0;

/* A run whose error is a smaller part of the RMS displacement is not named. */
static const double worth_naming = 0.05;

/* A run without displacement is right if its prediction is a smaller part of the RMS displacement:
 * displacements may count from its posture. */
static const double predicted_least = 0.3;

/* Number of runs for each that is taken out, and the highest band that is tried. */
enum { RUNS_FOR_EACH = 8, BAND_MOST = 5 };

/* Runs that are left, and what a fit to them needs. */
typedef struct remaining {
  const supine_fit *fit;
  size_t count;
  size_t *run;     /* [count] */
  double *gravity; /* [count, 3] */
  double *volume;  /* [lungs, count] t */
  double *gram;    /* [lungs, count, count] */
  double *square;  /* [count] squared error of each, left out alone, in the best fit, mm^2 */
  double *trial;   /* [count] the same, in another fit */
  supine_arena memory;
} remaining;

static size_t run_total(const supine_fit *fit) {
  return fit->fields->run_count;
}

static supine_status remaining_begin(const supine_fit *fit, remaining *left) {
  const size_t m = run_total(fit);
  const size_t lungs = fit->lungs->lung_count;
  *left = (remaining){.fit = fit, .count = m};
  left->run = supine_arena_take(&left->memory, m, sizeof *left->run);
  left->gravity = supine_arena_take(&left->memory, 3 * m, sizeof(double));
  left->volume = supine_arena_take(&left->memory, lungs * m, sizeof(double));
  left->gram = supine_arena_take(&left->memory, lungs * m * m, sizeof(double));
  left->square = supine_arena_zeros(&left->memory, m, sizeof(double));
  left->trial = supine_arena_zeros(&left->memory, m, sizeof(double));
  SUPINE_TRY(supine_arena_status(&left->memory));
  for (size_t i = 0; i < m; ++i) {
    left->run[i] = i;
  }
  return SUPINE_OK;
}

/* Gather the directions, the volumes and the scalar products of the runs that are left. */
static void gather(remaining *left) {
  const supine_fit *fit = left->fit;
  const size_t m = run_total(fit);
  const size_t n = left->count;
  for (size_t i = 0; i < n; ++i) {
    memcpy(left->gravity + 3 * i, fit->fields->directions + 3 * left->run[i], 3 * sizeof(double));
  }
  for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
    for (size_t i = 0; i < n; ++i) {
      const double *row = fit->gram + (lung * m + left->run[i]) * m;
      left->volume[lung * n + i] = fit->parameter[lung * m + left->run[i]];
      for (size_t j = 0; j < n; ++j) {
        left->gram[(lung * n + i) * n + j] = row[left->run[j]];
      }
    }
  }
}

static double sum_of(const double *x, size_t count) {
  double sum = 0.0;
  for (size_t i = 0; i < count; ++i) {
    sum += x[i];
  }
  return sum;
}

/* Choose the terms with which the runs that are left predict each other best.
 * @param best  written; `values` is NULL if no fit is determined */
static supine_status fit_remaining(remaining *left, supine_arena *memory, supine_regression *best) {
  const supine_fit *fit = left->fit;
  const supine_runs runs = {left->count, fit->lungs->lung_count, left->gravity, left->volume};
  const size_t levels = fit->report.volume_count;
  const size_t most = levels - 1 < SUPINE_FIT_ORDER_MAX ? levels - 1 : SUPINE_FIT_ORDER_MAX;
  double least = INFINITY;
  gather(left);
  *best = (supine_regression){.values = NULL};
  for (size_t order = levels > 1 ? 1 : 0; order <= most; ++order) {
    for (size_t band = 0; band <= BAND_MOST; ++band) {
      supine_regression trial;
      if (supine_sh_terms(band, order) >= left->count) {
        break;
      }
      SUPINE_TRY(supine_fields_regression_create(&runs, band, order, memory, &trial));
      if (trial.condition > condition_max ||
          supine_fields_regression_leave_each(&trial, left->gram, left->trial) != SUPINE_OK) {
        break;
      }
      const double sum = sum_of(left->trial, left->count);
      if (sum < least) {
        least = sum;
        *best = trial;
        memcpy(left->square, left->trial, left->count * sizeof *left->square);
      }
    }
  }
  return SUPINE_OK;
}

/* Compute the squared error, mm^2, of the prediction of a run that is not left, and the same divided
 * by the squared norm of its weights. */
static supine_status predict(const remaining *left, const supine_regression *r, size_t run,
                             supine_arena *memory, double *square, double *scaled) {
  const supine_fit *fit = left->fit;
  const size_t m = run_total(fit);
  double *terms = supine_arena_take(memory, r->terms, sizeof *terms);
  double *error = supine_arena_take(memory, m, sizeof *error); /* a sum of all runs */
  SUPINE_TRY(supine_arena_status(memory));
  *square = 0.0;
  *scaled = 0.0;
  for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
    double sum = 0.0;
    const double *pinv = r->pinv + lung * r->terms * r->run_count;
    const double *gram = fit->gram + lung * m * m;
    SUPINE_TRY(supine_sh_evaluate_products(r->band, r->order, fit->fields->directions + 3 * run,
                                           fit->parameter[lung * m + run], terms));
    memset(error, 0, m * sizeof *error);
    error[run] = 1.0;
    for (size_t i = 0; i < r->terms * r->run_count; ++i) {
      error[left->run[i % r->run_count]] -= terms[i / r->run_count] * pinv[i];
    }
    for (size_t i = 0; i < m * m; ++i) {
      sum += error[i / m] * error[i % m] * gram[i];
    }
    *square += sum;
    *scaled += sum / cblas_ddot((int)m, error, 1, error, 1);
  }
  return SUPINE_OK;
}

/* Take out the run with the largest error. */
static size_t take_out_worst(remaining *left) {
  size_t worst = 0;
  for (size_t i = 1; i < left->count; ++i) {
    worst = left->square[i] > left->square[worst] ? i : worst;
  }
  const size_t run = left->run[worst];
  --left->count;
  memmove(left->run + worst, left->run + worst + 1, (left->count - worst) * sizeof *left->run);
  return run;
}

static int compare_numbers(const void *first, const void *second) {
  const double *a = first;
  const double *b = second;
  return (*a > *b) - (*a < *b);
}

/* Return 1 - h of a run that is left, its mean over the lungs. */
static double freedom(const supine_regression *r, size_t run) {
  double sum = 0.0;
  for (size_t part = 0; part < r->part_count; ++part) {
    const double *values = r->values + (part * r->run_count + run) * r->terms;
    const double *pinv = r->pinv + part * r->terms * r->run_count + run;
    sum += 1.0 - cblas_ddot((int)r->terms, values, 1, pinv, (int)r->run_count);
  }
  return sum / (double)r->part_count;
}

/* Add the runs that were taken out, if they err, to the report. */
static supine_status judge(supine_fit *fit, remaining *left, const supine_regression *r,
                           const size_t *out, size_t count, double rms_mm) {
  const double size = rms_mm * rms_mm * (double)fit->fields->vertex_count;
  SUPINE_ARENA arena = {0};
  for (size_t i = 0; i < left->count; ++i) {
    left->square[i] *= freedom(r, i);
  }
  qsort(left->square, left->count, sizeof *left->square, compare_numbers);
  const double usual = left->square[3 * left->count / 4];
  fit->report.suspect_count = 0;
  for (size_t i = 0; i < count; ++i) {
    double square = 0.0;
    double scaled = 0.0;
    SUPINE_TRY(predict(left, r, out[i], &arena, &square, &scaled));
    if (square > worth_naming * worth_naming * size && usual > 0.0) {
      fit->report.suspects[fit->report.suspect_count++] =
          (supine_fit_suspect){out[i], sqrt(scaled / usual), sqrt(square / size)};
    }
  }
  return SUPINE_OK;
}

/* Find the run without any displacement whose prediction is largest (supine_fit_report.zero). */
static supine_status find_zero(supine_fit *fit, double rms_mm) {
  const size_t m = run_total(fit);
  const double size = rms_mm * rms_mm * (double)fit->fields->vertex_count;
  double most = predicted_least * predicted_least * size;
  SUPINE_ARENA arena = {0};
  double *square = supine_arena_take(&arena, m, sizeof *square);
  double *sorted = supine_arena_take(&arena, m, sizeof *sorted);
  SUPINE_TRY(supine_arena_status(&arena));
  SUPINE_TRY(supine_fields_regression_leave_each(&fit->chosen, fit->gram, square));
  memcpy(sorted, square, m * sizeof *sorted);
  qsort(sorted, m, sizeof *sorted, compare_numbers);
  for (size_t run = 0; run < m; ++run) {
    double moved = 0.0;
    for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
      moved += fit->gram[(lung * m + run) * m + run];
    }
    if (moved == 0.0 && square[run] > most) {
      most = square[run];
      fit->report.zero = (supine_fit_suspect){run, sqrt(most / sorted[m / 2]), sqrt(most / size)};
    }
  }
  return SUPINE_OK;
}

supine_status supine_fields_find_suspects(supine_fit *fit, double rms_mm) {
  const size_t m = run_total(fit);
  size_t out[SUPINE_FIT_SUSPECTS_MAX];
  remaining left = {.count = 0};
  supine_arena memory = {0};
  supine_regression r;
  size_t count = 0;
  supine_status status = find_zero(fit, rms_mm);
  if (status == SUPINE_OK) {
    status = remaining_begin(fit, &left);
  }
  if (status == SUPINE_OK) {
    status = fit_remaining(&left, &memory, &r);
  }
  while (status == SUPINE_OK && r.values != NULL && count < SUPINE_FIT_SUSPECTS_MAX &&
         (count + 1) * RUNS_FOR_EACH <= m) {
    out[count++] = take_out_worst(&left);
    supine_arena_free(&memory);
    memory = (supine_arena){0};
    status = fit_remaining(&left, &memory, &r);
  }
  if (status == SUPINE_OK && r.values != NULL && count > 0) {
    status = judge(fit, &left, &r, out, count, rms_mm);
  }
  supine_arena_free(&memory);
  supine_arena_free(&left.memory);
  return status;
}
