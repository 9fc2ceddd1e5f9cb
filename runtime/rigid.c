/* SPDX-License-Identifier: MIT */
/* Find the rigid motion that fits the positions of a rigid part best, by least squares. */
#include <math.h>

#include "base/vec3.h"
#include "runtime/rigid.h"

void supine_rigid_rotation(const double h[3][3], double rotation[9]) {
  const double m[4][4] = {
      {h[0][0] + h[1][1] + h[2][2], h[1][2] - h[2][1], h[2][0] - h[0][2], h[0][1] - h[1][0]},
      {h[1][2] - h[2][1], h[0][0] - h[1][1] - h[2][2], h[0][1] + h[1][0], h[2][0] + h[0][2]},
      {h[2][0] - h[0][2], h[0][1] + h[1][0], h[1][1] - h[0][0] - h[2][2], h[1][2] + h[2][1]},
      {h[0][1] - h[1][0], h[2][0] + h[0][2], h[1][2] + h[2][1], h[2][2] - h[0][0] - h[1][1]}};
  double shift = 0; /* added to every eigenvalue of m, so that all eigenvalues are positive */
  for (size_t k = 0; k < 16; ++k) {
    shift += m[k / 4][k % 4] * m[k / 4][k % 4];
  }
  shift = sqrt(shift);
  /* Begin near the identity: points on a line do not determine the rotation about that line. */
  double q[4] = {1, 0.03, 0.02, 0.01};
  for (int step = 0; step < 200; ++step) { /* power iteration for the largest eigenvalue */
    double next[4];
    double square = 0;
    for (size_t a = 0; a < 4; ++a) {
      next[a] = shift * q[a] + m[a][0] * q[0] + m[a][1] * q[1] + m[a][2] * q[2] + m[a][3] * q[3];
      square += next[a] * next[a];
    }
    if (square > 0) {
      for (size_t a = 0; a < 4; ++a) {
        q[a] = next[a] / sqrt(square);
      }
    }
  }
  const double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  supine_quaternion_matrix(q, rotation);
  for (size_t k = 0; k < 9; ++k) {
    rotation[k] /= square;
  }
}

void supine_rigid_add(supine_rigid_motion *m, const float *p, const float *x, size_t count) {
  m->count += (double)count;
  for (size_t i = 0; i < count; ++i) {
    for (size_t a = 0; a < 3; ++a) {
      m->from[a] += (double)p[3 * i + a];
      m->to[a] += (double)x[3 * i + a];
      for (size_t b = 0; b < 3; ++b) {
        m->cross[a][b] += (double)p[3 * i + a] * (double)x[3 * i + b];
      }
    }
  }
}

void supine_rigid_finish(supine_rigid_motion *m) {
  for (size_t a = 0; a < 3; ++a) {
    m->from[a] /= m->count;
    m->to[a] /= m->count;
  }
  for (size_t k = 0; k < 9; ++k) {
    m->cross[k / 3][k % 3] -= m->count * m->from[k / 3] * m->to[k % 3];
  }
  supine_rigid_rotation((const double(*)[3])m->cross, m->rotation);
}

double supine_rigid_move(const supine_rigid_motion *m, const float *p, size_t axis) {
  const double *row = m->rotation + 3 * axis;
  return m->to[axis] + row[0] * ((double)p[0] - m->from[0]) + row[1] * ((double)p[1] - m->from[1]) +
         row[2] * ((double)p[2] - m->from[2]);
}

void supine_rigid_restore(const supine_basis *basis, float *xyz) {
  for (size_t part = 0; part < basis->rigid_count; ++part) {
    const size_t first = basis->rigid[2 * part];
    const size_t last = basis->rigid[2 * part + 1];
    supine_rigid_motion m = {.count = 0};
    supine_rigid_add(&m, basis->info.vertices + 3 * first, xyz + 3 * first, last - first);
    supine_rigid_finish(&m);
    for (size_t k = 3 * first; k < 3 * last; ++k) {
      xyz[k] = (float)supine_rigid_move(&m, basis->info.vertices + k / 3 * 3, k % 3);
    }
  }
}
