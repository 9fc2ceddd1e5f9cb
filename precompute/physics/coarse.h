/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Coarser and coarser graphs in place of a fine one, by smoothed aggregation (Vanek, Mandel,
 * Brezina 1996): what lets a solve with a reach take as many steps on any mesh. They depend on the
 * mesh and the reach alone, so that one hierarchy serves every stiffness, force and direction. */
#ifndef SUPINE_COARSE_H
#define SUPINE_COARSE_H

#include "precompute/physics/rows.h"

enum { SUPINE_LEVELS_MAX = 24 };

/* The Laplacian (L v)_i = sum over links of value (v_i - v_j) on one level. */
typedef struct supine_level {
  supine_rows links;
  supine_rows part;  /* of each vertex here, its shares in those of the next level: they sum to 1 */
  supine_rows whole; /* the transpose */
} supine_level;

typedef struct supine_hierarchy {
  size_t level_count;
  supine_level level[SUPINE_LEVELS_MAX]; /* the first is the mesh itself */
} supine_hierarchy;

/* Coarsens until no links are left, or no fewer vertices come of it. `links` must
 * outlive the hierarchy.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_hierarchy_create(const supine_rows *links,
                                              supine_hierarchy **hierarchy);
void supine_physics_hierarchy_destroy(supine_hierarchy *hierarchy);

#endif
