/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the force that a measured displacement implies. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <gsl/gsl_statistics.h>
#include <lapacke.h>

#include "precompute/patient/matching.h"

#include "sh/base/vec3.h"

enum { COLUMNS = SUPINE_PATIENT_COLUMNS };

/* Length of a direction, relative to their RMS, below which its share of the force is damped: short
 * ones say little about the force. */
static const double shortest = 0.1;

/* Find the spread force [N]: the law's, corrected by the remaining distance to the other surface
 * along its normal. */
static void find_catch(supine_patient_matching *m, const supine_patient *patient, double *caught,
                       supine_patient_applied *applied) {
  supine_patient law = *patient;
  double softener = 0.0; /* mm^2 */
  double d[3];
  law.centre_count = 0;
  for (size_t v = 0; v < m->count; ++v) {
    supine_patient_direction(&law.power, &m->rows[v].place, 1.0, d);
    softener += shortest * shortest * supine_dot(d, d) / (double)m->count;
  }
  (void)supine_patient_matching_place(m, &law);
  supine_patient_matching_find(m);
  applied->matched = 0.0;
  for (size_t v = 0; v < m->count; ++v) {
    const supine_patient_row *row = &m->rows[v];
    supine_patient_direction(&law.power, &row->place, 1.0, d);
    caught[v] =
        supine_patient_force_at(&law.power, &row->place) +
        row->weight * m->distance[v] * supine_dot(row->axis, d) / (supine_dot(d, d) + softener);
    applied->matched += row->weight / (double)m->count;
  }
}

/* Average the columns of (18), the height along gravity and the force over each block, weighted by
 * area.
 * @param means  [COLUMNS + 2, blocks] written
 * @param area   [blocks] written, mm^2 */
static void average(const supine_patient_matching *m, const double *force, const double gravity[3],
                    double *vertex_area, size_t blocks, double *means, double *area) {
  supine_mesh_vertex_area(&m->rest->mesh, vertex_area);
  memset(means, 0, (COLUMNS + 2) * blocks * sizeof *means);
  memset(area, 0, blocks * sizeof *area);
  for (size_t v = 0; v < m->count; ++v) {
    const size_t b = m->rows[v].block;
    for (size_t k = 0; k < COLUMNS; ++k) {
      means[k * blocks + b] += vertex_area[v] * m->columns[COLUMNS * v + k];
    }
    means[COLUMNS * blocks + b] +=
        vertex_area[v] * supine_dot(gravity, m->rest->mesh.vertices + 3 * v);
    means[(COLUMNS + 1) * blocks + b] += vertex_area[v] * force[v];
    area[b] += vertex_area[v];
  }
  for (size_t i = 0; i < (COLUMNS + 2) * blocks; ++i) {
    means[i] /= area[i % blocks];
  }
}

/* Fit (18) to the blocks' force by weighted least squares, and find the residual. */
static bool fit_force(const double *means, const double *area, size_t blocks,
                      supine_patient_applied *applied) {
  const double *force = means + (COLUMNS + 1) * blocks;
  double matrix[COLUMNS * COLUMNS] = {0.0};
  double k[COLUMNS] = {0.0};
  double squares = 0.0;
  double weight = 0.0;
  for (size_t b = 0; b < blocks; ++b) {
    cblas_dsyr(CblasColMajor, CblasLower, COLUMNS, area[b], means + b, (int)blocks, matrix,
               COLUMNS);
    cblas_daxpy(COLUMNS, area[b] * force[b], means + b, (int)blocks, k, 1);
  }
  if (blocks <= COLUMNS ||
      LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', COLUMNS, 1, matrix, COLUMNS, k, COLUMNS) != 0 ||
      k[0] == 0.0) {
    return false;
  }
  for (size_t b = 0; b < blocks; ++b) {
    const double left = cblas_ddot(COLUMNS, k, 1, means + b, (int)blocks) - force[b];
    squares += area[b] * left * left;
    weight += area[b];
  }
  for (size_t i = 0; i < 3; ++i) {
    applied->slopes[i] = k[1 + i] / k[0];
  }
  applied->left = sqrt(squares / weight) / fabs(k[0]);
  applied->spread = sqrt(gsl_stats_wtss(area, 1, force, 1, blocks) / weight) / fabs(k[0]);
  return true;
}

/* Compute the weighted correlation of two columns. */
static double correlate(const double *area, const double *a, const double *b, size_t count) {
  const double mean[2] = {gsl_stats_wmean(area, 1, a, 1, count),
                          gsl_stats_wmean(area, 1, b, 1, count)};
  double product = 0.0;
  for (size_t i = 0; i < count; ++i) {
    product += area[i] * (a[i] - mean[0]) * (b[i] - mean[1]);
  }
  return product /
         sqrt(gsl_stats_wtss(area, 1, a, 1, count) * gsl_stats_wtss(area, 1, b, 1, count));
}

supine_status supine_patient_applied_find(supine_patient_matching *matching,
                                          const supine_patient *patient, const double gravity[3],
                                          supine_patient_applied *applied, supine_error *error) {
  supine_patient_matching *m = matching;
  const size_t n = m->rest->mesh.vertex_count;
  double *caught = malloc(2 * n * sizeof *caught);
  double *means = malloc((COLUMNS + 3) * n * sizeof *means);
  supine_status status =
      caught == NULL || means == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n)
          : supine_patient_matching_choose(m, n, 0, error);
  if (status == SUPINE_OK) {
    find_catch(m, patient, caught, applied);
    status = supine_physics_equilibrium_force(m->equilibrium, caught, caught + n, error);
  }
  if (status == SUPINE_OK) {
    const size_t blocks = supine_patient_rows_block(&m->frame, m->rows, n, 1);
    double *area = means + (COLUMNS + 2) * blocks;
    average(m, caught + n, gravity, caught, blocks, means, area);
    applied->blocks = (double)blocks;
    applied->correlation =
        correlate(area, means + COLUMNS * blocks, means + (COLUMNS + 1) * blocks, blocks);
    if (!fit_force(means, area, blocks, applied)) {
      status = supine_error_set(
          error, SUPINE_ERROR_NUMERICAL,
          "the displacement along the law's directions does not determine the force: check "
          "that both surfaces are of the same whole lungs");
    }
  }
  free(caught);
  free(means);
  return status;
}
