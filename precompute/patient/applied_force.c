/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the applied force on the lungs from a measured displacement ([Santhanam2008] IV-B.3). */
#include <math.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "precompute/patient/matching.h"

#include "base/arena.h"
#include "base/vec3.h"

enum { COLUMNS = SUPINE_PATIENT_COLUMNS, HEIGHT = COLUMNS, FORCE, ALL };

/* Square root of the Levenberg damping / RMS displacement for a force of 1. */
static const double damping_ratio = 0.1;

/* Compute smoothed_force [vertices], the applied force smoothed over the surface: the force of the
 * displacement law, plus the force that would move the displaced vertex onto the other surface. */
static void find_smoothed_force(supine_patient_matching *m, const supine_patient *patient,
                                double *smoothed_force) {
  supine_patient law = *patient;
  double damping = 0.0;
  double d[3];
  law.centre_count = 0;
  for (size_t v = 0; v < m->count; ++v) {
    supine_patient_direction(&law.power, &m->rows[v].place, 1.0, d);
    damping += damping_ratio * damping_ratio * supine_dot(d, d) / (double)m->count;
  }
  (void)supine_patient_matching_place(m, &law);
  supine_patient_matching_find(m);
  for (size_t v = 0; v < m->count; ++v) {
    const supine_patient_row *row = &m->rows[v];
    supine_patient_direction(&law.power, &row->place, 1.0, d);
    smoothed_force[v] = supine_patient_force_at(&law.power, &row->place) +
                        row->weight * m->match[v].distance * supine_dot(row->axis, d) /
                            (supine_dot(d, d) + damping);
  }
}

/* The force at a vertex or landmark. */
typedef struct sample {
  double weight; /* area of the vertex, or 1 */
  size_t block;  /* cube of 40 mm */
  const supine_patient_place *place;
  double height; /* along gravity, mm */
  double force;
} sample;

/* Average six quantities over the samples in each cube of 40 mm: 1; X - 1/2, Y - 1/2 and Z - 1/2,
 * where X, Y and Z are coordinates 0 to 1 in the bounding box; the depth along gravity; and the
 * force. For each pair of quantities, multiply the two means of each cube by each other and by the
 * cube's weight, and sum the results into `products`.
 * @param means  [blocks, ALL + 1] work space */
static void sum_products(const sample *samples, size_t count, size_t blocks, double *means,
                         double products[ALL * ALL]) {
  memset(means, 0, (ALL + 1) * blocks * sizeof *means);
  for (size_t i = 0; i < count; ++i) {
    const sample *at = &samples[i];
    double *mean = means + (ALL + 1) * at->block;
    cblas_daxpy(COLUMNS, at->weight, at->place->force, 1, mean, 1);
    mean[HEIGHT] += at->weight * at->height;
    mean[FORCE] += at->weight * at->force;
    mean[ALL] += at->weight;
  }
  memset(products, 0, ALL * ALL * sizeof *products);
  for (size_t b = 0; b < blocks; ++b) {
    const double *mean = means + (ALL + 1) * b;
    cblas_dsyr(CblasColMajor, CblasLower, ALL, 1.0 / mean[ALL], mean, 1, products, ALL);
  }
}

/* Compute the covariance of quantities a and b. products[i * ALL + j] is the weighted sum of the
 * products of quantities i and j; quantity 0 is 1. */
static double covariance(const double products[ALL * ALL], size_t a, size_t b) {
  return (products[a * ALL + b] - products[a] * products[b] / products[0]) / products[0];
}

/* Fit a linear function of X, Y and Z, coordinates in the lungs' bounding box, to the mean force in
 * each cube (sum_products). Return false on failure. */
