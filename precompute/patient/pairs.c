/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read pairs of points, check that they can be two states of one chest, and fit maps to them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_statistics.h>
#include <lapacke.h>

#include "precompute/patient/pairs.h"

#include "base/arena.h"
#include "base/csv.h"
#include "base/remedy.h"
#include "base/text.h"
#include "base/vec3.h"
#include "runtime/rigid.h"

enum {
  COLUMNS = 12,
  COORDINATES = 6,
  PAIRS_LEAST = 12 /* fewer pairs are refused; an affine map needs 4 */
};

static const double flat_least = 1.0; /* points closer to a plane (RMS, mm) count as flat */
static const double displacement_least = 0.05; /* a smaller RMS displacement is refused, mm */
static const double rotation_most = 25.0;      /* a larger rotation is refused, degrees */
static const double box_overlap_least = 0.5;   /* as a share of the larger box, along each axis */
/* Largest translation, and largest residual of an affine map, between two states. Both are divided
 * by the RMS distance of the points from their mean. */
static const double apart_most = 0.5, residual_most = 0.7;

static const char *const columns[COLUMNS] = {"x",     "y",     "z",     "to_x",  "to_y",  "to_z",
                                             "im1_x", "im1_y", "im1_z", "im2_x", "im2_y", "im2_z"};

/* Find the columns of x, y and z of the first state, then of x, y and z of the second state. */
static supine_status find_columns(const supine_csv *csv, bool reverse, size_t column[COORDINATES],
                                  supine_error *error) {
  const size_t first = supine_csv_text(csv, 0) != NULL ? 0 : COORDINATES;
  /* Unless `reverse` is true, the columns im1_* hold the second state, and im2_* the first. */
  const bool swap = (first == COORDINATES) != reverse;
  for (size_t k = 0; k < COORDINATES; ++k) {
    column[k] = first + (swap ? (k + 3) % COORDINATES : k);
    SUPINE_REFUSE_IF(supine_csv_text(csv, first + k) == NULL, error, SUPINE_ERROR_FORMAT,
                     "%s:%zu: the header has no column \"%s\"; expected x,y,z,to_x,to_y,to_z or "
                     "im1_x,im1_y,im1_z,im2_x,im2_y,im2_z",
                     csv->path, csv->line, columns[first + k]);
  }
  return SUPINE_OK;
}

static supine_status read_rows(supine_csv *csv, bool reverse, supine_patient_pairs *pairs,
                               supine_error *error) {
  size_t capacity = 0;
  size_t column[COORDINATES];
  bool more = true;
  SUPINE_TRY(find_columns(csv, reverse, column, error));
  for (;;) {
    SUPINE_TRY(supine_csv_next(csv, &more, error));
    if (!more) {
      break;
    }
    if (pairs->count == capacity) {
      capacity = capacity == 0 ? 512 : 2 * capacity;
      double *from = realloc(pairs->from, 3 * capacity * sizeof *from);
      pairs->from = from != NULL ? from : pairs->from;
      double *to = realloc(pairs->to, 3 * capacity * sizeof *to);
      pairs->to = to != NULL ? to : pairs->to;
      if (from == NULL || to == NULL) {
        return supine_error_memory(error, "%zu points", capacity);
      }
    }
    for (size_t k = 0; k < COORDINATES; ++k) {
      double *point = (k < 3 ? pairs->from : pairs->to) + 3 * pairs->count;
      SUPINE_TRY(supine_csv_number(csv, column[k], columns[column[k]], &point[k % 3], error));
    }
    ++pairs->count;
  }
  SUPINE_REFUSE_IF(pairs->count == 0, error, SUPINE_ERROR_FORMAT,
                   "%s: no pairs of points: give one pair in each line", csv->path);
  return SUPINE_OK;
}

supine_status supine_patient_pairs_load(const char *path, bool reverse, supine_patient_pairs *pairs,
                                        supine_error *error) {
  supine_csv csv;
  SUPINE_TRY(supine_csv_open(path, columns, COLUMNS, 0, &csv, error));
  const supine_status status = read_rows(&csv, reverse, pairs, error);
  supine_csv_close(&csv);
  if (status != SUPINE_OK) {
    supine_patient_pairs_free(pairs);
  }
  return status;
}

void supine_patient_pairs_free(supine_patient_pairs *pairs) {
  free(pairs->from);
  free(pairs->to);
  free(pairs->side);
  *pairs = (supine_patient_pairs){0};
}

