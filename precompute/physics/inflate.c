/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Move a scan to full inflation. From an estimate of the surface at full inflation, the physical
 * model predicts the displacements to the scan. The fixed-point map of the estimate is the scan
 * minus these displacements. The residual is the map minus the estimate. Anderson acceleration
 * (D. G. Anderson, J. ACM 12, 1965) finds the fixed point: of all linear combinations of the last
 * few map values, the next estimate is the one with the smallest predicted residual. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include <supine/volume.h>

#include "base/arena.h"
#include "base/remedy.h"
#include "base/text.h"
#include "precompute/physics/reference.h"
#include "precompute/physics/solve.h"
#include "precompute/physics/volume_forms.h"

/* SOLVES_MAX: most iterations. DEPTH: most past iterations that Anderson acceleration uses. */
enum { SOLVES_MAX = 30, DEPTH = 4 };

/* RMS residuals, mm. The iteration ends if the residual is at most `converged`. It also ends if the
 * residual is at most `stalled` and the last step did not halve it: near an almost degenerate
 * triangle, some vertices oscillate by about 0.03 mm. */
static const double converged = 5e-4;
static const double stalled = 5e-3;
static const double folded_share = 0.01; /* largest accepted share of triangles that turn over */
static const double ridge = 1e-12; /* relative increase of a matrix diagonal against singularity */

typedef struct ascent {
  supine_lungs estimate; /* lungs at full inflation, estimated so far; vertices not owned */
  supine_lungs scan;
  supine_model model;
  supine_reference *found;
  supine_solution field;     /* displacements from `estimate` to the scan, predicted by the model */
  size_t size;               /* 3 x number of vertices */
  double *map;               /* [size] vertices of the scan minus the predicted displacements, mm */
  double *previous_map;      /* [size] `map` in the previous iteration, mm */
  double *previous_residual; /* [size] `map` minus `estimate` in the previous iteration, mm */
  double rms;                /* RMS length of `map` minus `estimate` over all vertices, mm */
  double *map_changes;       /* [DEPTH, size] changes of `map` in the last DEPTH iterations, mm */
  double *residual_changes;  /* [DEPTH, size] changes of the residual (`map` minus the vertices of
                                `estimate`) in the last DEPTH iterations, mm */
  size_t stored;             /* number of changes stored since the acceleration last restarted */
  size_t history; /* number of stored changes that the acceleration uses, at most DEPTH */
} ascent;

/* Advise on a scan from which full inflation is not found. */
static supine_status advise(supine_error *error) {
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
      supine_remedy_change("scanned", "if the scan is fuller"), supine_remedy_change("resting", ""),
      supine_remedy_give("scanned", "none", "to use the scan as it is")};
  return supine_error_advised(error, advice, SUPINE_ERROR_NUMERICAL);
}

static supine_status check_folds(const ascent *a, supine_error *error) {
  const double share = supine_mesh_turned_over(&a->scan.mesh, a->estimate.mesh.vertices);
  if (share <= folded_share) {
    return SUPINE_OK;
  }
  (void)supine_error_set(
      error, SUPINE_ERROR_NUMERICAL,
      "the scan folds on its way to full inflation: %.3g %% of its triangles turn over",
      100.0 * share);
  return advise(error);
}

/* Find the gains A of one lung in the scan: factors of its displacement along x, y and z, which are
 * 0 at full inflation. They are A = s ratio(sigma), where
 *
 *     s      gain at rest, equal on all axes
 *     sigma  position of the scan on the lung's path: 0 at full inflation, 1 at rest
 *     ratio  gains on this path as multiples of s (supine_volume_bend)
 *
 * The volumes at full inflation and at rest demand form(-A) = to_full and form(s - A) = to_rest,
 * mL. For any sigma, the first equation gives s; secant steps find the sigma of the second. */
