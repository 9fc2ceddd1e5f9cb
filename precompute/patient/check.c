/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Check whether pairs of points can be two states of one chest. */
#include <math.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "precompute/patient/pairs.h"

#include "mesh/mesh.h"
#include "sh/base/vec3.h"

enum { PAIRS_LEAST = 12 };            /* an affine map needs 4 pairs; three times that */
static const double flattest = 1.0;   /* least RMS distance from the best-fitting plane, mm */
static const double stillest = 0.05;  /* least RMS motion, mm: below the precision of a landmark */
static const double size_most = 2.0;  /* largest ratio of sizes: a full breath gives 1.4 */
static const double turn_most = 25.0; /* largest rotation between two scans, degrees */
static const double apart_most = 0.5; /* largest distance of the states over the points' spread */
static const double unmatched = 0.7;  /* largest residual of the affine map over the spread */

typedef struct summary {
  double mean[2][3];
  double spread[2]; /* RMS distance from the mean, mm */
  double side[2];   /* longest side of the box, mm */
  double thinnest;  /* RMS distance of the first points from their best-fitting plane, mm */
  double turn;      /* rotation in the best affine map, degrees */
  double left;      /* RMS residual of that map, mm */
  double growth;    /* determinant of that map; 0: none was found */
  bool mirrored;
} summary;

static void measure(const supine_patient_pairs *pairs, summary *s) {
  for (int state = 0; state < 2; ++state) {
    const double *points = state == 0 ? pairs->from : pairs->to;
    double low[3] = {INFINITY, INFINITY, INFINITY};
    double high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * pairs->count; ++i) {
      s->mean[state][i % 3] += points[i] / (double)pairs->count;
      low[i % 3] = fmin(low[i % 3], points[i]);
      high[i % 3] = fmax(high[i % 3], points[i]);
    }
    for (size_t i = 0; i < 3 * pairs->count; ++i) {
      s->spread[state] += pow(points[i] - s->mean[state][i % 3], 2.0) / (double)pairs->count;
    }
    s->spread[state] = sqrt(s->spread[state]);
    for (int k = 0; k < 3; ++k) {
      s->side[state] = fmax(s->side[state], high[k] - low[k]);
    }
  }
}

static double second_moment(const supine_patient_pairs *pairs, const summary *s, int first,
                            size_t a, int second, size_t b) {
  double sum = 0.0;
  const double *p = first == 0 ? pairs->from : pairs->to;
  const double *q = second == 0 ? pairs->from : pairs->to;
  for (size_t i = 0; i < pairs->count; ++i) {
    sum += (p[3 * i + a] - s->mean[first][a]) * (q[3 * i + b] - s->mean[second][b]);
  }
  return sum / (double)pairs->count;
}

/* Fit the affine map by least squares, and find its rotation: U V^T of M = U S V^T. */
static supine_status find_map(const supine_patient_pairs *pairs, summary *s) {
  double covariance[9];
  double decomposed[9];
  double cross[9];
  double map[9];
  double width[3];
  double u[9];
  double vt[9];
  double rotation[9];
  for (size_t a = 0; a < 3; ++a) {
    for (size_t b = 0; b < 3; ++b) {
      covariance[3 * a + b] = second_moment(pairs, s, 0, a, 0, b);
      cross[3 * a + b] = second_moment(pairs, s, 1, a, 0, b); /* row a: to_a against from */
    }
  }
  memcpy(decomposed, covariance, sizeof covariance);
  memcpy(map, cross, sizeof cross);
  if (LAPACKE_dsyev(LAPACK_ROW_MAJOR, 'N', 'L', 3, decomposed, 3, width) != 0) {
    return SUPINE_ERROR_NUMERICAL;
  }
  s->thinnest = sqrt(fmax(0.0, width[0]));
  if (s->thinnest < flattest) {
    return SUPINE_OK; /* the caller reports it */
  }
  /* In column-major order the right-hand sides are the rows of the map. */
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', 3, 3, covariance, 3, map, 3) != 0) {
    return SUPINE_ERROR_NUMERICAL;
  }
  s->growth = supine_triple(map, map + 3, map + 6);
  s->left = sqrt(fmax(0.0, s->spread[1] * s->spread[1] - cblas_ddot(9, cross, 1, map, 1)));
  if (LAPACKE_dgesdd(LAPACK_ROW_MAJOR, 'A', 3, 3, map, 3, width, u, 3, vt, 3) != 0) {
    return SUPINE_ERROR_NUMERICAL;
  }
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, 3, 3, 3, 1.0, u, 3, vt, 3, 0.0, rotation,
              3);
  const double trace = rotation[0] + rotation[4] + rotation[8];
  s->mirrored = supine_triple(rotation, rotation + 3, rotation + 6) < 0.0;
  s->turn = acos(fmin(1.0, fmax(-1.0, 0.5 * (trace - 1.0)))) * 180.0 / 3.14159265358979323846;
  return SUPINE_OK;
}

