/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare a prediction with another state of the same lungs. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>
#include <lapacke.h>

#include "precompute/patient/validate.h"

#include "precompute/inside/surface.h"
#include "sh/base/vec3.h"

const char *const supine_patient_map_names[SUPINE_PATIENT_MAP_COUNT] = {
    "predicted", "none", "translation", "rigid+scale", "affine"};

enum { ROUNDS = 20, FITTED_MAX = 2000 };

/* x -> m x + t, row by row. */
typedef struct map {
  double m[9], t[3];
} map;

static void apply(const map *by, const double *from, double *to) {
  for (int a = 0; a < 3; ++a) {
    to[a] =
        by->t[a] + by->m[3 * a] * from[0] + by->m[3 * a + 1] * from[1] + by->m[3 * a + 2] * from[2];
  }
}

/* RMS motion, mm, below which nothing moved: landmarks and surfaces are less precise. */
static const double still = 0.05;

/* A similarity with scale 1, not among the maps that are reported. */
static const supine_patient_map rigid = SUPINE_PATIENT_MAP_COUNT;

/* Rotation and scale from the cross moments K = U S V^T: R = U V^T, with the last column of U
 * negated if R would mirror; the scale is tr(S) over the spread, or 1 if that is 0. */
static bool similarity(double cross[9], double spread, double m[9]) {
  double s[3];
  double u[9];
  double vt[9];
  if (LAPACKE_dgesdd(LAPACK_ROW_MAJOR, 'A', 3, 3, cross, 3, s, u, 3, vt, 3) != 0) {
    return false;
  }
  if (supine_triple(u, u + 3, u + 6) * supine_triple(vt, vt + 3, vt + 6) < 0.0) {
    cblas_dscal(3, -1.0, u + 2, 3);
    s[2] = -s[2];
  }
  const double scale = spread > 0.0 ? (s[0] + s[1] + s[2]) / spread : 1.0;
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, 3, 3, 3, scale, u, 3, vt, 3, 0.0, m, 3);
  return true;
}

/* Fit the map of a kind that brings points nearest to others, in least squares. */
static bool fit_map(supine_patient_map kind, size_t count, const double *from, const double *to,
                    map *found) {
  double mean[2][3] = {{0.0}};
  double cross[9] = {0.0};
  double scatter[9] = {0.0};
  *found = (map){.m = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}};
  if (kind == SUPINE_PATIENT_MAP_NONE) {
    return true;
  }
  for (size_t i = 0; i < 3 * count; ++i) {
    mean[0][i % 3] += from[i] / (double)count;
    mean[1][i % 3] += to[i] / (double)count;
  }
  for (size_t i = 0; i < count; ++i) {
    for (size_t a = 0; a < 3; ++a) {
      for (size_t b = 0; b < 3; ++b) {
        const double at = from[3 * i + b] - mean[0][b];
        cross[3 * a + b] += (to[3 * i + a] - mean[1][a]) * at;
        scatter[3 * a + b] += (from[3 * i + a] - mean[0][a]) * at;
      }
    }
  }
  bool right = true;
  if (kind == SUPINE_PATIENT_MAP_SIMILARITY || kind == rigid) {
    const double spread = scatter[0] + scatter[4] + scatter[8];
    right = similarity(cross, kind == rigid ? 0.0 : spread, found->m);
  } else if (kind == SUPINE_PATIENT_MAP_AFFINE) {
    /* In column-major order the right-hand sides are the rows of the map. */
    right = LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', 3, 3, scatter, 3, cross, 3) == 0;
    memcpy(found->m, cross, sizeof cross);
  }
  double moved[3];
  apply(found, mean[0], moved);
  for (int a = 0; a < 3; ++a) {
    found->t[a] = mean[1][a] - moved[a];
  }
  return right;
}

static void summarise(double *distances, size_t count, supine_patient_distance *of) {
  gsl_sort(distances, 1, count);
  of->mean = gsl_stats_mean(distances, 1, count);
  of->rms = 0.0;
  for (size_t i = 0; i < count; ++i) {
    of->rms += distances[i] * distances[i] / (double)count;
  }
  of->rms = sqrt(of->rms);
  of->p95 = gsl_stats_quantile_from_sorted_data(distances, 1, count, 0.95);
  of->largest = distances[count - 1];
}

static void explain(supine_patient_moved moved,
                    supine_patient_distance distance[SUPINE_PATIENT_MAP_COUNT]) {
  const double none = distance[moved == SUPINE_PATIENT_STILL ? SUPINE_PATIENT_MAP_NONE
                                                             : SUPINE_PATIENT_MAP_TRANSLATION]
                          .rms;
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT; ++k) {
    distance[k].explained = none > still ? 1.0 - pow(distance[k].rms / none, 2.0) : NAN;
  }
}

/* Give the map that removes a motion between the scans. */
static supine_patient_map map_of(supine_patient_moved moved) {
  return moved == SUPINE_PATIENT_RIGID         ? rigid
         : moved == SUPINE_PATIENT_TRANSLATION ? SUPINE_PATIENT_MAP_TRANSLATION
                                               : SUPINE_PATIENT_MAP_NONE;
}

