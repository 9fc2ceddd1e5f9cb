/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Let the displacements over gravity and volume count from the posture of the scan. */
#include <cblas.h>
#include <stdlib.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "precompute/fields/fields.h"

supine_status supine_fields_check_scan(const supine_fit *fit, const double gravity[3],
                                       supine_error *error) {
  supine_simulated_volumes simulated;
  double y[(SUPINE_LIMIT_BAND_MAX + 1) * (SUPINE_LIMIT_BAND_MAX + 1)];
  size_t band = 0;
  SUPINE_TRY(supine_fields_volumes_fit(fit, &simulated, error));
  const int terms = (int)simulated.limit_terms;
  while (supine_sh_count(band) < simulated.limit_terms) {
    ++band;
  }
  SUPINE_TRY(supine_sh_evaluate(band, gravity, y));
  for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
    const double held = fit->lungs->volume[lung];
    const double *limits = simulated.limits + 2 * lung * simulated.limit_terms;
    const double low = cblas_ddot(terms, limits, 1, y, 1);
    const double high = cblas_ddot(terms, limits + terms, 1, y, 1);
    SUPINE_REFUSE_IF(
        !(low <= 0.0 && high >= 0.0), error, SUPINE_ERROR_ARGUMENT,
        "in the posture of the scan, the %s lung was simulated at %.0f to %.0f mL, but "
        "holds %.0f mL in the scan: simulate this volume, or leave the posture out",
        supine_lungs_name(fit->lungs, lung), held + low, held + high, held);
  }
  return SUPINE_OK;
}

/* Compute the displacement of a lung by the fit at the volume that it has in the scan: a sum over
 * the runs, with these weights.
 * @param weights  [run_count] written */
static supine_status find_weights(const supine_fit *fit, size_t lung, const double gravity[3],
                                  supine_arena *memory, double *weights) {
  const supine_regression *r = &fit->chosen;
  const int m = (int)r->run_count;
  const double *range = fit->range[lung];
  const double t = 2.0 * (0.0 - range[0]) / (range[1] - range[0]) - 1.0;
  double *terms = supine_arena_take(memory, r->terms, sizeof *terms);
  SUPINE_TRY(supine_arena_status(memory));
  SUPINE_TRY(supine_sh_evaluate_products(r->band, r->order, gravity, t, terms));
  cblas_dgemv(CblasRowMajor, CblasTrans, (int)r->terms, m, 1.0,
              r->pinv + lung * r->terms * r->run_count, m, terms, 1, 0.0, weights, 1);
  return SUPINE_OK;
}

supine_status supine_fields_count_from_scan(const supine_fit *fit, const double gravity[3],
                                            supine_fields *counted, supine_error *error) {
  const supine_fields *given = fit->fields;
  const size_t m = given->run_count;
  const size_t row = 3 * given->vertex_count;
  SUPINE_ARENA arena = {0};
  double *weights = supine_arena_take(&arena, m, sizeof *weights);
  double *scanned = supine_arena_zeros(&arena, row, sizeof *scanned);
  *counted = (supine_fields){.run_count = m, .vertex_count = given->vertex_count};
  counted->directions = malloc(3 * m * sizeof *counted->directions);
  counted->displacement = malloc(m * row * sizeof *counted->displacement);
  if (arena.failed || counted->directions == NULL || counted->displacement == NULL) {
    return supine_error_memory(error, "%zu fields of %zu vertices", m, given->vertex_count);
  }
  SUPINE_TRY(supine_fields_check_scan(fit, gravity, error));
  for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
    const size_t begin = 3 * fit->lungs->lung_begin[lung];
    const int width = (int)(3 * fit->lungs->lung_begin[lung + 1] - begin);
    SUPINE_TRY(find_weights(fit, lung, gravity, &arena, weights));
    cblas_dgemv(CblasRowMajor, CblasTrans, (int)m, width, 1.0, given->displacement + begin,
                (int)row, weights, 1, 0.0, scanned + begin, 1);
  }
  memcpy(counted->directions, given->directions, 3 * m * sizeof *counted->directions);
  for (size_t i = 0; i < m * row; ++i) {
    counted->displacement[i] = given->displacement[i] - scanned[i % row];
  }
  return SUPINE_OK;
}