static supine_status find_lung_gains(const supine_volume_form *form, const double bend[3],
                                     bool at_rest, double to_full, double to_rest, double gains[3],
                                     supine_error *error) {
  enum { STEPS = 50 };
  static const double tolerance = 1e-9; /* largest accepted error of the volume, mL */
  const bool straight = at_rest || (bend[0] == 0.0 && bend[1] == 0.0 && bend[2] == 0.0);
  double sigma = straight ? 1.0 : to_full / (to_full - to_rest);
  double last_sigma = 0.0;
  double last_miss = 0.0;
  for (int i = 0; i < STEPS; ++i) {
    double ratio[3];
    double cubic[3];
    double scale = 0.0;
    supine_volume_bend(bend, sigma, ratio);
    supine_volume_form_along(form, ratio, cubic);
    SUPINE_TRY(supine_volume_scale(cubic, to_full, &scale, error));
    double beyond[3];
    for (size_t axis = 0; axis < 3; ++axis) {
      gains[axis] = -scale * ratio[axis];
      beyond[axis] = -scale - gains[axis];
    }
    const double miss = supine_volume_form_at(form, beyond) - to_rest;
    if (straight || fabs(miss) <= tolerance) {
      return SUPINE_OK;
    }
    const double next =
        i == 0 ? 1.01 * sigma : sigma - miss * (sigma - last_sigma) / (miss - last_miss);
    last_sigma = sigma;
    last_miss = miss;
    sigma = next;
  }
  (void)supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                         "no path from full inflation through the scan to rest was found");
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_change("scanned", ""),
                                                     supine_remedy_change("resting", "")};
  supine_error_advise(error, advice);
  return SUPINE_ERROR_NUMERICAL;
}

supine_status supine_physics_reference_find_gains(const supine_lungs *scan, const double bend[3],
                                                  const double *directions, const double *amounts,
                                                  supine_reference *reference,
                                                  supine_error *error) {
  const supine_state *state = &reference->scan.state;
  const bool at_rest = state->volume.kind == SUPINE_VOLUME_REST && state->volume.ml == 0.0;
  supine_volume_form forms[2];
  SUPINE_TRY(supine_physics_volume_of_field(scan, NULL, directions, amounts, forms, error));
  for (size_t lung = 0; lung < scan->lung_count; ++lung) {
    const double beyond = reference->scan_volume[lung];
    SUPINE_TRY(find_lung_gains(&forms[lung], bend, at_rest, -beyond,
                               reference->scan_rest[lung] - reference->full_volume[lung] - beyond,
                               reference->scan_gains[lung], error));
  }
  return SUPINE_OK;
}

/* Set a->map to the vertices of the scan minus the displacements predicted for lungs that have the
 * shape a->estimate at full inflation, scaled so that each lung gets its volume there. */
static supine_status find_map(ascent *a, supine_error *error) {
  supine_solution *field = &a->field;
  a->rms = 0.0;
  ++a->found->solves;
  supine_mesh_box(&a->estimate.mesh, a->estimate.minimum, a->estimate.maximum);
  SUPINE_TRY(
      supine_physics_solve(&a->estimate, &a->model, a->found->scan.state.gravity, field, error));
  SUPINE_TRY(supine_physics_reference_find_gains(&a->scan, a->model.bend, field->directions,
                                                 field->catch_, a->found, error));
  for (size_t lung = 0; lung < a->scan.lung_count; ++lung) {
    const double *gains = a->found->scan_gains[lung];
    for (size_t i = 3 * a->scan.lung_begin[lung]; i < 3 * a->scan.lung_begin[lung + 1]; ++i) {
      a->map[i] =
          a->scan.mesh.vertices[i] - gains[i % 3] * field->catch_[i / 3] * field->directions[i];
      const double residual = a->map[i] - a->estimate.mesh.vertices[i];
      a->rms += residual * residual;
    }
  }
  a->rms = sqrt(a->rms / (double)(a->size / 3));
  return SUPINE_OK;
}

/* Store a->map, the residual (a->map - a->estimate) and their changes since the last iteration. */
static void store_differences(ascent *a) {
  double *changes = a->map_changes + a->stored % DEPTH * a->size;
  double *residuals = a->residual_changes + a->stored % DEPTH * a->size;
  const bool first = a->found->solves == 1;
  for (size_t i = 0; i < a->size; ++i) {
    const double residual = a->map[i] - a->estimate.mesh.vertices[i];
    changes[i] = a->map[i] - a->previous_map[i];
    residuals[i] = residual - a->previous_residual[i];
    a->previous_map[i] = a->map[i];
    a->previous_residual[i] = residual;
  }
  if (!first) {
    ++a->stored;
    a->history = a->history < DEPTH ? a->history + 1 : DEPTH;
  }
}

