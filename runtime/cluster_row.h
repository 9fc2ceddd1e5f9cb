/* SPDX-License-Identifier: MIT */
/** @file
 * Layout of the numbers of a cluster, and the coefficients that they give a vertex (clusters.h). */
#ifndef SUPINE_RUNTIME_CLUSTER_ROW_H
#define SUPINE_RUNTIME_CLUSTER_ROW_H

#include <stdint.h>

#include <supine/runtime.h>

/** Offsets in the SUPINE_CLUSTER_NUMBERS numbers of a cluster for one mode. */
enum {
  SUPINE_CLUSTER_MEAN = 0,    /**< m: x, y, z */
  SUPINE_CLUSTER_SLOPE = 3,   /**< B, which multiplies the position: rows x, y and z */
  SUPINE_CLUSTER_PATTERN = 12 /**< P_0, then P_1 */
};

/** Compute the coefficients of a vertex.
 * @param vectors  [modes, SUPINE_CLUSTER_NUMBERS] of the vertex's cluster
 * @param p        position of the vertex, mm
 * @param scalars  its two scalars
 * @param row      [3, modes] mm, written */
static inline void supine_cluster_row(const float *vectors, size_t modes, const float p[3],
                                      const int16_t scalars[2], float *row) {
  const double first = scalars[0];
  const double second = scalars[1];
  for (size_t k = 0; k < modes; ++k) {
    const float *v = vectors + k * SUPINE_CLUSTER_NUMBERS;
    const float *pattern = v + SUPINE_CLUSTER_PATTERN;
    for (size_t axis = 0; axis < 3; ++axis) {
      const float *slope = v + SUPINE_CLUSTER_SLOPE + 3 * axis;
      row[axis * modes + k] =
          (float)((double)v[SUPINE_CLUSTER_MEAN + axis] + (double)slope[0] * (double)p[0] +
                  (double)slope[1] * (double)p[1] + (double)slope[2] * (double)p[2] +
                  first * (double)pattern[axis] + second * (double)pattern[3 + axis]);
    }
  }
}

#endif
