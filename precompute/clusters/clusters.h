/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Clusters of vertices that move alike [Sloan2003]. In a basis of vectors, vertex i has a vector of
 * coefficients C_i,k (along x, y and z) for each of K modes. Within a cluster c, these are nearly a
 * linear function of the vertex's position p_i, plus two patterns of the cluster times two scalars
 * of the vertex:
 *
 *     C_i,k = m_c,k + B_c,k p_i + a_i0 P_c0,k + a_i1 P_c1,k                                    (1)
 *
 * With the weights w_k of a pose, a cluster becomes a vector b, a matrix A and two vectors Q, once
 * a frame, and a vertex costs 15 multiplications and 15 additions, whatever K:
 *
 *     x_i = b + A p_i + a_i0 Q_0 + a_i1 Q_1                                                    (2)
 *     b = sum_k w_k m_k,   A = 1 + sum_k w_k B_k,   Q_s = sum_k w_k P_s,k
 *
 * Clusters are found by Lloyd's iteration: fit (1) to each cluster, then move each vertex to the
 * neighbouring cluster that errs least there.
 *
 * [Sloan2003]  Sloan, Hall, Hart, Snyder, "Clustered principal components for precomputed radiance
 *              transfer", ACM Trans. Graph. 22(3), 2003, 382-391 */
#ifndef SUPINE_CLUSTERS_H
#define SUPINE_CLUSTERS_H

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <supine/runtime.h>
#include <supine/status.h>

enum {
  SUPINE_CLUSTER_SCALARS = 2 /**< scalars of a vertex, and patterns of a cluster */
};

/** A surface in parts that do not share clusters, and the coefficients of its vertices. */
typedef struct supine_clustered {
  size_t vertex_count;
  size_t triangle_count;
  size_t mode_count;
  size_t part_count;
  const size_t
      *part_begin;       /**< [part_count + 1] first vertex of each part (lung), then the count */
  const float *vertices; /**< [vertex_count, 3] positions p, mm */
  const uint32_t *triangles; /**< [triangle_count, 3] */
  const float *coefficients; /**< [vertex_count, 3, mode_count] C, mm */
  double weight_rms; /**< RMS of the weight of a mode over all states, the same for all modes */
} supine_clustered;

typedef struct supine_clusters {
  size_t count;
  size_t vertex_count;
  size_t mode_count;
  uint16_t *cluster; /**< [vertex_count] cluster of each vertex */
  int16_t *scalars;  /**< [vertex_count, 2] a; the patterns carry the step of quantisation */
  float *vectors;    /**< [count, mode_count, 18] m (x, y, z), rows x, y and z of B, P_0 and P_1 */
  double rms;        /**< RMS error of a displacement over vertices and states, mm */
  double largest;    /**< RMS error over states of the vertex that errs most, mm */
  double seam;       /**< RMS of the change of the error along an edge between clusters, divided by
                          the mean length of the edges */
} supine_clusters;

/** Errors and sizes that clusters may have. */
typedef struct supine_cluster_limits {
  double rms;      /**< largest RMS error of a displacement, mm */
  double seam;     /**< largest supine_clusters.seam */
  size_t vertices; /**< fewest vertices per cluster, on average */
} supine_cluster_limits;

static inline void supine_clusters_free(supine_clusters *clusters) {
  free(clusters->cluster);
  free(clusters->scalars);
  free(clusters->vectors);
  *clusters = (supine_clusters){0};
}

/** Find `count` clusters, or fewer if some become empty.
 * Cost: ten iterations; in each, 9 K^2 multiplications a vertex and 18 K for each candidate.
 * @param clusters  written; release it with supine_clusters_free
 * @retval SUPINE_ERROR_ARGUMENT  count is below part_count, or above SUPINE_CLUSTERS_MAX
 * @retval SUPINE_ERROR_NUMERICAL  LAPACK found no eigenvectors: a coefficient is not finite */
supine_status supine_clusters_find(const supine_clustered *surface, size_t count,
                                   supine_clusters *clusters, supine_error *error);

/** Find the fewest clusters, in steps of a factor of two, that stay within the limits and have
 * enough vertices. If there are none, `clusters->count` is 0: store modes instead. */
supine_status supine_clusters_choose(const supine_clustered *surface,
                                     const supine_cluster_limits *limits, supine_clusters *clusters,
                                     supine_error *error);

/** Compute the coefficients of the clusters by (1), [vertex_count, 3, mode_count], mm.
 * @param vertices  [vertex_count, 3] positions, mm */
void supine_clusters_expand(const supine_clusters *clusters, const float *vertices,
                            float *coefficients);

#endif
