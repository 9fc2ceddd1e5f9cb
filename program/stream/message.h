/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Read OpenIGTLink messages from untrusted bytes, and write them. Fields, with their sizes in
 * bytes:
 *
 *     header 58   version 2, type 12, device 20, time 8, body's size 8, body's CRC 8; big-endian
 *     body        version 1: content. Version 2: extension, content, metadata
 *     extension   its size 2 (>= 12), metadata index's size 2, metadata's size 4, message number 4
 *
 * The extension is as the protocol's public library sends it, which differs from the text of the
 * protocol. Lengths in messages are checked against the bytes received before anything is read; the
 * library's own unpackers do not check them. */
#ifndef SUPINE_STREAM_MESSAGE_H
#define SUPINE_STREAM_MESSAGE_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

enum {
  SUPINE_STREAM_HEADER = 58,
  SUPINE_STREAM_EXTENSION = 12,
  SUPINE_STREAM_BODY_MAX = 65536 /* of messages that are read: poses, volumes, requests */
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
 * @retval SUPINE_ERROR_FORMAT  not version 1 or 2, or a type that is not text: the messages that
 *                              follow cannot be found */
supine_status supine_stream_header_read(const unsigned char bytes[SUPINE_STREAM_HEADER],
                                        supine_stream_header *header, supine_error *error);
void supine_stream_header_write(const supine_stream_header *header,
                                unsigned char bytes[SUPINE_STREAM_HEADER]);

/** Content of a message. */
typedef enum supine_stream_kind {
  SUPINE_STREAM_NOTHING = 0, /**< ignored: another type or device */
  SUPINE_STREAM_ROTATION,    /**< number [9]: rows of the matrix from tracker to world axes, then
                                  [3]: position, mm; text: device */
  SUPINE_STREAM_PLACE,       /**< as ROTATION, of another device than the one followed */
  SUPINE_STREAM_PLACES,      /**< points: supine_stream_message_point */
  SUPINE_STREAM_QUATERNION,  /**< number [4]: the rotation as W, X, Y, Z */
  SUPINE_STREAM_DOWN,        /**< number [3]: direction of gravity in the tracker's axes */
  SUPINE_STREAM_VOLUME,      /**< number [1]: mL above the posture's rest */
  SUPINE_STREAM_VOLUME_TEXT, /**< text: a volume as the command line takes it */
  SUPINE_STREAM_REQUEST      /**< text: what to send to this peer */
} supine_stream_kind;

typedef struct supine_stream_message {
  supine_stream_kind kind;
  double number[12];
  char text[64];
  const unsigned char *points; /**< [point_count] in the body */
  size_t point_count;
} supine_stream_message;

/** Read the name and position, mm, of a point of PLACES. The body must still exist. */
void supine_stream_message_point(const supine_stream_message *message, size_t point, char name[65],
                                 double position[3]);

/** Return whether the type of a message is one of those that supine_stream_message_read reads. */
int supine_stream_message_wanted(const supine_stream_header *header);

/** Read a body: TRANSFORM, QTDATA, POSITION, POINT; NDARRAY [3] (the direction of gravity), all of
 * device `device`
 * (QTDATA: of that instrument; TRANSFORM and POINT also of other devices, as places); NDARRAY [1]
 * and STRING of device "VOLUME"; STRING of device "SEND". Numbers may be not-a-number.
 * @param device  NULL: any
 * @retval SUPINE_ERROR_FORMAT  a wrong CRC, or lengths that contradict each other */
supine_status supine_stream_message_read(const supine_stream_header *header,
                                         const unsigned char *body, const char *device,
                                         supine_stream_message *message, supine_error *error);

/** Write the beginning of an NDARRAY of `count` 32-bit floats; return its size, 4. */
size_t supine_stream_ndarray_head(size_t count, unsigned char *bytes);

/** Write the beginning of a POLYDATA of points and `size` bytes of triangle strips; return its
 * size, 40.
 * @param attributes  1: a number per point follows the triangles; else 0 */
size_t supine_stream_polydata_head(size_t points, size_t strips, size_t size, size_t attributes,
                                   unsigned char *bytes);

/** Write the beginning of that attribute, "expected_error_mm"; return its size, 24. */
enum { SUPINE_STREAM_ATTRIBUTE = 24 };
size_t supine_stream_attribute_head(size_t points, unsigned char *bytes);

/** Write big-endian 32-bit floats. */
void supine_stream_put_floats(size_t count, const float *values, unsigned char *bytes);

/* The checksum of messages: CRC-64 of ECMA-182, most significant bit first, from 0,
 *
 *     crc(M) = M(x) x^64 mod P,     P = x^64 + 0x42F0E1EBA9EA3693
 *
 * It is linear, so that the checksums of two parts give that of the whole. */

/** Continue from `crc` (0 at first) over more bytes. Thread-safe. */
uint64_t supine_stream_crc64(uint64_t crc, const void *bytes, size_t size);

/** Compute x^(8 size) mod P, by which `size` further bytes multiply a checksum. */
uint64_t supine_stream_crc64_power(size_t size);

/** Join checksums: crc(A B) = crc(A) x^(8 |B|) + crc(B).
 * @param power  supine_stream_crc64_power of the second part's size */
uint64_t supine_stream_crc64_join(uint64_t first, uint64_t second, uint64_t power);

#endif
