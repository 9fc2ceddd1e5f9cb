/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compress arrays with meshoptimizer, as the page and EXT_meshopt_compression decode them. */
#ifndef SUPINE_EXPORT_PACKED_H
#define SUPINE_EXPORT_PACKED_H

#include "program/export/export.h"

/** Compressed bytes; free `bytes` with free(). */
typedef struct export_packed {
  unsigned char *bytes;
  size_t size;
} export_packed;

/** Load meshoptimizer; call this before the functions below.
 * @retval SUPINE_ERROR_UNSUPPORTED  meshoptimizer is not installed */
supine_status supine_export_pack_begin(supine_error *error);

/** Encode a unit vector for the decoder's filter OCTAHEDRAL as 4 signed integers; the last is 0.
 * @param size     of the 4 integers together, bytes: 4 or 8
 * @param numbers  [size] bytes; output */
void supine_export_pack_direction(const float direction[3], size_t size, void *numbers);

/** Compress `count` rows of `stride` bytes; the stride is a multiple of 4 and at most 256.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_export_pack_rows(const void *rows, size_t count, size_t stride,
                                      export_packed *packed);

/** Compress triangles: `count` vertex indices below `vertices`.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_export_pack_corners(const uint32_t *corners, size_t count, size_t vertices,
                                         export_packed *packed);

/** Return the corners of the triangles lung by lung, in an order that compresses well, or NULL if
 * out of memory. The caller frees them.
 * @param begin  [lungs + 1] first corner of each lung and the end; output */
uint32_t *supine_export_pack_order(const export_source *source, size_t *begin);

#endif
