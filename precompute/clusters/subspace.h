/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file The affine subspace of a cluster: coefficients as a function of position and patterns. */
#ifndef SUPINE_SUBSPACE_H
#define SUPINE_SUBSPACE_H

#include "precompute/clusters/clusters.h"

/** A row of coefficients of a vertex has 3 x mode_count numbers. */
enum { SUPINE_CLUSTER_ROW_MAX = 3 * 64 };

/** The fit of one cluster. With q = p - centre, a row of coefficients is nearly
 *
 *     row = mean + q_x slope_x + q_y slope_y + q_z slope_z + a_0 pattern_0 + a_1 pattern_1
 *
 * The patterns have length 1 and are orthogonal, so that a_s = pattern_s . (row - linear part). */
typedef struct supine_subspace {
  double centre[3];                                              /**< mean position, mm */
  float linear[4][SUPINE_CLUSTER_ROW_MAX];                       /**< mean, slope_x, _y, _z */
  float pattern[SUPINE_CLUSTER_SCALARS][SUPINE_CLUSTER_ROW_MAX]; /**< patterns of what is left */
} supine_subspace;

/** Fit a cluster by least squares: its linear part by regression on the position, its patterns as
 * the leading principal components of what is left, which together is the best fit of this form.
 * @param members  [count] vertices of the cluster
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL  of LAPACK */
supine_status supine_clusters_subspace_fit(const supine_clustered *surface, const uint32_t *members,
                                           size_t count, supine_subspace *subspace);

/** Compute what the subspace leaves of the row of a vertex, and its scalars.
 * @param scalars  [2] written
 * @param left     [3 x mode_count] written: row minus linear part minus patterns, mm
 * @return the squared length of `left` */
double supine_clusters_subspace_leave(const supine_clustered *surface,
                                      const supine_subspace *subspace, size_t vertex,
                                      double scalars[SUPINE_CLUSTER_SCALARS], float *left);

#endif