/* Set a->estimate by Anderson acceleration, from the latest values and changes of a->map. */
static supine_status advance(ascent *a, supine_error *error) {
  double matrix[DEPTH * DEPTH];
  double weights[DEPTH] = {0.0};
  const size_t n = a->history;
  const int size = (int)a->size;
  for (size_t j = 0; j < n; ++j) {
    const double *r = a->residual_changes + j * a->size;
    weights[j] = cblas_ddot(size, r, 1, a->previous_residual, 1);
    for (size_t k = 0; k <= j; ++k) {
      matrix[j * n + k] = matrix[k * n + j] =
          cblas_ddot(size, r, 1, a->residual_changes + k * a->size, 1);
    }
    matrix[j * n + j] *= 1.0 + ridge;
  }
  lapack_int failed = 0;
  if (n > 0) {
    failed =
        LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', (lapack_int)n, 1, matrix, (lapack_int)n, weights, 1);
  }
  if (failed != 0) {
    (void)supine_error_set(
        error, SUPINE_ERROR_NUMERICAL,
        "no surface at full inflation was found: the iteration does not progress");
    return advise(error);
  }
  double *to = a->estimate.mesh.vertices;
  memcpy(to, a->map, a->size * sizeof *to);
  for (size_t j = 0; j < n; ++j) {
    cblas_daxpy(size, -weights[j], a->map_changes + j * a->size, 1, to, 1);
  }
  return SUPINE_OK;
}

static supine_status iterate(ascent *a, supine_error *error) {
  while (a->found->solves < SOLVES_MAX) {
    const double before = a->rms;
    const supine_status status = find_map(a, error);
    if (status == SUPINE_ERROR_NUMERICAL && a->history > 0) {
      /* The step was too long: restart from the last value of the fixed-point map. */
      a->history = 0;
      a->stored = 0;
      memcpy(a->estimate.mesh.vertices, a->previous_map, a->size * sizeof(double));
      continue;
    }
    SUPINE_TRY(status);
    if (a->rms <= converged || (a->rms <= stalled && a->rms > 0.5 * before)) {
      memcpy(a->estimate.mesh.vertices, a->map, a->size * sizeof(double));
      return SUPINE_OK;
    }
    store_differences(a);
    SUPINE_TRY(advance(a, error));
  }
  (void)supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                         "no surface at full inflation was found: after %d steps it still changes "
                         "by %s mm RMS",
                         SOLVES_MAX, supine_text_distance(a->rms).text);
  return advise(error);
}

supine_status supine_physics_reference_inflate(supine_lungs *lungs, const supine_model *model,
                                               supine_reference *found, supine_error *error) {
  SUPINE_ARENA arena = {0};
  const size_t size = 3 * lungs->mesh.vertex_count;
  ascent a = {.estimate = *lungs,
              .scan = *lungs,
              .model = *model,
              .found = found,
              .size = size,
              .map = supine_arena_take(&arena, size, sizeof(double)),
              .previous_map = supine_arena_zeros(&arena, size, sizeof(double)),
              .previous_residual = supine_arena_zeros(&arena, size, sizeof(double)),
              .map_changes = supine_arena_take(&arena, DEPTH * size, sizeof(double)),
              .residual_changes = supine_arena_take(&arena, DEPTH * size, sizeof(double))};
  free(lungs->scanned);
  lungs->scanned = a.scan.mesh.vertices = malloc(size * sizeof(double));
  if (arena.failed || lungs->scanned == NULL) {
    return supine_error_memory(error, "%zu vertices", size / 3);
  }
  a.model.share[0] = a.model.share[1] = 1.0; /* healthy lungs; collapse is applied later */
  memcpy(lungs->scanned, lungs->mesh.vertices, size * sizeof(double));
  const supine_status status = iterate(&a, error);
  supine_physics_solution_free(&a.field);
  supine_lungs_measure(lungs);
  return status == SUPINE_OK ? check_folds(&a, error) : status;
}
