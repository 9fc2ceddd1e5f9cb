/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute how far a prediction, a translation and an affine map of the lungs are from a scan. */
#include <math.h>
#include <string.h>

#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>

#include "base/arena.h"
#include "precompute/validation/validation.h"

#include "base/vec3.h"
#include "precompute/lungs/surface.h"

const char *const supine_validation_map_names[SUPINE_PATIENT_MAP_COUNT] = {"predicted", "none",
                                                                           "translation", "affine"};

enum { ROUNDS = 20, FITTED_MAX = 2000 };

/* A motion whose RMS is below this, mm, counts as none: scans and landmarks are less precise. */
static const double still = 0.05;

static void summarise(double *distances, size_t count, supine_validation_distance *of) {
  gsl_sort(distances, 1, count);
  of->mean = gsl_stats_mean(distances, 1, count);
  of->rms = sqrt(gsl_stats_tss_m(distances, 1, count, 0.0) / (double)count);
  of->p95 = gsl_stats_quantile_from_sorted_data(distances, 1, count, 0.95);
  of->largest = distances[count - 1];
}

static void explain(supine_patient_scan_motion moved,
                    supine_validation_distance distance[SUPINE_PATIENT_MAP_COUNT]) {
  const double none = distance[moved == SUPINE_PATIENT_STILL ? SUPINE_PATIENT_MAP_NONE
                                                             : SUPINE_PATIENT_MAP_TRANSLATION]
                          .rms;
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT; ++k) {
    distance[k].explained = none > still ? 1.0 - pow(distance[k].rms / none, 2.0) : NAN;
  }
}

/* Return the map to fit: `kind` or, for the basis's prediction, the body motion to remove. */
static supine_patient_map map_of(int kind, supine_patient_scan_motion moved) {
  return kind != SUPINE_PATIENT_MAP_PREDICTED  ? (supine_patient_map)kind
         : moved == SUPINE_PATIENT_RIGID       ? SUPINE_PATIENT_MAP_RIGID
         : moved == SUPINE_PATIENT_TRANSLATION ? SUPINE_PATIENT_MAP_TRANSLATION
                                               : SUPINE_PATIENT_MAP_NONE;
}

static supine_status undetermined(supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                          "the points lie in one plane: give points spread over the lungs");
}

supine_status
supine_validation_points(const supine_patient_pairs *pairs, const double *predicted,
                         const double *squares, supine_patient_scan_motion moved,
                         supine_validation_distance distance[SUPINE_PATIENT_MAP_COUNT],
                         supine_error *error) {
  SUPINE_ARENA arena = {0};
  double *space = supine_arena_take(&arena, pairs->count, sizeof *space);
  if (space == NULL) {
    return supine_error_memory(error, "%zu points", pairs->count);
  }
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT; ++k) {
    supine_patient_affinity by;
    distance[k].expected = distance[k].within = 0.0;
    const bool own = k == SUPINE_PATIENT_MAP_PREDICTED;
    const double *from = own ? predicted : pairs->from;
    if (!supine_patient_map_fit(map_of(k, moved), pairs->count, from, pairs->to, &by)) {
      return undetermined(error);
    }
    for (size_t i = 0; i < pairs->count; ++i) {
      double at[3];
      supine_patient_map_apply(&by, from + 3 * i, at);
      space[i] = supine_distance(at, pairs->to + 3 * i);
      const double square = own && squares != NULL ? fmax(0.0, squares[i]) : 0.0;
      distance[k].expected += square / (double)pairs->count;
      distance[k].within += space[i] <= 1.8 * sqrt(square) ? 1.0 / (double)pairs->count : 0.0;
    }
    distance[k].expected = sqrt(distance[k].expected);
    summarise(space, pairs->count, &distance[k]);
  }
  explain(moved, distance);
  return SUPINE_OK;
}

