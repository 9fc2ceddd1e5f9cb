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

/* Renumber the vertices of a lung in the order in which its triangles first use them, with unused
 * vertices last. `place` [N] is workspace. */
static void number_vertices(const supine_basis_info *info, size_t lung, uint32_t *place,
                            export_order *order) {
  const size_t *begin = info->lung_begin + lung;
  uint32_t next = (uint32_t)begin[0];
  for (size_t v = begin[0]; v < begin[1]; ++v) {
    place[v] = UINT32_MAX;
  }
  for (size_t i = order->corner_begin[lung]; i < order->corner_begin[lung + 1]; ++i) {
    uint32_t *at = &place[order->corners[i]];
    if (*at == UINT32_MAX) {
      order->vertex[next] = order->corners[i];
      *at = next++;
    }
    order->corners[i] = *at;
  }
  for (size_t v = begin[0]; v < begin[1]; ++v) {
    if (place[v] == UINT32_MAX) {
      order->vertex[next++] = (uint32_t)v;
    }
  }
}

supine_status supine_export_order_make(const supine_basis_info *info, bool packed,
                                       supine_arena *arena, export_order *order,
                                       supine_error *error) {
  SUPINE_ARENA own = {0};
  uint32_t *place = supine_arena_take(&own, info->vertex_count, sizeof *place);
  uint32_t *from = supine_arena_take(&own, info->triangle_count, 3 * sizeof *from);
  float *level = supine_arena_zeros(&own, info->vertex_count, 3 * sizeof *level);
  size_t at = 0;
  order->vertex = supine_arena_take(arena, info->vertex_count, sizeof *order->vertex);
  order->corners = supine_arena_take(arena, info->triangle_count, 3 * sizeof *order->corners);
  if (own.failed || arena->failed) {
    return supine_error_memory(error, "%zu vertices", info->vertex_count);
  }
  for (size_t v = 0; v < info->vertex_count; ++v) {
    order->vertex[v] = (uint32_t)v;
    level[3 * v] = info->vertices[3 * v + 2];
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    uint32_t *corners = order->corners + at;
    order->corner_begin[lung] = at;
    for (size_t t = 0; t < info->triangle_count; ++t) {
      const uint32_t *corner = info->triangles + 3 * t;
      if (corner[0] >= info->lung_begin[lung] && corner[0] < info->lung_begin[lung + 1]) {
        memcpy(order->corners + at, corner, 3 * sizeof *corner);
        at += 3;
      }
    }
    order->corner_begin[lung + 1] = at;
    if (packed) {
      sort_triangles(corners, at - order->corner_begin[lung], level, info->vertex_count, from);
      number_vertices(info, lung, place, order);
    }
  }
  return SUPINE_OK;
}