static bool fit_force(const double products[ALL * ALL], supine_patient_applied *applied) {
  double matrix[ALL * ALL];
  double k[COLUMNS];
  memcpy(matrix, products, sizeof matrix);
  for (size_t i = 0; i < COLUMNS; ++i) {
    k[i] = products[i * ALL + FORCE];
  }
  if (applied->blocks <= COLUMNS ||
      LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', COLUMNS, 1, matrix, ALL, k, COLUMNS) != 0 ||
      k[0] == 0.0) {
    return false;
  }
  const double variance = covariance(products, FORCE, FORCE);
  double squares = products[FORCE * ALL + FORCE];
  for (size_t i = 0; i < COLUMNS; ++i) {
    squares -= k[i] * products[i * ALL + FORCE];
  }
  memcpy(applied->slopes, k + 1, sizeof applied->slopes);
  cblas_dscal(3, 1.0 / k[0], applied->slopes, 1);
  applied->residual = sqrt(fmax(0.0, squares) / products[0]) / fabs(k[0]);
  applied->spread = sqrt(variance) / fabs(k[0]);
  applied->correlation =
      covariance(products, HEIGHT, FORCE) / sqrt(covariance(products, HEIGHT, HEIGHT) * variance);
  return true;
}

supine_status supine_patient_applied_find(supine_patient_matching *matching,
                                          const supine_patient *patient, const double gravity[3],
                                          supine_patient_applied *applied, supine_error *error) {
  const size_t n = matching->fuller->mesh.vertex_count;
  double products[ALL * ALL];
  SUPINE_ARENA arena = {0};
  double *spread = supine_arena_take(&arena, 2 * n, sizeof *spread);
  double *means = supine_arena_take(&arena, (ALL + 1) * n, sizeof *means);
  sample *samples = supine_arena_take(&arena, n, sizeof *samples);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  supine_patient_matching_choose(matching, n);
  find_smoothed_force(matching, patient, spread);
  SUPINE_TRY(supine_physics_equilibrium_force(matching->equilibrium, spread, spread + n, error));
  SUPINE_TRY(
      supine_patient_rows_block(&matching->frame, matching->rows, n, 1, &applied->blocks, error));
  supine_mesh_vertex_area(&matching->fuller->mesh, spread);
  for (size_t v = 0; v < n; ++v) {
    samples[v] = (sample){.weight = spread[v],
                          .block = matching->rows[v].block,
                          .place = &matching->rows[v].place,
                          .height = supine_dot(gravity, matching->fuller->mesh.vertices + 3 * v),
                          .force = spread[n + v]};
  }
  sum_products(samples, n, applied->blocks, means, products);
  const bool fitted = fit_force(products, applied);
  applied->from_landmarks = false;
  SUPINE_REFUSE_IF(
      !fitted, error, SUPINE_ERROR_NUMERICAL,
      "the displacement between the two surfaces does not determine the applied force: check that "
      "both surfaces show the same lungs, and that neither surface is cut off");
  return SUPINE_OK;
}

supine_status supine_patient_applied_find_landmarks(supine_patient_row *rows, size_t count,
                                                    const supine_patient *patient,
                                                    const double gravity[3],
                                                    supine_patient_applied *applied,
                                                    supine_error *error) {
  double products[ALL * ALL];
  double damping = 0.0;
  supine_patient_applied found = {.from_landmarks = true};
  SUPINE_ARENA arena = {0};
  double *means = supine_arena_take(&arena, (ALL + 1) * count, sizeof *means);
  sample *samples = supine_arena_take(&arena, count, sizeof *samples);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu landmarks", count));
  SUPINE_TRY(supine_patient_rows_block(&patient->frame, rows, 3 * count, 1, &found.blocks, error));
  for (size_t i = 0; i < count; ++i) {
    double d[3];
    supine_patient_direction(&patient->power, &rows[3 * i].place, 1.0, d);
    damping += damping_ratio * damping_ratio * supine_dot(d, d) / (double)count;
  }
  for (size_t i = 0; i < count; ++i) {
    const supine_patient_row *row = &rows[3 * i]; /* along x; those along y and z follow */
    double d[3];
    double u[3];
    supine_patient_direction(&patient->power, &row->place, 1.0, d);
    supine_patient_motion(&patient->power, &row->place, u);
    for (size_t k = 0; k < 3; ++k) {
      u[k] = row[k].value - u[k];
    }
    samples[i] = (sample){.weight = 1.0,
                          .block = row->block,
                          .place = &row->place,
                          .height = supine_dot(gravity, row->place.offset),
                          .force = supine_dot(u, d) / (supine_dot(d, d) + damping)};
  }
  sum_products(samples, count, found.blocks, means, products);
  if (fit_force(products, &found)) {
    *applied = found;
  }
  return SUPINE_OK;
}
