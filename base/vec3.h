/* SPDX-License-Identifier: MIT */
/** @file Compute with vectors of three components, and spread directions over the sphere. */
#ifndef SUPINE_VEC3_H
#define SUPINE_VEC3_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

static inline double supine_dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** Return the sum of the products of two lists of numbers. */
static inline double supine_dot_n(size_t count, const double *a, const double *b) {
  double sum = 0;
  for (size_t i = 0; i < count; ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

/** Compute a x b; `product` must be neither `a` nor `b`. */
static inline void supine_cross(const double a[3], const double b[3], double product[3]) {
  product[0] = a[1] * b[2] - a[2] * b[1];
  product[1] = a[2] * b[0] - a[0] * b[2];
  product[2] = a[0] * b[1] - a[1] * b[0];
}

/** Return a . (b x c), the determinant of the three vectors. */
static inline double supine_triple(const double a[3], const double b[3], const double c[3]) {
  double product[3];
  supine_cross(b, c, product);
  return supine_dot(a, product);
}

static inline double supine_length(const double v[3]) {
  return sqrt(supine_dot(v, v));
}

static inline void supine_subtract(const double a[3], const double b[3], double difference[3]) {
  for (int k = 0; k < 3; ++k) {
    difference[k] = a[k] - b[k];
  }
}

/** Compute the eigenvalues of a symmetric matrix [Smith 1961, Commun ACM 4(4), 168], largest
 * first. */
static inline void supine_eigenvalues(const double m[3][3], double value[3]) {
  const double mean = (m[0][0] + m[1][1] + m[2][2]) / 3.0;
  double square = 0.0;
  double rest[3][3];
  for (int k = 0; k < 9; ++k) {
    rest[k / 3][k % 3] = m[k / 3][k % 3] - (k / 3 == k % 3 ? mean : 0.0);
    square += rest[k / 3][k % 3] * rest[k / 3][k % 3];
  }
  const double p = sqrt(square / 6.0);
  double cosine = 1.0;
  if (p > 0.0) {
    cosine = 0.5 * supine_triple(rest[0], rest[1], rest[2]) / (p * p * p);
  }
  const double angle = acos(fmin(fmax(cosine, -1.0), 1.0)) / 3.0;
  for (int k = 0; k < 3; ++k) {
    value[k] = mean + 2.0 * p * cos(angle - 2.0943951023931953 * k); /* 2 pi / 3 */
  }
}

/** Scale a vector to length 1 without overflow or underflow; return false if it is zero or not
 * finite. `unit` may be `v`. */
static inline bool supine_normalise(const double v[3], double unit[3]) {
  const double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
  if (!isfinite(v[0]) || !isfinite(v[1]) || !isfinite(v[2]) || largest == 0) {
    return false;
  }
  const double s[3] = {v[0] / largest, v[1] / largest, v[2] / largest};
  const double length = supine_length(s);
  for (int i = 0; i < 3; ++i) {
    unit[i] = s[i] / length;
  }
  return true;
}

/** Convert a quaternion (w, x, y, z) to a matrix, row by row: a rotation, times the square of the
 * quaternion's length. */
static inline void supine_quaternion_matrix(const double quaternion[4], double matrix[9]) {
  const double w = quaternion[0];
  const double *v = quaternion + 1;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    matrix[4 * i] = w * w + v[i] * v[i] - v[j] * v[j] - v[k] * v[k];
    matrix[3 * i + j] = 2 * (v[i] * v[j] - w * v[k]);
    matrix[3 * j + i] = 2 * (v[i] * v[j] + w * v[k]);
  }
}

/** Deviation from a rotation that rounding causes: to 32-bit floats 1e-6, in trackers 1e-4. */
#define SUPINE_ROTATION_TOLERANCE 1e-3

/** Return how much a matrix R, row by row, is stretched or sheared beyond a uniform scale, which is
 * negative if R has a reflection:
 *
 *     max |(R^T R)_ij / scale^2 - delta_ij| / 2,    |scale| = sqrt(trace(R^T R) / 3)
 *
 * A rotation has scale 1 and strain 0. The strain means nothing if the scale is 0 or not finite. */
static inline double supine_matrix_strain(const double matrix[9], double *scale) {
  double square = 0;
  for (int i = 0; i < 9; ++i) {
    square += matrix[i] * matrix[i] / 3;
  }
  double strain = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j) {
      const double product =
          matrix[i] * matrix[j] + matrix[3 + i] * matrix[3 + j] + matrix[6 + i] * matrix[6 + j];
      strain = fmax(strain, 0.5 * fabs(product / square - (i == j ? 1 : 0)));
    }
  }
  *scale = copysign(sqrt(square), supine_triple(matrix, matrix + 3, matrix + 6));
  return strain;
}

static inline double supine_distance(const double a[3], const double b[3]) {
  double d[3];
  supine_subtract(a, b, d);
  return supine_length(d);
}

/** Begin a bounding box: one that contains nothing. */
static inline void supine_box_begin(double low[3], double high[3]) {
  for (int k = 0; k < 3; ++k) {
    low[k] = INFINITY;
    high[k] = -INFINITY;
  }
}

/** Extend a bounding box to a point. */
static inline void supine_box_add(const double point[3], double low[3], double high[3]) {
  for (int k = 0; k < 3; ++k) {
    low[k] = point[k] < low[k] ? point[k] : low[k];
    high[k] = point[k] > high[k] ? point[k] : high[k];
  }
}

/** Compute the normal of the triangle p, q, r. Its length is twice the area of the triangle. */
static inline void supine_normal(const double p[3], const double q[3], const double r[3],
                                 double normal[3]) {
  double u[3];
  double v[3];
  supine_subtract(q, p, u);
  supine_subtract(r, p, v);
  supine_cross(u, v, normal);
}

/** Compute one of `count` directions that cover the sphere evenly, on a golden-angle spiral from +z
 * to -z.
 * @param at    index of the direction, 0 to count - 1, not necessarily an integer
 * @param from  longitude of direction 0, rad */
static inline void supine_spiral(double at, double count, double from, double direction[3]) {
  static const double golden_angle = 2.3999632297286533222; /* pi (3 - sqrt 5) */
  const double z = 1.0 - (2.0 * at + 1.0) / count;
  const double radius = sqrt(fmax(0.0, 1.0 - z * z));
  direction[0] = radius * cos(golden_angle * at + from);
  direction[1] = radius * sin(golden_angle * at + from);
  direction[2] = z;
}

#endif
