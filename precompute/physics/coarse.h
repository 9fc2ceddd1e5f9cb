/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A hierarchy of coarser graphs by smoothed aggregation (Vanek, Mandel, Brezina 1996): with it
 * the number of steps of a solve with a reach does not grow with the mesh. It depends only on
 * the mesh and the reach, so one serves every stiffness, force and direction. */
#ifndef SUPINE_COARSE_H
#define SUPINE_COARSE_H

#include "precompute/physics/rows.h"

enum { SUPINE_LEVELS_MAX = 24 };

/* The Laplacian (L v)_i = sum over links of value (v_i - v_j) on one level. */
typedef struct supine_level {
  supine_rows links;
  supine_rows part;  /* [vertices here, of the next level] shares; a row sums to 1 */
  supine_rows whole; /* the transpose */
} supine_level;

typedef struct supine_hierarchy {
  size_t level_count;
  supine_level level[SUPINE_LEVELS_MAX]; /* the first is the mesh itself */
} supine_hierarchy;

/* Coarsen until no links are left or the number of vertices stops falling. `links` must outlive
 * the hierarchy.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_hierarchy_create(const supine_rows *links,
                                              supine_hierarchy **hierarchy);
void supine_physics_hierarchy_destroy(supine_hierarchy *hierarchy);

#endif
