/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit the simulated volumes by functions of gravity: their limits, and each lung's part of a
 * total. */
#include <cblas.h>
#include <math.h>

#include <supine/sh.h>

#include "base/lapack.h"
#include "precompute/fields/volumes.h"

/* Highest band of the shares of the lungs. */
enum { SHARE_BAND = 2 };

/* Part of the simulated range by which the limits lie outside it, at both ends. */
static const double margin = 0.01;

/* How smooth limits are between the directions. */
static const double smoothness = 4.0;

/* Return the highest band, at most 2, that the chosen fit has too. */
static size_t share_band(const supine_fit *fit) {
  return fit->report.band < SHARE_BAND ? fit->report.band : SHARE_BAND;
}

/* For each direction of gravity, find the smallest or largest volume of a lung.
 * @param side     0 for the smallest, 1 for the largest
 * @param gravity  [directions, 3] written
 * @param volume   [directions] written, mL */
static void find_ends(const supine_fit *fit, size_t lung, int side, double *gravity,
                      double *volume) {
  const double *of = fit->volume + lung * fit->fields->run_count;
  for (size_t d = 0; d < fit->direction_groups; ++d) {
    const size_t first = fit->groups.begin[d];
    volume[d] = of[fit->groups.run[first]];
    for (size_t i = first; i < fit->groups.begin[d + 1]; ++i) {
      const double v = of[fit->groups.run[i]];
      volume[d] = side == 0 ? fmin(volume[d], v) : fmax(volume[d], v);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      gravity[3 * d + axis] = fit->fields->directions[3 * fit->groups.run[first] + axis];
    }
  }
}

/* Return the lowest band that has as many harmonics as there are directions, at most
 * LIMIT_BAND_MAX.
 */
static size_t interpolating_band(size_t directions) {
  size_t band = 0;
  while (band < SUPINE_LIMIT_BAND_MAX && supine_sh_count(band) < directions) {
    ++band;
  }
  return band;
}

/* Return the degree of a harmonic by its index. */
static double degree_of(size_t term) {
  return floor(sqrt((double)term));
}

/* Interpolate values at directions by the smoothest harmonics c that have them (a spline on the
 * sphere):
 *
 *     c = W Y^T (Y W Y^T)^-1 values,    W = (1 + l (l + 1))^-smoothness
 *
 * If there are more directions than harmonics, the values are met approximately.
 * @param values  [directions], changed
 * @param c       [terms] written */
static supine_status interpolate(size_t directions, const double *gravity, size_t band,
                                 double *values, double *c) {
  const int d = (int)directions;
  const size_t terms = supine_sh_count(band);
  const int p = (int)terms;
  SUPINE_ARENA arena = {0};
  double *y = supine_arena_take(&arena, directions * terms, sizeof *y);
  double *weighted = supine_arena_take(&arena, directions * terms, sizeof *weighted);
  double *k = supine_arena_take(&arena, directions * directions, sizeof *k);
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t i = 0; i < directions; ++i) {
    SUPINE_TRY(supine_sh_evaluate(band, gravity + 3 * i, y + i * terms));
  }
  for (size_t i = 0; i < directions * terms; ++i) {
    const double l = degree_of(i % terms);
    weighted[i] = y[i] * pow(1.0 + l * (l + 1.0), -smoothness);
  }
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, d, d, p, 1.0, y, p, weighted, p, 0.0, k, d);
  const double ridge = 1e-10 * cblas_dasum(d, k, d + 1) / (double)directions;
  for (size_t i = 0; i < directions; ++i) {
    k[i * directions + i] += ridge;
  }
  SUPINE_TRY(supine_lapack_status(LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', d, 1, k, d, values, 1)));
  cblas_dgemv(CblasRowMajor, CblasTrans, d, p, 1.0, weighted, p, values, 1, 0.0, c, 1);
  return SUPINE_OK;
}

/* Interpolate the ends of the simulated range of a lung, and move them outwards by a part of it.
 * @param limit  [2, limit_terms] written */
static supine_status fit_limits(const supine_fit *fit, size_t lung, size_t band, double *limit) {
  const size_t directions = fit->direction_groups;
  SUPINE_ARENA arena = {0};
  double *gravity = supine_arena_take(&arena, 3 * directions, sizeof *gravity);
  double *low = supine_arena_take(&arena, directions, sizeof *low);
  double *high = supine_arena_take(&arena, directions, sizeof *high);
  SUPINE_TRY(supine_arena_status(&arena));
  find_ends(fit, lung, 0, gravity, low);
  find_ends(fit, lung, 1, gravity, high);
  for (size_t i = 0; i < directions; ++i) {
    const double more = margin * (high[i] - low[i]);
    low[i] -= more;
    high[i] += more;
  }
  SUPINE_TRY(interpolate(directions, gravity, band, low, limit));
  return interpolate(directions, gravity, band, high, limit + supine_sh_count(band));
}

/* Fit the volume of each lung by functions of gravity and of the total volume. As the total is one
 * of these functions, the volumes add up to it. */
static supine_status fit_shares(const supine_fit *fit, supine_simulated_volumes *made) {
  const size_t m = fit->fields->run_count;
  const size_t order = fit->report.order;
  const size_t terms = supine_sh_terms(share_band(fit), order);
  SUPINE_ARENA arena = {0};
  double *total = supine_arena_take(&arena, m, sizeof *total);
  supine_regression fitted;
  SUPINE_TRY(supine_arena_status(&arena));
  supine_fields_map_totals(fit, total, made->total);
  const supine_runs runs = {
      .count = m, .part_count = 1, .gravity = fit->fields->directions, .volume = total};
  SUPINE_TRY(supine_fields_regression_create(&runs, share_band(fit), order, &arena, &fitted));
  for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
    for (size_t t = 0; t < terms; ++t) {
      made->shares[lung][t / (order + 1)][t % (order + 1)] =
          cblas_ddot((int)m, fitted.pinv + t * m, 1, fit->volume + lung * m, 1);
    }
  }
  return SUPINE_OK;
}

supine_status supine_fields_volumes_fit(const supine_fit *fit, supine_simulated_volumes *made,
                                        supine_error *error) {
  *made = (supine_simulated_volumes){.share_count = fit->report.order + 1};
  supine_status status = fit_shares(fit, made);
  const size_t band = interpolating_band(fit->direction_groups);
  made->limit_terms = supine_sh_count(band);
  for (size_t lung = 0; status == SUPINE_OK && lung < fit->lungs->lung_count; ++lung) {
    status = fit_limits(fit, lung, band, made->limits + 2 * lung * made->limit_terms);
  }
  SUPINE_REFUSE_IF(status != SUPINE_OK, error, status, "the simulated volumes: %s",
                   supine_status_string(status));
  return SUPINE_OK;
}
