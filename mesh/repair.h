/* SPDX-License-Identifier: MIT */
/** @file Repair small, unambiguous defects of surfaces; sort the sides of triangles by edge. */
#ifndef SUPINE_MESH_REPAIR_H
#define SUPINE_MESH_REPAIR_H

#include "mesh/mesh.h"

typedef struct supine_mesh_repair_report {
  size_t duplicates; /**< dropped triangles with the corners of an earlier triangle */
  size_t loose;      /**< dropped triangles without an edge that exactly two triangles share */
  size_t reversed;   /**< triangles reversed to face like most of their surface */
  size_t separated;  /**< vertices added where closed surfaces shared a vertex */
} supine_mesh_repair_report;

/** Repair a surface in place. A surface without defects is not changed.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_mesh_repair(supine_mesh *mesh, supine_mesh_repair_report *report);

/** Drop vertices that are in no triangle, keeping the order of the others; return the number
 * dropped.
 * @param space  [vertex_count] work space */
size_t supine_mesh_drop_unreferenced(supine_mesh *mesh, uint32_t *space);

/** Drop connected pieces with less than `share` of the volume of all pieces.
 * @param pieces  output: number of pieces kept
 * @param specks  output: number of pieces dropped
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_mesh_drop_specks(supine_mesh *mesh, double share, size_t *pieces,
                                      size_t *specks);

/** One side of a triangle, between vertices low < high. */
typedef struct supine_mesh_side {
  uint32_t low, high;
  uint32_t at; /**< 3 * (index of the triangle) + (corner where the side starts, 0 to 2) */
} supine_mesh_side;

/** Return the sides of all triangles, sorted by `low`, then `high`, then `at`; NULL if out of
 * memory. The caller frees them. */
supine_mesh_side *supine_mesh_sides_sort(const supine_mesh *mesh);

/** Return how many of `count` sorted sides are on the edge whose first side is sides[i]. */
size_t supine_mesh_sides_of_edge(const supine_mesh_side *sides, size_t i, size_t count);

#endif
