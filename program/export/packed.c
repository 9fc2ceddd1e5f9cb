/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "program/export/packed.h"

#include <stdlib.h>
#include <string.h>

#include <meshoptimizer.h>

#include "sh/base/library.h"

#define FUNCTIONS(EACH)                                                                            \
  EACH(meshopt_, encodeVertexBuffer)                                                               \
  EACH(meshopt_, encodeVertexBufferBound)                                                          \
  EACH(meshopt_, encodeIndexBuffer)                                                                \
  EACH(meshopt_, encodeIndexBufferBound)                                                           \
  EACH(meshopt_, encodeIndexVersion)                                                               \
  EACH(meshopt_, encodeFilterOct)                                                                  \
  EACH(meshopt_, optimizeVertexCache)
static struct { FUNCTIONS(SUPINE_LIBRARY_MEMBER) } meshopt;

supine_status supine_export_pack_begin(supine_error *error) {
  const supine_status status = SUPINE_LIBRARY_LOAD(SUPINE_MESHOPT, FUNCTIONS, &meshopt, error);
  if (status == SUPINE_OK) {
    meshopt.encodeIndexVersion(1); /* EXT_meshopt_compression requires it */
  }
  return status;
}

void supine_export_pack_direction(const float direction[3], size_t size, void *numbers) {
  const float d[4] = {direction[0], direction[1], direction[2], 0};
  meshopt.encodeFilterOct(numbers, 1, size, size == 4 ? 8 : 16, d);
}

supine_status supine_export_pack_rows(const void *rows, size_t count, size_t stride,
                                      export_packed *packed) {
  const size_t room = meshopt.encodeVertexBufferBound(count, stride);
  *packed = (export_packed){.bytes = malloc(room)};
  if (packed->bytes == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  packed->size = meshopt.encodeVertexBuffer(packed->bytes, room, rows, count, stride);
  return SUPINE_OK;
}

supine_status supine_export_pack_corners(const uint32_t *corners, size_t count, size_t vertices,
                                         export_packed *packed) {
  const size_t room = meshopt.encodeIndexBufferBound(count, vertices);
  *packed = (export_packed){.bytes = malloc(room)};
  if (packed->bytes == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  packed->size = meshopt.encodeIndexBuffer(packed->bytes, room, corners, count);
  return SUPINE_OK;
}

uint32_t *supine_export_pack_order(const export_source *source, size_t *begin) {
  const supine_basis_info *info = source->info;
  uint32_t *corners = malloc(3 * info->triangle_count * sizeof *corners + 1);
  size_t at = 0;
  for (size_t lung = 0; corners != NULL && lung < info->lung_count; ++lung) {
    begin[lung] = at;
    for (size_t t = 0; t < info->triangle_count; ++t) {
      const uint32_t *corner = source->triangles + 3 * t;
      if (corner[0] >= info->lung_begin[lung] && corner[0] < info->lung_begin[lung + 1]) {
        memcpy(corners + at, corner, 3 * sizeof *corner);
        at += 3;
      }
    }
    meshopt.optimizeVertexCache(corners + begin[lung], corners + begin[lung], at - begin[lung],
                                info->vertex_count);
  }
  begin[info->lung_count] = at;
  return corners;
}
