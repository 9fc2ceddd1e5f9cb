/* SPDX-License-Identifier: MIT */
/** @file Repair small, unambiguous defects of surfaces; find the triangles at each edge. */
#ifndef SUPINE_MESH_REPAIR_H
#define SUPINE_MESH_REPAIR_H

#include "base/arena.h"

#include "mesh/mesh.h"

typedef struct supine_mesh_repair_report {
  size_t duplicates; /**< number of dropped triangles with the corners of an earlier one */
  size_t loose;      /**< number of dropped triangles with no edge that has exactly 2 triangles */
  size_t reversed;   /**< number of triangles reversed to face like most of their surface */
  size_t separated;  /**< number of vertices added where closed surfaces shared a vertex */
} supine_mesh_repair_report;

/** Repair a surface in place. A surface without defects is not changed. */
supine_status supine_mesh_repair(supine_mesh *mesh, supine_mesh_repair_report *report);

/** Join each vertex with those within `distance`, mm, and drop the triangles that lose a corner by
 * that. The lowest of the vertices stays.
 * @param joined  output: number of vertices that were joined with a lower one */
supine_status supine_mesh_join_close(supine_mesh *mesh, double distance, size_t *joined);

/** Replace each corner of the triangles, v, by remap[v], and drop the triangles that then have equal
 * corners. Return the number of dropped triangles. */
size_t supine_mesh_remap(supine_mesh *mesh, const uint32_t *remap);

/** Drop vertices that are in no triangle, and keep the order of the others. Return the number of
 * dropped vertices.
 * @param space  [vertex_count] work space */
size_t supine_mesh_drop_unreferenced(supine_mesh *mesh, uint32_t *space);

/** Drop connected components with less than the fraction `share` of the total volume.
 * @param pieces  output: number of components kept
 * @param specks  output: number of components dropped */
supine_status supine_mesh_drop_specks(supine_mesh *mesh, double share, size_t *pieces,
                                      size_t *specks);

/** A side of one triangle, between the vertices low < high. An edge of n triangles has n sides. */
typedef struct supine_mesh_side {
  uint32_t low, high;
  uint32_t at; /**< position in mesh.triangles of the corner where the side starts */
} supine_mesh_side;

/** Return the sides of all triangles, sorted by `low`, then `high`, then `at`; NULL if out of
 * memory. */
supine_mesh_side *supine_mesh_sides_sort(const supine_mesh *mesh, supine_arena *arena);

/** Return the number of triangles that share an edge: count how many of the sorted sides, from
 * sides[i] on, have the same two vertices as sides[i]. */
size_t supine_mesh_sides_of_edge(const supine_mesh_side *sides, size_t i, size_t count);

#endif
