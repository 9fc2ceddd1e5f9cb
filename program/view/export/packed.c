/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "program/view/export/packed.h"
#include "base/arena.h"

#include <stdlib.h>
#include <string.h>

#include <meshoptimizer.h>

#include "base/library.h"

#define FUNCTIONS(EACH)                                                                            \
  EACH(meshopt_, encodeVertexBuffer)                                                               \
  EACH(meshopt_, encodeVertexBufferBound)                                                          \
  EACH(meshopt_, encodeIndexBuffer)                                                                \
  EACH(meshopt_, encodeIndexBufferBound)                                                           \
  EACH(meshopt_, encodeIndexVersion)                                                               \
  EACH(meshopt_, encodeFilterOct)                                                                  \
  EACH(meshopt_, simplify)                                                                         \
  EACH(meshopt_, spatialSortTriangles)                                                             \
  EACH(meshopt_, optimizeVertexCacheStrip)
static struct { FUNCTIONS(SUPINE_LIBRARY_MEMBER) } meshopt;

supine_status supine_export_pack_begin(supine_error *error) {
  SUPINE_TRY(SUPINE_LIBRARY_LOAD(SUPINE_MESHOPT, FUNCTIONS, &meshopt, error));
  meshopt.encodeIndexVersion(1); /* EXT_meshopt_compression requires version 1 */
  return SUPINE_OK;
}

void supine_export_pack_direction(const float direction[3], size_t size, void *numbers) {
  const float d[4] = {direction[0], direction[1], direction[2], 0};
  meshopt.encodeFilterOct(numbers, 1, size, size == 4 ? 8 : 16, d);
}

void *supine_export_pack_rows(supine_arena *arena, const void *rows, size_t count, size_t stride,
                              size_t *size) {
  const size_t room = meshopt.encodeVertexBufferBound(count, stride);
  unsigned char *bytes = supine_arena_take(arena, room, 1);
  *size = bytes != NULL ? meshopt.encodeVertexBuffer(bytes, room, rows, count, stride) : 0;
  return bytes;
}

void *supine_export_pack_corners(supine_arena *arena, const uint32_t *corners, size_t count,
                                 size_t vertices, size_t *size) {
  const size_t room = meshopt.encodeIndexBufferBound(count, vertices);
  unsigned char *bytes = supine_arena_take(arena, room, 1);
  *size = bytes != NULL ? meshopt.encodeIndexBuffer(bytes, room, corners, count) : 0;
  return bytes;
}

/* Sort a lung's triangles from feet to head, then join them to strips, which run around the lung.
 * Along such strips the data of vertices change least, and so compress best. `level` [N, 3] has
 * (z, 0, 0) for each vertex at height z; `from` [count] is workspace. */
static void sort_triangles(uint32_t *corners, size_t count, const float *level, size_t vertices,
                           uint32_t *from) {
  memcpy(from, corners, count * sizeof *from);
  meshopt.spatialSortTriangles(corners, from, count, level, vertices, 3 * sizeof *level);
  meshopt.optimizeVertexCacheStrip(corners, corners, count, vertices);
}

/* Replace the `count` corners of a lung by those of about `simplify` triangles, whose corners are a
 * part of the same vertices. Return their number. `from` [count] is workspace. */
static size_t simplify_triangles(const supine_basis_info *info, uint32_t *corners, size_t count,
                                 size_t simplify, uint32_t *from) {
  static const float any_error = 1.0F; /* as a share of the lung's extent */
  memcpy(from, corners, count * sizeof *from);
  return meshopt.simplify(corners, from, count, info->vertices, info->vertex_count,
                          3 * sizeof *info->vertices, 3 * simplify, any_error, 0, NULL);
}

/* Append the vertices of a lung to the order: in the order in which its triangles first use them
 * (`packed`), or in that of the basis. Vertices without a triangle are last, or left out
 * (`used_only`). Then renumber the corners of the triangles. `place` [N] is workspace. */