/* Compute statistics of the distances from the vertices of one surface to the other, both ways. */
static supine_status surface_distance(const supine_mesh *start, const double *moved,
                                      const supine_mesh *state,
                                      const supine_inside_surface *state_tree, double *nearest,
                                      supine_validation_distance *of, supine_error *error) {
  const size_t n = start->vertex_count;
  SUPINE_FREED_BY(supine_inside_surface_drop) supine_inside_surface *tree = NULL;
  SUPINE_ARENA arena = {0};
  double *space = supine_arena_take(&arena, n + state->vertex_count, sizeof *space);
  if (space == NULL) {
    return supine_error_memory(error, "%zu distances", n + state->vertex_count);
  }
  SUPINE_TRY(supine_inside_surface_create(moved, start->triangle_count, start->triangles, false,
                                          &tree, error));
  supine_inside_surface_distances(state_tree, n, moved, space, nearest);
  supine_inside_surface_distances(tree, state->vertex_count, state->vertices, space + n, NULL);
  summarise(space, n + state->vertex_count, of);
  return SUPINE_OK;
}

/* Fit a map from vertices onto a surface by iterated nearest points; apply it to all n vertices.
 * Return false if the map is undetermined. `space` holds 10 * FITTED_MAX numbers. */
static bool fit_map(supine_patient_map kind, size_t n, const double *vertices,
                    const supine_inside_surface *tree, double *space, double *moved) {
  const size_t count = n < FITTED_MAX ? n : FITTED_MAX;
  double *from = space;
  double *at = from + 3 * count;
  double *to = at + 3 * count;
  double *distance = to + 3 * count;
  supine_patient_affinity by;
  (void)supine_patient_map_fit(SUPINE_PATIENT_MAP_NONE, 0, NULL, NULL, &by);
  for (size_t i = 0; i < count; ++i) {
    memcpy(from + 3 * i, vertices + 3 * (i * n / count), 3 * sizeof(double));
  }
  for (int round = 0; round < (kind == SUPINE_PATIENT_MAP_NONE ? 0 : ROUNDS); ++round) {
    for (size_t i = 0; i < count; ++i) {
      supine_patient_map_apply(&by, from + 3 * i, at + 3 * i);
    }
    supine_inside_surface_distances(tree, count, at, distance, to);
    if (!supine_patient_map_fit(kind, count, from, to, &by)) {
      return false;
    }
  }
  for (size_t i = 0; i < n; ++i) {
    supine_patient_map_apply(&by, vertices + 3 * i, moved + 3 * i);
  }
  return true;
}

supine_status
supine_validation_surfaces(const supine_mesh *start, supine_patient_scan_motion moved,
                           double *predicted, const supine_mesh *state, double *nearest,
                           supine_validation_distance distance[SUPINE_PATIENT_MAP_COUNT],
                           supine_error *error) {
  SUPINE_FREED_BY(supine_inside_surface_drop) supine_inside_surface *tree = NULL;
  SUPINE_ARENA arena = {0};
  const size_t n = start->vertex_count;
  double *space = supine_arena_take(&arena, FITTED_MAX, 10 * sizeof *space);
  double *at = supine_arena_take(&arena, n, 3 * sizeof *at);
  if (arena.failed) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  SUPINE_TRY(supine_patient_check_boxes(start, state, error));
  SUPINE_TRY(supine_inside_surface_create(state->vertices, state->triangle_count, state->triangles,
                                          false, &tree, error));
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT; ++k) {
    const bool own = k == SUPINE_PATIENT_MAP_PREDICTED;
    SUPINE_TRY(
        fit_map(map_of(k, moved), n, own ? predicted : start->vertices, tree, space, at)
            ? surface_distance(start, at, state, tree, own ? nearest : NULL, &distance[k], error)
            : undetermined(error));
    if (own) {
      memcpy(predicted, at, 3 * n * sizeof *at);
    }
  }
  explain(moved, distance);
  return SUPINE_OK;
}
