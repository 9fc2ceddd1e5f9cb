/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compress arrays with meshoptimizer, in the format of EXT_meshopt_compression. */
#ifndef SUPINE_EXPORT_PACKED_H
#define SUPINE_EXPORT_PACKED_H

#include "base/arena.h"

#include <supine/runtime.h>

/** Load meshoptimizer; call this before the functions below. */
supine_status supine_export_pack_begin(supine_error *error);

/** Encode a unit vector for the filter OCTAHEDRAL of EXT_meshopt_compression, as 4 signed integers,
 * of which the last is 0.
 * @param size     size of all 4 integers together, bytes: 4 or 8
 * @param numbers  output: the integers */
void supine_export_pack_direction(const float direction[3], size_t size, void *numbers);

/** Compress `count` rows of `stride` bytes; the stride is a multiple of 4 and at most 256.
 * @param size  output: number of compressed bytes
 * @return the compressed bytes, valid until the arena is freed; NULL if out of memory */
void *supine_export_pack_rows(supine_arena *arena, const void *rows, size_t count, size_t stride,
                              size_t *size);

/** Compress triangles, given as `count` vertex indices below `vertices`, as above. */
void *supine_export_pack_corners(supine_arena *arena, const uint32_t *corners, size_t count,
                                 size_t vertices, size_t *size);

/** Vertices and triangles that are written, lung by lung, in this order. */
typedef struct export_order {
  size_t vertex_count; /**< number of vertices in the file; N unless the surface is simplified */
  size_t lung_begin[SUPINE_LUNGS_MAX + 1]; /**< for each lung, the index in `vertex` of its first
                                              vertex; then vertex_count */
  uint32_t *vertex;  /**< [vertex_count] for each vertex in the file, its index in the basis */
  uint32_t *corners; /**< [triangles, 3] vertices of each triangle, as indices into `vertex` */
  size_t corner_begin[SUPINE_LUNGS_MAX + 1]; /**< for each lung, the index in `corners` of its first
                                                corner; then the total number of corners */
} export_order;

/** Choose vertices, triangles and their order; the arrays are valid until the arena is freed. Call
 * supine_export_pack_begin first.
 * @param packed    false to keep the order of the basis. True for an order that compresses well:
 *                  triangles are sorted, and vertices are in the order in which the triangles first
 *                  use them
 * @param simplify  approximate number of vertices to keep, each where it is and with its own row of
 *                  coefficients, with new triangles between them; 0 to keep all vertices */
supine_status supine_export_order_make(const supine_basis_info *info, bool packed, size_t simplify,
                                       supine_arena *arena, export_order *order,
                                       supine_error *error);

/** Compute the distance of the basis' vertices from the triangles of `order`, on the reference
 * surface: its RMS and its largest value, mm. */
supine_status supine_export_order_error(const supine_basis_info *info, const export_order *order,
                                        double *rms, double *largest, supine_error *error);

/** Compute, for each lung and axis, the sums over the basis' vertices of the products of their
 * displacements by two modes at weight and gain 1, divided by the number of all vertices, mm^2. The
 * page of a simplified surface needs them to state the same expected errors as the basis.
 * @param squares  [lungs, 3, modes, modes], output */
void supine_export_squares(const supine_basis *basis, double *squares);

#endif