double supine_patient_pairs_growth(const supine_patient_pairs *pairs) {
  summary s = {0};
  measure(pairs, &s);
  return find_map(pairs, &s) == SUPINE_OK && s.growth > 0.0 ? s.growth : 1.0;
}

/* Find the RMS motion, mm; less its mean where a translation between scans is allowed. */
static double motion(const supine_patient_pairs *pairs, const summary *s, bool moved) {
  double sum = 0.0;
  for (size_t i = 0; i < 3 * pairs->count; ++i) {
    const double shift = moved ? s->mean[1][i % 3] - s->mean[0][i % 3] : 0.0;
    sum += pow(pairs->to[i] - pairs->from[i] - shift, 2.0);
  }
  return sqrt(sum / (double)pairs->count);
}

/* Over 60 lines: a sequence of independent checks, each with its message. */
supine_status supine_patient_pairs_check(const supine_patient_pairs *pairs, bool moved,
                                         supine_error *error) {
  summary s = {0};
  if (pairs->count < PAIRS_LEAST) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%zu pairs of points determine no law: give at least %d, spread over "
                            "both lungs",
                            pairs->count, PAIRS_LEAST);
  }
  measure(pairs, &s);
  for (int state = 0; state < 2; ++state) {
    const char *unit = NULL;
    if (!supine_mesh_unit_is_likely(s.side[state], &unit)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "the points %s extend over %.3g: no lung in mm%s%s; landmarks are in "
                              "mm, spread over the lungs",
                              state == 0 ? "at rest" : "of the other state", s.side[state],
                              unit == NULL ? "" : ", but one in ", unit == NULL ? "" : unit);
    }
  }
  const double size = s.spread[1] / s.spread[0];
  if (size > size_most || size < 1.0 / size_most) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "the other state is %.3g times as large as rest: are both in mm?",
                            size);
  }
  if (find_map(pairs, &s) != SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL, "no affine map fits the points");
  }
  if (s.thinnest < flattest) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "all points lie within %.2g mm of one plane: landmarks must spread "
                            "over the lungs",
                            s.thinnest);
  }
  if (s.left > unmatched * s.spread[1]) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "the pairs do not match: the best affine map leaves %.0f mm RMS; are "
                            "both lists in the same order?",
                            s.left);
  }
  if (s.mirrored) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "one state is the mirror image of the other: one of them has an axis "
                            "reversed (landmarks are LPS: x to the left, y to the back, z to the "
                            "head)");
  }
  if (s.turn > turn_most) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "one state is turned by %.0f degrees against the other: they are in "
                            "different axes (landmarks are LPS: x to the left, y to the back, z "
                            "to the head)",
                            s.turn);
  }
  const double apart =
      sqrt(pow(s.mean[1][0] - s.mean[0][0], 2.0) + pow(s.mean[1][1] - s.mean[0][1], 2.0) +
           pow(s.mean[1][2] - s.mean[0][2], 2.0));
  if (!moved && apart > apart_most * s.spread[0]) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "the two states are %.0f mm apart: different frames? --translation or "
                            "--rigid finds the motion between two scans",
                            apart);
  }
  const double distance = motion(pairs, &s, moved);
  if (distance < stillest) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "the other state is the same as rest (%.2g mm RMS%s): there is "
                            "nothing to fit",
                            distance, moved ? " beside a translation" : "");
  }
  return SUPINE_OK;
}