supine_status supine_patient_validate_points(
    const supine_patient_pairs *pairs, const double *predicted, supine_patient_moved moved,
    supine_patient_distance distance[SUPINE_PATIENT_MAP_COUNT], supine_error *error) {
  double *space = malloc(pairs->count * sizeof *space);
  if (space == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu points", pairs->count);
  }
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT; ++k) {
    map by;
    const bool own = k == SUPINE_PATIENT_MAP_PREDICTED;
    const double *from = own ? predicted : pairs->from;
    if (!fit_map(own ? map_of(moved) : (supine_patient_map)k, pairs->count, from, pairs->to, &by)) {
      free(space);
      return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                              "the points do not determine a map of kind '%s': they lie in one "
                              "plane, or memory is short",
                              own ? "rigid" : supine_patient_map_names[k]);
    }
    for (size_t i = 0; i < pairs->count; ++i) {
      double at[3];
      const double *to = pairs->to + 3 * i;
      apply(&by, from + 3 * i, at);
      space[i] = sqrt(pow(at[0] - to[0], 2.0) + pow(at[1] - to[1], 2.0) + pow(at[2] - to[2], 2.0));
    }
    summarise(space, pairs->count, &distance[k]);
  }
  explain(moved, distance);
  free(space);
  return SUPINE_OK;
}

/* --- surfaces -------------------------------------------------------------------------------- */

/* Pool the distances in both directions. */
static supine_status surface_distance(const supine_mesh *rest, const double *moved,
                                      const supine_mesh *state,
                                      const supine_inside_surface *state_tree, double *nearest,
                                      supine_patient_distance *of, supine_error *error) {
  const size_t n = rest->vertex_count;
  supine_inside_surface *tree = NULL;
  double *space = malloc((n + state->vertex_count) * sizeof *space);
  supine_status status =
      space == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for distances")
                    : supine_inside_surface_create(moved, rest->triangle_count, rest->triangles,
                                                   &tree, error);
  if (status == SUPINE_OK) {
    supine_inside_surface_distances(state_tree, n, moved, space, nearest);
    supine_inside_surface_distances(tree, state->vertex_count, state->vertices, space + n, NULL);
    summarise(space, n + state->vertex_count, of);
  }
  supine_inside_surface_destroy(tree);
  free(space);
  return status;
}

/* Fit the map of a kind to surfaces by iterated nearest points. */
static bool settle(supine_patient_map kind, size_t n, const double *vertices,
                   const supine_inside_surface *tree, double *space, double *moved) {
  const size_t count = n < FITTED_MAX ? n : FITTED_MAX;
  double *from = space;
  double *at = from + 3 * count;
  double *to = at + 3 * count;
  double *distance = to + 3 * count;
  map by = {.m = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}};
  for (size_t i = 0; i < count; ++i) {
    memcpy(from + 3 * i, vertices + 3 * (i * n / count), 3 * sizeof(double));
  }
  for (int round = 0; round < (kind == SUPINE_PATIENT_MAP_NONE ? 0 : ROUNDS); ++round) {
    for (size_t i = 0; i < count; ++i) {
      apply(&by, from + 3 * i, at + 3 * i);
    }
    supine_inside_surface_distances(tree, count, at, distance, to);
    if (!fit_map(kind, count, from, to, &by)) {
      return false;
    }
  }
  for (size_t i = 0; i < n; ++i) {
    apply(&by, vertices + 3 * i, moved + 3 * i);
  }
  return true;
}

static supine_status check_overlap(const supine_mesh *rest, const supine_mesh *state,
                                   supine_error *error) {
  double low[2][3];
  double high[2][3];
  supine_mesh_box(rest, low[0], high[0]);
  supine_mesh_box(state, low[1], high[1]);
  for (int k = 0; k < 3; ++k) {
    if (fmin(high[0][k], high[1][k]) <= fmax(low[0][k], low[1][k])) {
      return supine_error_set(error, SUPINE_ERROR_MESH,
                              "the two surfaces do not overlap along %c (%.0f to %.0f and %.0f to "
                              "%.0f mm): check that frames, units and sides are the same",
                              "xyz"[k], low[0][k], high[0][k], low[1][k], high[1][k]);
    }
  }
  return SUPINE_OK;
}

supine_status
supine_patient_validate_surface(const supine_mesh *rest, supine_patient_moved moved,
                                double *predicted, const supine_mesh *state, double *nearest,
                                supine_patient_distance distance[SUPINE_PATIENT_MAP_COUNT],
                                supine_error *error) {
  supine_inside_surface *tree = NULL;
  double *space = malloc(10 * (size_t)FITTED_MAX * sizeof *space);
  const size_t n = rest->vertex_count;
  double *at = malloc(3 * n * sizeof *at);
  supine_status status = check_overlap(rest, state, error);
  if (status == SUPINE_OK && (space == NULL || at == NULL)) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices",
                              rest->vertex_count);
  }
  if (status == SUPINE_OK) {
    status = supine_inside_surface_create(state->vertices, state->triangle_count, state->triangles,
                                          &tree, error);
  }
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT && status == SUPINE_OK; ++k) {
    const bool own = k == SUPINE_PATIENT_MAP_PREDICTED;
    if (!settle(own ? map_of(moved) : (supine_patient_map)k, n, own ? predicted : rest->vertices,
                tree, space, at)) {
      status =
          supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                           "the surface does not determine a map of kind '%s', or memory is short",
                           own ? "rigid" : supine_patient_map_names[k]);
    } else {
      status = surface_distance(rest, at, state, tree, own ? nearest : NULL, &distance[k], error);
    }
    if (own && status == SUPINE_OK) {
      memcpy(predicted, at, 3 * n * sizeof *at);
    }
  }
  if (status == SUPINE_OK) {
    explain(moved, distance);
  }
  supine_inside_surface_destroy(tree);
  free(space);
  free(at);
  return status;
}
