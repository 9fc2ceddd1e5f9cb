/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * A surface's triangles as strips, as POLYDATA has them: a third of the bytes of triangles. */
#ifndef SUPINE_STREAM_STRIPS_H
#define SUPINE_STREAM_STRIPS_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

/** Strips on the wire: for each its number of corners and the corners, 32 bits, big-endian. Corners
 * i, i + 1, i + 2 of a strip are a triangle, which faces the other way round where i is odd. */
typedef struct supine_stream_strips {
  unsigned char *bytes; /**< [size]; the caller's, to be freed */
  size_t size;
  size_t count; /**< of strips */
} supine_stream_strips;

/** Makes strips of triangles: each triangle once, as it faces, in an order of the strips' own.
 * @param triangles  [count] corners below `vertices`
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_strips_make(const uint32_t *triangles, size_t count, size_t vertices,
                                        supine_stream_strips *strips);

#endif
