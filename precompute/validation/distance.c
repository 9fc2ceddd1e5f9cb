/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute how far a prediction, a translation and an affine map of the lungs are from a scan. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>

#include "precompute/validation/validation.h"

#include "base/arena.h"
#include "base/vec3.h"
#include "precompute/lungs/surface.h"

const char *const supine_validation_map_names[SUPINE_PATIENT_MAP_COUNT] = {"predicted", "none",
                                                                           "translation", "affine"};

/* SAMPLED_MAX: most vertices of a surface from which distances of the fitted maps are measured. */
enum { ROUNDS = 20, FITTED_MAX = 2000, SAMPLED_MAX = 20000 };

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
  if (kind != SUPINE_PATIENT_MAP_PREDICTED) {
    return (supine_patient_map)kind;
  }
  switch (moved) {
  case SUPINE_PATIENT_RIGID:
    return SUPINE_PATIENT_MAP_RIGID;
  case SUPINE_PATIENT_TRANSLATION:
    return SUPINE_PATIENT_MAP_TRANSLATION;
  default:
    return SUPINE_PATIENT_MAP_NONE;
  }
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
  double *space = malloc(pairs->count * sizeof *space);
  SUPINE_REFUSE_IF(space == NULL, error, SUPINE_ERROR_MEMORY, "no memory for %zu points",
                   pairs->count);
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT; ++k) {
    supine_patient_affinity by;
    distance[k].expected = distance[k].within = 0.0;
    const bool own = k == SUPINE_PATIENT_MAP_PREDICTED;
    const double *from = own ? predicted : pairs->from;
    if (!supine_patient_map_fit(map_of(k, moved), pairs->count, from, pairs->to, &by)) {
      free(space);
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
  free(space);
  return SUPINE_OK;
}

/* Copy `count` of n points, evenly spread over their indices. */
static void sample(size_t n, const double *points, size_t count, double *chosen) {
  for (size_t i = 0; i < count; ++i) {
    memcpy(chosen + 3 * i, points + 3 * (i * n / count), 3 * sizeof(double));
  }
}

static size_t at_most(size_t count, size_t most) {
  return count < most ? count : most;
}

/* Two surfaces with their trees, and work space for 4 numbers per vertex of both. */
typedef struct surfaces {
  size_t count;
  double *moved; /* [count, 3] vertices of the first surface, mm */
  const supine_mesh *state;
  supine_lungs_surface *tree, *state_tree;
  double *space;
} surfaces;

/* Compute statistics of the distances from the vertices of one surface to the other, both ways.
 * @param nearest  as supine_validation_surfaces, for all vertices; NULL to sample an equal
 * share of the vertices of both */
static void surface_distance(const surfaces *s, double *nearest, supine_validation_distance *of) {
  const size_t total = s->state->vertex_count;
  const size_t larger = s->count > total ? s->count : total;
  const size_t most = nearest != NULL ? larger : at_most(larger, SAMPLED_MAX);
  const size_t n = (s->count * most + larger - 1) / larger;
  const size_t m = (total * most + larger - 1) / larger;
  double *distance = s->space;
  double *points = distance + n + m;
  sample(s->count, s->moved, n, points);
  supine_lungs_surface_distances(s->state_tree, n, points, distance, nearest);
  sample(total, s->state->vertices, m, points);
  supine_lungs_surface_refit(s->tree);
  supine_lungs_surface_distances(s->tree, m, points, distance + n, NULL);
  summarise(distance, n + m, of);
}

/* Fit a map from vertices onto a surface by iterated nearest points; apply it to all n vertices.
 * Return false if the map is undetermined. `space` holds 10 * FITTED_MAX numbers. */
static bool fit_map(supine_patient_map kind, size_t n, const double *vertices,
                    const supine_lungs_surface *tree, double *space, double *moved) {
  const size_t count = at_most(n, FITTED_MAX);
  double *from = space;
  double *at = from + 3 * count;
  double *to = at + 3 * count;
  double *distance = to + 3 * count;
  supine_patient_affinity by;
  (void)supine_patient_map_fit(SUPINE_PATIENT_MAP_NONE, 0, NULL, NULL, &by);
  sample(n, vertices, count, from);
  for (int round = 0; round < (kind == SUPINE_PATIENT_MAP_NONE ? 0 : ROUNDS); ++round) {
    for (size_t i = 0; i < count; ++i) {
      supine_patient_map_apply(&by, from + 3 * i, at + 3 * i);
    }
    supine_lungs_surface_distances(tree, count, at, distance, to);
    if (!supine_patient_map_fit(kind, count, from, to, &by)) {
      return false;
    }
  }
  for (size_t i = 0; i < n; ++i) {
    supine_patient_map_apply(&by, vertices + 3 * i, moved + 3 * i);
  }
  return true;
}

/* Build the trees of both surfaces, fit all maps and measure their distances; see
 * supine_validation_surfaces. */
static supine_status compare(surfaces *s, const supine_mesh *start,
                             supine_patient_scan_motion moved, double *predicted, double *nearest,
                             supine_validation_distance *distance, supine_error *error) {
  const supine_mesh *state = s->state;
  const size_t bytes = 3 * s->count * sizeof(double);
  memcpy(s->moved, predicted, bytes);
  SUPINE_TRY(supine_lungs_surface_create(state->vertices, state->triangle_count, state->triangles,
                                         false, &s->state_tree, error));
  SUPINE_TRY(supine_lungs_surface_create(s->moved, start->triangle_count, start->triangles, false,
                                         &s->tree, error));
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT; ++k) {
    const bool own = k == SUPINE_PATIENT_MAP_PREDICTED;
    if (!fit_map(map_of(k, moved), s->count, own ? predicted : start->vertices, s->state_tree,
                 s->space, s->moved)) {
      return undetermined(error);
    }
    surface_distance(s, own ? nearest : NULL, &distance[k]);
    if (own) {
      memcpy(predicted, s->moved, bytes);
    }
  }
  explain(moved, distance);
  return SUPINE_OK;
}

supine_status
supine_validation_surfaces(const supine_mesh *start, supine_patient_scan_motion moved,
                           double *predicted, const supine_mesh *state, double *nearest,
                           supine_validation_distance distance[SUPINE_PATIENT_MAP_COUNT],
                           supine_error *error) {
  SUPINE_ARENA arena = {0};
  const size_t n = start->vertex_count;
  const size_t numbers = 10 * (size_t)FITTED_MAX + 4 * (n + state->vertex_count);
  surfaces s = {.count = n,
                .moved = supine_arena_take(&arena, 3 * n, sizeof(double)),
                .state = state,
                .space = supine_arena_take(&arena, numbers, sizeof(double))};
  SUPINE_TRY(supine_patient_check_boxes(start, state, error));
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  const supine_status status = compare(&s, start, moved, predicted, nearest, distance, error);
  supine_lungs_surface_destroy(s.state_tree);
  supine_lungs_surface_destroy(s.tree);
  return status;
}
