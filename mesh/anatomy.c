/* SPDX-License-Identifier: MIT */
/* Find which of the 48 possible assignments of coordinates to axes fits the shape of lungs best.
 *
 * The score of an assignment is the sum of the four terms below. For a single lung, the fourth term
 * is left out. The terms contain third moments of a lung about its centroid, normalised by its
 * volume V and by standard deviations,
 *
 *     m_abc = integral of a b c dV / (V sd_a sd_b sd_c)
 *
 * where a, b and c are coordinates x (outwards from the midline), y (to the back) or z (to the
 * head), and sd_a is the standard deviation of coordinate a over the volume. The last column of the
 * table shows the range of each term in nine lungs of five people and in two synthetic lungs:
 *
 *     hollow towards the heart   m_xxx - m_xyy - m_xzz     0.23 to 0.59
 *     deepest at the back        m_yzz - m_yyy             0.49 to 0.89
 *     narrow at the head        -m_xxz - m_yyz             0.27 to 0.45
 *     left and right differ      ln(V_right / V_left) + m_xyz(left) - m_xyz(right)   0.25 to 0.40
 *
 * The score of the true axes was the highest in every case. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"

#include "mesh/mesh.h"

/* Axes fit clearly better than other axes if their score is higher by more than this. In the lungs
 * of the table at the top of this file, the true axes scored higher by 0.35 to 0.7. */
static const double least_lead = 0.2;
/* Limit of the magnitude of ln(V_right / V_left) in the score. If a lung is collapsed, this keeps
 * the volumes from deciding alone. */
static const double most_ratio = 0.25;
/* A lung is thin from side to side. Axes are rejected for a single lung if its standard deviation
 * along x, divided by that along y or z, exceeds this. In real lungs, x / y is 0.6 to 0.7. */
static const double thin = 0.85;
/* A surface holds two lungs if, along one axis, its standard deviation exceeds `wide` times each of
 * the others and its kurtosis is less than `most_kurtosis`, that of a uniform distribution. */
static const double wide = 1.15;
static const double most_kurtosis = 1.8;
/* The side of a lung (left or right) is unknown if the first term in the table at the top of this
 * file is below this in magnitude. */
static const double least_side = 0.12;

typedef struct shape {
  double volume; /* mm^3 */
  /* centroid of the volume, and standard deviation along each axis, mm */
  double centre[3], deviation[3];
  double kurtosis[3];
  double moments[3][3][3]; /* [a][b][c] third moments m_abc, see the top of this file */
} shape;

static void add_point(const double p[3], double w, double sum[3], double square[3],
                      double third[3][3][3]) {
  for (int a = 0; a < 3; ++a) {
    sum[a] += w * p[a];
    square[a] += w * p[a] * p[a];
    for (int b = 0; b < 3; ++b) {
      for (int c = 0; c < 3; ++c) {
        third[a][b][c] += w * p[a] * p[b] * p[c];
      }
    }
  }
}

/* Return the mean of x^4 over a tetrahedron whose corners have x = 0, a, b and c: the sum of all
 * monomials of degree 4 in a, b and c, divided by 35. */
static double mean_fourth(double a, double b, double c) {
  double ab = 1.0;  /* at the start of loop step n: sum of all a^i b^j with i + j = n */
  double abc = 1.0; /* at the start of loop step n: sum of all a^i b^j c^k, i + j + k = n */
  double power = 1.0;
  for (int n = 0; n < 4; ++n) {
    power *= a;
    ab = power + b * ab;
    abc = ab + c * abc;
  }
  return abc / 35.0;
}

/* Return the enclosed volume (negative if the triangles face inwards), and integrate powers of the
 * coordinates x[a] relative to `origin` over it: x[a] into sum[a], x[a]^2 into square[a], x[a] x[b]
 * x[c] into third[a][b][c] and x[a]^4 into fourth[a]. All are sums over tetrahedra between `origin`
 * and a triangle. Up to degree 3, use Keast's five-point rule, which is exact. */
static double integrate(const supine_mesh *mesh, const double origin[3], double sum[3],
                        double square[3], double third[3][3][3], double fourth[3]) {
  static const double rule[5][4] = {{-0.8, 0.25, 0.25, 0.25},
                                    {0.45, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0},
                                    {0.45, 0.5, 1.0 / 6.0, 1.0 / 6.0},
                                    {0.45, 1.0 / 6.0, 0.5, 1.0 / 6.0},
                                    {0.45, 1.0 / 6.0, 1.0 / 6.0, 0.5}};
  double volume = 0.0;
  memset(sum, 0, 3 * sizeof(double));
  memset(square, 0, 3 * sizeof(double));
  memset(third, 0, 27 * sizeof(double));
  memset(fourth, 0, 3 * sizeof(double));
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    double corner[3][3];
    for (size_t v = 0; v < 3; ++v) {
      supine_subtract(mesh->vertices + 3 * (size_t)mesh->triangles[3 * t + v], origin, corner[v]);
    }
    const double part = supine_triple(corner[0], corner[1], corner[2]) / 6.0;
    volume += part;
    for (int i = 0; i < 5; ++i) {
      double p[3];
      for (int k = 0; k < 3; ++k) {
        p[k] = rule[i][1] * corner[0][k] + rule[i][2] * corner[1][k] + rule[i][3] * corner[2][k];
      }
      add_point(p, rule[i][0] * part, sum, square, third);
    }
    for (int k = 0; k < 3; ++k) {
      fourth[k] += part * mean_fourth(corner[0][k], corner[1][k], corner[2][k]);
    }
  }
  return volume;
}

/* Compute the volume, centroid and normalised moments of a surface. Return false if the surface
 * encloses no volume. */
