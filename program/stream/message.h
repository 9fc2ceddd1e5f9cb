/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Read OpenIGTLink messages from untrusted bytes, and write them. Fields, with their sizes in
 * bytes, big-endian:
 *
 *     header      58: version 2, type 12, device 20, time 8, body size 8, body CRC 8
 *     body        version 1: content. Version 2: extension, content, metadata
 *     extension   12 or more: its size 2, metadata index size 2, metadata size 4, message number 4
 *
 * The extension has the layout that the protocol's public library sends, not that of the protocol's
 * text. Lengths in messages are checked against the bytes received before anything is read. */
#ifndef SUPINE_STREAM_MESSAGE_H
#define SUPINE_STREAM_MESSAGE_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

enum {
  SUPINE_STREAM_HEADER = 58,
  SUPINE_STREAM_EXTENSION = 12,
  SUPINE_STREAM_BODY_MAX = 65536 /* largest body that is read; larger ones are skipped */
};

typedef struct supine_stream_header {
  unsigned version;
  char type[13];
  char device[21];
  uint64_t stamp; /**< seconds since 1970 x 2^32; 0: none */
  uint64_t size;  /**< of the body */
  uint64_t crc;   /**< of the body */
} supine_stream_header;

/** Read a header.
 * @retval SUPINE_ERROR_FORMAT  not version 1 or 2, or a type that is not text; no message can be
 *                              read after this one */
supine_status supine_stream_header_read(const unsigned char bytes[SUPINE_STREAM_HEADER],
                                        supine_stream_header *header, supine_error *error);
void supine_stream_header_write(const supine_stream_header *header,
                                unsigned char bytes[SUPINE_STREAM_HEADER]);

/** Content of a message. */
typedef enum supine_stream_kind {
  SUPINE_STREAM_NOTHING = 0, /**< ignored: another type or device */
  SUPINE_STREAM_ROTATION,    /**< number [9]: rows of the matrix from tracker to world axes, then
                                  [3]: position, mm; text: device */
  SUPINE_STREAM_POSITION,    /**< number and text as ROTATION, of a device that is not followed */
  SUPINE_STREAM_POINT_LIST,  /**< points: supine_stream_message_point */
  SUPINE_STREAM_QUATERNION,  /**< number [4]: the rotation as W, X, Y, Z */
  SUPINE_STREAM_DOWN,        /**< number [3]: direction of gravity in the tracker's axes */
  SUPINE_STREAM_VOLUME,      /**< number [1]: mL above the posture's rest */
  SUPINE_STREAM_VOLUME_TEXT, /**< text: a volume as the command line takes it */
  SUPINE_STREAM_REQUEST      /**< text: content that the peer wants to receive */
} supine_stream_kind;

typedef struct supine_stream_message {
  supine_stream_kind kind;
  double number[12];
  char text[64];
  const unsigned char *points; /**< [point_count] encoded points, inside the body */
  size_t point_count;
} supine_stream_message;

/** Read the name and the position, mm, of a point of a POINT_LIST. The body must still exist. */
void supine_stream_message_point(const supine_stream_message *message, size_t point, char name[65],
                                 double position[3]);

/** Return whether supine_stream_message_read reads messages of this type. */
int supine_stream_message_is_known(const supine_stream_header *header);

/** Read a body. Numbers may be not-a-number.
 *
 *     from `device`        POSITION, TRANSFORM, NDARRAY [3] (direction of gravity)
 *     instrument `device`  QTDATA
 *     any device           TRANSFORM and POINT: positions of observed points
 *     "VOLUME"             NDARRAY [1], STRING
 *     "SEND"               STRING
 *
 * @param device  device whose poses are followed; NULL: any
 * @retval SUPINE_ERROR_FORMAT  a wrong CRC, or lengths that contradict each other */
supine_status supine_stream_message_read(const supine_stream_header *header,
                                         const unsigned char *body, const char *device,
                                         supine_stream_message *message, supine_error *error);

/** Write the beginning of an NDARRAY of `count` 32-bit floats; return the size of the beginning, 4
 * bytes. */
size_t supine_stream_ndarray_head(size_t count, unsigned char *bytes);

/** Write the beginning of a POLYDATA; return the size of the beginning, 40 bytes.
 * @param size        of the triangle strips, bytes
 * @param attributes  1: an attribute follows the triangles; else 0 */
size_t supine_stream_polydata_head(size_t points, size_t strips, size_t size, size_t attributes,
                                   unsigned char *bytes);

/** Write the beginning of the attribute "expected_error_mm", one float for each point; return the
 * size of the beginning, SUPINE_STREAM_ATTRIBUTE bytes. */
enum { SUPINE_STREAM_ATTRIBUTE = 24 };
size_t supine_stream_attribute_head(size_t points, unsigned char *bytes);

/** Make floats big-endian, in place. */
void supine_stream_encode_floats(size_t count, float *values);

/* The checksum of messages: CRC-64 of ECMA-182, most significant bit first, from 0,
 *
 *     crc(M) = M(x) x^64 mod P,     P = x^64 + 0x42F0E1EBA9EA3693
 *
 * It is linear: the checksums of two parts give the checksum of the whole. */

/** Continue the checksum `crc` (0 for the first bytes) over more bytes. Thread-safe. */
uint64_t supine_stream_crc64(uint64_t crc, const void *bytes, size_t size);

/** Join the checksums of A and of B, of `size` bytes: crc(A B) = crc(A) x^(8 size) + crc(B). */
uint64_t supine_stream_crc64_join(uint64_t first, uint64_t second, size_t size);

#endif