supine_status supine_patient_pairs_thin(supine_patient_pairs *pairs, size_t most,
                                        supine_error *error) {
  const size_t n = pairs->count;
  if (n <= most) {
    return SUPINE_OK;
  }
  SUPINE_ARENA arena = {0};
  double *apart = supine_arena_take(&arena, n, sizeof *apart); /* from the chosen; -1: chosen */
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu pairs of points", n));
  for (size_t i = 0; i < n; ++i) {
    apart[i] = INFINITY;
  }
  size_t next = 0;
  for (size_t chosen = 0; chosen < most; ++chosen) {
    const size_t last = next;
    apart[last] = -1.0;
    next = 0;
    for (size_t i = 0; i < n; ++i) {
      apart[i] = fmin(apart[i], supine_distance(pairs->from + 3 * i, pairs->from + 3 * last));
      next = apart[i] > apart[next] ? i : next;
    }
  }
  size_t kept = 0;
  for (size_t i = 0; i < n; ++i) {
    if (apart[i] < 0.0) {
      memmove(pairs->from + 3 * kept, pairs->from + 3 * i, 3 * sizeof *pairs->from);
      memmove(pairs->to + 3 * kept, pairs->to + 3 * i, 3 * sizeof *pairs->to);
      if (pairs->side != NULL) {
        pairs->side[kept] = pairs->side[i];
      }
      ++kept;
    }
  }
  pairs->count = kept;
  return SUPINE_OK;
}

void supine_patient_map_apply(const supine_patient_affinity *map, const double from[3],
                              double to[3]) {
  for (int a = 0; a < 3; ++a) {
    to[a] = map->t[a] + supine_dot(map->m + 3 * a, from);
  }
}

bool supine_patient_map_fit(supine_patient_map kind, size_t count, const double *from,
                            const double *to, supine_patient_affinity *map) {
  double mean[2][3] = {{0.0}};
  double cross[3][3] = {{0.0}};   /* [a][b] sum of (from[a] - mean) (to[b] - mean) */
  double scatter[3][3] = {{0.0}}; /* [a][b] sum of (from[a] - mean) (from[b] - mean) */
  double mapped[3];
  bool determined = true;
  *map = (supine_patient_affinity){.m = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}};
  if (kind == SUPINE_PATIENT_MAP_NONE) {
    return true;
  }
  for (size_t k = 0; k < 3; ++k) {
    mean[0][k] = gsl_stats_mean(from + k, 3, count);
    mean[1][k] = gsl_stats_mean(to + k, 3, count);
  }
  for (size_t i = 0; i < 9 * count; ++i) {
    const size_t a = i % 9 / 3;
    const size_t b = i % 3;
    const double at = from[i / 9 * 3 + a] - mean[0][a];
    cross[a][b] += at * (to[i / 9 * 3 + b] - mean[1][b]);
    scatter[a][b] += at * (from[i / 9 * 3 + b] - mean[0][b]);
  }
  if (kind == SUPINE_PATIENT_MAP_RIGID) {
    supine_rigid_rotation((const double(*)[3])cross, map->m);
  } else if (kind == SUPINE_PATIENT_MAP_AFFINE) {
    for (size_t k = 0; k < 9; ++k) { /* column-major, because LAPACKE copies row-major matrices */
      map->m[k] = cross[k % 3][k / 3];
    }
    determined = LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', 3, 3, scatter[0], 3, map->m, 3) == 0;
    /* Element (k, k) of the Cholesky factor is sqrt(count) times the RMS residual of coordinate k
     * after a linear fit to coordinates 0 to k - 1. */
    for (size_t k = 0; k < 3; ++k) {
      determined = determined && scatter[k][k] >= flat_least * sqrt((double)count);
    }
  }
  supine_patient_map_apply(map, mean[0], mapped);
  for (size_t k = 0; k < 3; ++k) {
    map->t[k] = mean[1][k] - mapped[k];
  }
  return determined;
}

double supine_patient_pairs_growth(const supine_patient_pairs *pairs) {
  supine_patient_affinity map;
  const bool found =
      supine_patient_map_fit(SUPINE_PATIENT_MAP_AFFINE, pairs->count, pairs->from, pairs->to, &map);
  const double growth = supine_triple(map.m, map.m + 3, map.m + 6);
  return found && growth > 0.0 ? growth : 1.0;
}

typedef struct summary {
  double spread[2];    /* RMS distance of each state's points from their mean, mm */
  double size[2];      /* longest side of the bounding box of each state's points, mm */
  double translation;  /* distance between the mean points of the two states, mm */
  double rotation;     /* angle of the best-fitting rotation, degrees */
  bool flat;           /* whether the points of the first state lie in a plane */
  double growth;       /* determinant of the best-fitting affine map, negative for a reflection */
  double residual;     /* RMS residual of the best-fitting affine map, mm */
  double displacement; /* RMS displacement, mm; its mean is subtracted if the body may have moved */
} summary;