static bool measure_shape(const supine_mesh *mesh, shape *s) {
  double sum[3];
  double square[3];
  double fourth[3];
  if (mesh->triangle_count == 0) {
    return false;
  }
  memcpy(s->centre, mesh->vertices + 3 * (size_t)mesh->triangles[0], sizeof s->centre);
  /* the first pass finds the centroid, the second pass takes the moments about it */
  for (int pass = 0; pass < 2; ++pass) {
    s->volume = integrate(mesh, s->centre, sum, square, s->moments, fourth);
    for (int k = 0; k < 3; ++k) {
      s->centre[k] += pass == 0 ? sum[k] / s->volume : 0.0;
      s->deviation[k] = sqrt(square[k] / s->volume);
      s->kurtosis[k] = fourth[k] * s->volume / (square[k] * square[k]);
    }
  }
  for (int i = 0; i < 27; ++i) {
    const int a = i / 9;
    const int b = i / 3 % 3;
    const int c = i % 3;
    s->moments[a][b][c] /= s->volume * s->deviation[a] * s->deviation[b] * s->deviation[c];
  }
  s->volume = fabs(s->volume);
  return isfinite(s->deviation[0]) && isfinite(s->deviation[1]) && isfinite(s->deviation[2]);
}

/* Axes to test. Coordinate a in these axes is sign[a] times coordinate from[a] of the surface. */
typedef struct view {
  int from[3];
  double sign[3];
} view;

static view view_of(supine_axes axes) {
  double matrix[3][3];
  view v = {{0}, {0.0}};
  supine_mesh_axes_matrix(axes, matrix);
  for (int i = 0; i < 9; ++i) {
    if (matrix[i / 3][i % 3] != 0.0) {
      v.from[i / 3] = i % 3;
      v.sign[i / 3] = matrix[i / 3][i % 3];
    }
  }
  return v;
}

static double moment(const shape *s, const view *v, int a, int b, int c) {
  return v->sign[a] * v->sign[b] * v->sign[c] * s->moments[v->from[a]][v->from[b]][v->from[c]];
}

static double hollow(const shape *s, const view *v) {
  return moment(s, v, 0, 0, 0) - moment(s, v, 0, 1, 1) - moment(s, v, 0, 2, 2);
}

static double upright(const shape *s, const view *v) {
  return moment(s, v, 1, 2, 2) - moment(s, v, 1, 1, 1) - moment(s, v, 0, 0, 2) -
         moment(s, v, 1, 1, 2);
}

/* Score axes for a pair of lungs; return -INFINITY unless the lungs' centres differ most in x. */
static double fit_pair(const shape s[2], const view *v) {
  double apart[3];
  for (int k = 0; k < 3; ++k) {
    apart[k] = v->sign[k] * (s[0].centre[v->from[k]] - s[1].centre[v->from[k]]);
  }
  if (fabs(apart[0]) < fabs(apart[1]) || fabs(apart[0]) < fabs(apart[2])) {
    return -INFINITY;
  }
  const shape *left = &s[apart[0] > 0.0 ? 0 : 1];
  const shape *right = &s[apart[0] > 0.0 ? 1 : 0];
  const double ratio = log(right->volume / left->volume);
  const double heart = moment(left, v, 0, 1, 2) + moment(right, v, 0, 1, 2);
  return 0.5 * (hollow(left, v) - hollow(right, v) + upright(left, v) + upright(right, v)) +
         fmin(fmax(ratio, -most_ratio), most_ratio) + heart;
}

static double fit_single(const shape *s, const view *v, bool mirrored) {
  const double x = s->deviation[v->from[0]];
  const bool can = x <= thin * s->deviation[v->from[1]] && x <= thin * s->deviation[v->from[2]];
  /* a mirrored left lung looks like a right lung, so left-handed axes are not considered */
  return can && !mirrored ? fabs(hollow(s, v)) + upright(s, v) : -INFINITY;
}

static bool is_joined(const shape *s) {
  for (int a = 0; a < 3; ++a) {
    const double *d = s->deviation;
    if (d[a] > wide * d[(a + 1) % 3] && d[a] > wide * d[(a + 2) % 3] &&
        s->kurtosis[a] < most_kurtosis) {
      return true;
    }
  }
  return false;
}

supine_mesh_anatomy supine_mesh_anatomy_find(const supine_mesh *lungs, size_t count) {
  supine_mesh_anatomy found = {.axes = SUPINE_AXES_LPS};
  shape s[2];
  double best = -INFINITY;
  double second = -INFINITY;
  double of_lps = -INFINITY;
  supine_axes which = SUPINE_AXES_LPS;
  for (size_t lung = 0; lung < count; ++lung) {
    if (!measure_shape(&lungs[lung], &s[lung])) {
      return found;
    }
  }
  found.joined = count == 1 && is_joined(&s[0]);
  for (int code = 1; code < SUPINE_AXES_COUNT; ++code) {
    const supine_axes axes = (supine_axes)code;
    const view v = view_of(axes);
    const double fit =
        count == 2 ? fit_pair(s, &v) : fit_single(&s[0], &v, supine_mesh_axes_mirrored(axes));
    of_lps = axes == SUPINE_AXES_LPS ? fit : of_lps;
    if (fit > best) {
      second = best;
      best = fit;
      which = axes;
    } else if (fit > second) {
      second = fit;
    }
  }
  if (best > of_lps + least_lead) {
    found.axes = which;
  }
  found.certain = which == found.axes && best > second + least_lead;
  if (count == 1 && found.axes == SUPINE_AXES_LPS) {
    const view v = view_of(found.axes);
    const double side = hollow(&s[0], &v);
    found.side = 0;
    if (side > least_side) {
      found.side = 1;
    } else if (side < -least_side) {
      found.side = -1;
    }
  }
  return found;
}
