/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Arrays compressed by meshoptimizer's codecs, as the page and EXT_meshopt_compression have them.
 */
#ifndef SUPINE_EXPORT_PACKED_H
#define SUPINE_EXPORT_PACKED_H

#include "program/export/export.h"

/** Compressed bytes; free `bytes` with free(). */
typedef struct export_packed {
  unsigned char *bytes;
  size_t size;
} export_packed;

/** Load meshoptimizer; call before the functions below.
 * @retval SUPINE_ERROR_UNSUPPORTED  it is not installed */
supine_status supine_export_pack_begin(supine_error *error);

/** Encode a unit vector for the decoder's filter OCTAHEDRAL as 4 numbers, of which the last is 0.
 * @param size  of the 4 numbers, bytes: 4 or 8 */
void supine_export_pack_direction(const float direction[3], size_t size, void *numbers);

/** Compress `count` rows of `stride` bytes, a multiple of 4, at most 256.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_export_pack_rows(const void *rows, size_t count, size_t stride,
                                      export_packed *packed);

/** Compress triangles: `count` vertex numbers below `vertices`.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_export_pack_corners(const uint32_t *corners, size_t count, size_t vertices,
                                         export_packed *packed);

/** Return the corners of the triangles (malloc) lung by lung, in an order that compresses well, or
 * NULL if memory is short.
 * @param begin  first corner of each lung and the end, [lungs + 1] */
uint32_t *supine_export_pack_order(const export_source *source, size_t *begin);

#endif