static void number_vertices(const supine_basis_info *info, size_t lung, bool packed, bool used_only,
                            uint32_t *place, export_order *order) {
  const size_t *begin = info->lung_begin + lung;
  const size_t *corner_begin = order->corner_begin + lung;
  uint32_t next = (uint32_t)order->lung_begin[lung];
  for (size_t v = begin[0]; v < begin[1]; ++v) {
    place[v] = UINT32_MAX;
  }
  for (size_t i = corner_begin[0]; i < corner_begin[1]; ++i) {
    uint32_t *at = &place[order->corners[i]];
    if (*at == UINT32_MAX && packed) {
      order->vertex[next] = order->corners[i];
      *at = next++;
    } else if (*at == UINT32_MAX) {
      *at = 0; /* used; numbered below */
    }
  }
  for (size_t v = begin[0]; v < begin[1]; ++v) {
    const bool left = place[v] == UINT32_MAX ? !used_only : !packed;
    if (left) {
      order->vertex[next] = (uint32_t)v;
      place[v] = next++;
    }
  }
  order->lung_begin[lung + 1] = next;
  for (size_t i = corner_begin[0]; i < corner_begin[1]; ++i) {
    order->corners[i] = place[order->corners[i]];
  }
}

/* Append the triangles of a lung to the order, with the basis' vertex indices as corners. */
static void take_triangles(const supine_basis_info *info, size_t lung, export_order *order) {
  size_t at = order->corner_begin[lung];
  for (size_t t = 0; t < info->triangle_count; ++t) {
    const uint32_t *corner = info->triangles + 3 * t;
    if (corner[0] >= info->lung_begin[lung] && corner[0] < info->lung_begin[lung + 1]) {
      memcpy(order->corners + at, corner, 3 * sizeof *corner);
      at += 3;
    }
  }
  order->corner_begin[lung + 1] = at;
}

supine_status supine_export_order_make(const supine_basis_info *info, bool packed, size_t simplify,
                                       supine_arena *arena, export_order *order,
                                       supine_error *error) {
  SUPINE_ARENA own = {0};
  SUPINE_REFUSE_IF(simplify >= info->vertex_count, error, SUPINE_ERROR_ARGUMENT,
                   "the basis has %zu vertices: simplify to fewer than that, or not at all",
                   info->vertex_count);
  uint32_t *place = supine_arena_take(&own, info->vertex_count, sizeof *place);
  uint32_t *from = supine_arena_take(&own, info->triangle_count, 3 * sizeof *from);
  float *level = supine_arena_zeros(&own, info->vertex_count, 3 * sizeof *level);
  order->vertex = supine_arena_take(arena, info->vertex_count, sizeof *order->vertex);
  order->corners = supine_arena_take(arena, info->triangle_count, 3 * sizeof *order->corners);
  if (own.failed || arena->failed) {
    return supine_error_memory(error, "%zu vertices", info->vertex_count);
  }
  for (size_t v = 0; v < info->vertex_count; ++v) {
    level[3 * v] = info->vertices[3 * v + 2];
  }
  order->lung_begin[0] = 0;
  order->corner_begin[0] = 0;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    size_t *begin = order->corner_begin + lung;
    take_triangles(info, lung, order);
    uint32_t *corners = order->corners + begin[0];
    if (simplify > 0) {
      const size_t triangles = (begin[1] - begin[0]) / 3 * simplify / info->vertex_count;
      begin[1] = begin[0] + simplify_triangles(info, corners, begin[1] - begin[0], triangles, from);
    }
    if (packed) {
      sort_triangles(corners, begin[1] - begin[0], level, info->vertex_count, from);
    }
    number_vertices(info, lung, packed, simplify > 0, place, order);
  }
  order->vertex_count = order->lung_begin[info->lung_count];
  return SUPINE_OK;
}
