/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Cut vertices into compact groups of equal size, to begin Lloyd's iteration. */
#ifndef SUPINE_CUT_H
#define SUPINE_CUT_H

#include "precompute/clusters/clusters.h"

/** Cut the vertices of each part at medians along the longest side of their box, until there are
 * `count` groups. Parts get groups in proportion to their numbers of vertices, at least one each.
 * @param order  [vertex_count] work space
 * @param group  [vertex_count] group of each vertex, written
 * @return the number of groups, at least the number of parts with vertices */
size_t supine_clusters_cut(const supine_clustered *surface, size_t count, uint32_t *order,
                           uint16_t *group);

#endif