static summary measure(const supine_patient_pairs *pairs, bool scans_moved) {
  const size_t n = pairs->count;
  supine_patient_affinity mean;
  supine_patient_affinity map;
  summary s = {.flat = false};
  for (size_t i = 0; i < 6; ++i) {
    const double *points = (i < 3 ? pairs->from : pairs->to) + i % 3;
    double low;
    double high;
    gsl_stats_minmax(&low, &high, points, 3, n);
    s.size[i / 3] = fmax(s.size[i / 3], high - low);
    s.spread[i / 3] = hypot(s.spread[i / 3], sqrt(gsl_stats_tss(points, 3, n) / (double)n));
  }
  (void)supine_patient_map_fit(SUPINE_PATIENT_MAP_TRANSLATION, n, pairs->from, pairs->to, &mean);
  s.translation = supine_length(mean.t);
  (void)supine_patient_map_fit(SUPINE_PATIENT_MAP_RIGID, n, pairs->from, pairs->to, &map);
  s.rotation = acos(fmin(1.0, fmax(-1.0, 0.5 * (map.m[0] + map.m[4] + map.m[8] - 1.0)))) * 180.0 /
               3.14159265358979323846;
  s.flat = !supine_patient_map_fit(SUPINE_PATIENT_MAP_AFFINE, n, pairs->from, pairs->to, &map);
  s.growth = supine_triple(map.m, map.m + 3, map.m + 6);
  for (size_t i = 0; i < n; ++i) {
    double at[3];
    supine_patient_map_apply(&map, pairs->from + 3 * i, at);
    for (size_t k = 0; k < 3; ++k) {
      const double u =
          pairs->to[3 * i + k] - pairs->from[3 * i + k] - (scans_moved ? mean.t[k] : 0.0);
      s.residual += pow(pairs->to[3 * i + k] - at[k], 2.0) / (double)n;
      s.displacement += u * u / (double)n;
    }
  }
  s.residual = sqrt(s.residual);
  s.displacement = sqrt(s.displacement);
  return s;
}

supine_status supine_patient_pairs_check(const supine_patient_pairs *pairs, bool scans_moved,
                                         supine_error *error) {
  SUPINE_REFUSE_IF(
      pairs->count < PAIRS_LEAST, error, SUPINE_ERROR_FORMAT,
      "pairs of points: %zu, but at least %d are needed, spread over the lungs: add more pairs",
      pairs->count, PAIRS_LEAST);
  const summary s = measure(pairs, scans_moved);
  for (int state = 0; state < 2; ++state) {
    const char *unit = NULL;
    const bool likely = supine_mesh_unit_is_likely(s.size[state], &unit);
    SUPINE_REFUSE_IF(!likely, error, SUPINE_ERROR_FORMAT,
                     "the points %s extend over %.3g mm, which is too small or too large for "
                     "lungs%s%s: give landmarks in mm, spread over the lungs",
                     state == 0 ? "of the first state" : "of the second state", s.size[state],
                     unit == NULL ? "" : "; the unit may be ", unit == NULL ? "" : unit);
  }
  SUPINE_REFUSE_IF(s.flat, error, SUPINE_ERROR_FORMAT,
                   "all points lie in one plane: give landmarks spread over the lungs");
  SUPINE_REFUSE_IF(s.residual > residual_most * s.spread[1], error, SUPINE_ERROR_FORMAT,
                   "the points of the two states do not match (%.0f mm RMS remain after an affine "
                   "map): check that both lists are in the same order",
                   s.residual);
  SUPINE_REFUSE_IF(s.growth < 0.0 || s.rotation > rotation_most, error, SUPINE_ERROR_FORMAT,
                   "the two states differ by %sa rotation of %.0f degrees: give both in LPS axes "
                   "(x to the left, y to the back, z to the head)",
                   s.growth < 0.0 ? "a reflection and " : "", s.rotation);
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_set("translation", ""),
                                                     supine_remedy_set("rigid", "")};
  SUPINE_REFUSE_ADVISE(
      !scans_moved && s.translation > apart_most * s.spread[0], error, advice, SUPINE_ERROR_FORMAT,
      "the centres of the two states are %.0f mm apart: give all points in one coordinate frame, "
      "or fit the motion between the scans",
      s.translation);
  SUPINE_REFUSE_IF(
      s.displacement < displacement_least, error, SUPINE_ERROR_FORMAT,
      "the points do not move between the states (%s mm RMS%s): give two different states",
      supine_text_distance(s.displacement).text, scans_moved ? " after a translation" : "");
  return SUPINE_OK;
}

supine_status supine_patient_check_boxes(const supine_mesh *first, const supine_mesh *second,
                                         supine_error *error) {
  double low[2][3];
  double high[2][3];
  supine_mesh_box(first, low[0], high[0]);
  supine_mesh_box(second, low[1], high[1]);
  for (int k = 0; k < 3; ++k) {
    const double larger = fmax(high[0][k] - low[0][k], high[1][k] - low[1][k]);
    const double overlap = fmin(high[0][k], high[1][k]) - fmax(low[0][k], low[1][k]);
    SUPINE_REFUSE_IF(!(overlap >= box_overlap_least * larger), error, SUPINE_ERROR_MESH,
                     "the two surfaces overlap too little along %c (%.0f to %.0f and %.0f to %.0f "
                     "mm): check that both show the same lungs in one coordinate frame and unit",
                     "xyz"[k], low[0][k], high[0][k], low[1][k], high[1][k]);
  }
  return SUPINE_OK;
}
