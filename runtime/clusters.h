/* SPDX-License-Identifier: MIT */
/** @file
 * Bases of clusters. The coefficients C_i,k of vertex i, vectors along x, y and z, are not stored.
 * They follow from the vertex's cluster c, its position p_i and its two scalars a_i:
 *
 *     C_i,k = m_c,k + B_c,k p_i + a_i0 P_c0,k + a_i1 P_c1,k
 *
 * In a pose with the weights w_k and the gains A_j, each cluster becomes 18 numbers (its frame),
 * and a vertex costs 15 multiplications and 15 additions:
 *
 *     x_i = b + A p_i + a_i0 Q_0 + a_i1 Q_1
 *     b_j = A_j sum_k w_k m_jk,   A_jl = [j = l] + A_j sum_k w_k B_jlk,
 *     Q_sj = A_j sum_k w_k P_sjk */
#ifndef SUPINE_RUNTIME_CLUSTERS_H
#define SUPINE_RUNTIME_CLUSTERS_H

#include "runtime/internal.h"

/** Frames of all clusters, on the stack of the caller: 48 kB. */
typedef float supine_cluster_frames[SUPINE_CLUSTERS_MAX * SUPINE_CLUSTER_FRAME];

/** Compute the frames of the clusters to which the vertices of the tiles that hold vertices
 * begin <= i < end belong. */
void supine_clusters_pose(const supine_basis *basis, const supine_pose *pose, size_t begin,
                          size_t end, float *frames);

/** Compute the coefficients of vertices begin <= i < end, [end - begin, 3, modes], mm. */
void supine_clusters_coefficients(const supine_basis *basis, size_t begin, size_t end,
                                  float *coefficients);

/** Pack the positions, scalars and cluster indices of the vertices (supine_tiles_layout_clusters).
 */
supine_status supine_clusters_pack(supine_basis *basis);

#endif
