/* SPDX-License-Identifier: MIT */
/** @file Sort the sides of triangles by edge. */
#ifndef SUPINE_MESH_SIDES_H
#define SUPINE_MESH_SIDES_H

#include "mesh/mesh.h"

/** One side of a triangle, between vertices low < high. */
typedef struct supine_mesh_side {
  uint32_t low, high;
  uint32_t at; /**< 3 * triangle + corner that the side starts at */
} supine_mesh_side;

/** Sort all sides by low, then high, then at; NULL if out of memory. The caller frees them. */
supine_mesh_side *supine_mesh_sides_sort(const supine_mesh *mesh);

/** Return the number of sides, from side i on, that belong to its edge. */
size_t supine_mesh_sides_of_edge(const supine_mesh_side *sides, size_t i, size_t count);

#endif
