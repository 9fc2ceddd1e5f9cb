/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit the simulated volumes by functions of gravity: their limits, and each lung's part of a total.
 */
#include <cblas.h>
#include <math.h>

#include <supine/sh.h>

#include "precompute/fields/fields.h"

enum { LIMIT_BAND = 2, LIMIT_TERMS = 9 };

/* Return the highest band, at most 2, that the chosen fit has too. */
static size_t limit_band(const supine_fit *fit) {
  return fit->report.band < LIMIT_BAND ? fit->report.band : LIMIT_BAND;
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

/* Fit harmonics to the ends of the simulated range, and move the constant outwards by twice the
 * largest residual: once so that no simulated volume lies outside, and once as the fit errs as much
 * in directions that were not simulated. */
static supine_status fit_limit(const supine_fit *fit, size_t lung, int side,
                               double limit[LIMIT_TERMS]) {
  static const double constant = 0.28209479177387814; /* Y(0, 0) */
  const size_t directions = fit->direction_groups;
  const size_t terms = supine_sh_count(limit_band(fit));
  SUPINE_ARENA arena = {0};
  double *gravity = supine_arena_take(&arena, 3 * directions, sizeof *gravity);
  double *volume = supine_arena_take(&arena, directions, sizeof *volume);
  supine_regression fitted;
  SUPINE_TRY(supine_arena_status(&arena));
  find_ends(fit, lung, side, gravity, volume);
  const supine_runs runs = {.count = directions, .part_count = 1, .gravity = gravity};
  SUPINE_TRY(supine_fields_regression_create(&runs, limit_band(fit), 0, &arena, &fitted));
  double outside = 0.0; /* largest residual, mL */
  for (size_t t = 0; t < LIMIT_TERMS; ++t) {
    limit[t] =
        t < terms ? cblas_ddot((int)directions, fitted.pinv + t * directions, 1, volume, 1) : 0.0;
  }
  for (size_t d = 0; d < directions; ++d) {
    const double found = cblas_ddot((int)terms, fitted.values + d * terms, 1, limit, 1);
    outside = fmax(outside, fabs(found - volume[d]));
  }
  limit[0] += (side == 0 ? -2.0 : 2.0) * outside / constant;
  return SUPINE_OK;
}

/* Fit the volume of each lung by functions of gravity and of the total volume. As the total is one
 * of these functions, the volumes add up to it. */
static supine_status fit_shares(const supine_fit *fit, supine_simulated_volumes *made) {
  const size_t m = fit->fields->run_count;
  const size_t order = fit->report.order;
  const size_t terms = supine_sh_terms(limit_band(fit), order);
  SUPINE_ARENA arena = {0};
  double *total = supine_arena_zeros(&arena, m, sizeof *total);
  supine_regression fitted;
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t i = 0; i < m * fit->lungs->lung_count; ++i) {
    total[i % m] += fit->volume[i];
  }
  made->total[0] = made->total[1] = total[0];
  for (size_t run = 0; run < m; ++run) {
    made->total[0] = fmin(made->total[0], total[run]);
    made->total[1] = fmax(made->total[1], total[run]);
  }
  for (size_t run = 0; run < m; ++run) {
    total[run] = 2.0 * (total[run] - made->total[0]) / (made->total[1] - made->total[0]) - 1.0;
  }
  const supine_runs runs = {
      .count = m, .part_count = 1, .gravity = fit->fields->directions, .volume = total};
  SUPINE_TRY(supine_fields_regression_create(&runs, limit_band(fit), order, &arena, &fitted));
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
  for (size_t end = 0; status == SUPINE_OK && end < 2 * fit->lungs->lung_count; ++end) {
    status = fit_limit(fit, end / 2, (int)(end % 2), made->limits[end / 2][end % 2]);
  }
  SUPINE_REFUSE_IF(status != SUPINE_OK, error, status, "the simulated volumes: %s",
                   supine_status_string(status));
  return SUPINE_OK;
}
