/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make triangle strips of a surface for POLYDATA: a third of the bytes of its triangles. */
#ifndef SUPINE_STREAM_STRIPS_H
#define SUPINE_STREAM_STRIPS_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

/** Strips as sent: for each the number of its corners and the corners, 32 bits, big-endian. Corners
 * i, i + 1, i + 2 of a strip are a triangle, of the opposite orientation where i is odd. */
typedef struct supine_stream_strips {
  unsigned char *bytes; /**< [size]; the caller frees them */
  size_t size;
  size_t count; /**< number of strips */
} supine_stream_strips;

/** Make strips that contain each triangle once, in its orientation, in another order.
 * @param triangles  [count] corners below `vertices`
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_strips_make(const uint32_t *triangles, size_t count, size_t vertices,
                                        supine_stream_strips *strips);

#endif
