/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * OpenIGTLink messages as they lie on the wire: read without trust, written in place.
 *
 *     header 58   version 2, type 12, device 20, time 8, body's size 8, body's CRC 8; big-endian
 *     body        version 1: content. Version 2: extension, content, metadata
 *     extension   its size 2 (>= 12), metadata index's size 2, metadata's size 4, message number 4
 *
 * (The extension is as libraries of protocol 3 send it; the protocol's text has it otherwise, and
 * no one sends that.) Lengths from the wire are checked against what is there before anything is
 * read: the public library's own unpackers believe them. */
#ifndef SUPINE_STREAM_MESSAGE_H
#define SUPINE_STREAM_MESSAGE_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

enum {
  SUPINE_STREAM_HEADER = 58,
  SUPINE_STREAM_EXTENSION = 12,
  SUPINE_STREAM_METADATA = 2,    /* an index without entries, which readers of version 2 expect */
  SUPINE_STREAM_BODY_MAX = 65536 /* of the messages that are read: poses, volumes, wishes */
};

typedef struct supine_stream_header {
  unsigned version;
  char type[13];
  char device[21];
  uint64_t stamp; /**< seconds since 1970 x 2^32; 0: none */
  uint64_t size;  /**< of the body */
  uint64_t crc;   /**< of the body */
} supine_stream_header;

/** @retval SUPINE_ERROR_FORMAT  not version 1 or 2, or a type that is no text: what follows cannot
 *                               be found */
supine_status supine_stream_header_read(const unsigned char bytes[SUPINE_STREAM_HEADER],
                                        supine_stream_header *header, supine_error *error);
void supine_stream_header_write(const supine_stream_header *header,
                                unsigned char bytes[SUPINE_STREAM_HEADER]);

/** Content of a message. */
typedef enum supine_stream_kind {
  SUPINE_STREAM_NOTHING = 0, /**< ignored: another type or device */
  SUPINE_STREAM_ROTATION,    /**< number [9]: rows of the matrix from tracker to world axes, and
                                  [3]: where it is, mm; text: its device */
  SUPINE_STREAM_PLACE,       /**< the same of another device than the one that is followed */
  SUPINE_STREAM_PLACES,      /**< points: supine_stream_message_point */
  SUPINE_STREAM_QUATERNION,  /**< number [4]: W, X, Y, Z, the same */
  SUPINE_STREAM_DOWN,        /**< number [3]: where things fall, in the tracker's axes */
  SUPINE_STREAM_VOLUME,      /**< number [1]: mL above the posture's rest */
  SUPINE_STREAM_VOLUME_TEXT, /**< text: a volume as the command line takes it */
  SUPINE_STREAM_WISH         /**< text: what this peer wants to be sent */
} supine_stream_kind;

typedef struct supine_stream_message {
  supine_stream_kind kind;
  double number[12];
  char text[64];
  const unsigned char *points; /**< [point_count] in the body */
  size_t point_count;
} supine_stream_message;

/** Name and position, mm, of a point of PLACES, while its body is there. */
void supine_stream_message_point(const supine_stream_message *message, size_t point, char name[65],
                                 double position[3]);

/** Whether the body of such a message is worth reading: the types below of whatever device. */
int supine_stream_message_wanted(const supine_stream_header *header);

/** Reads a body: TRANSFORM, QTDATA, POSITION, POINT; NDARRAY [3] (where things fall) or SENSOR [3]
 * (an accelerometer at rest, which shows the other way); all of device `device` (QTDATA: of that
 * instrument; TRANSFORM and POINT of any, as places); NDARRAY [1] and STRING of device "VOLUME";
 * STRING of device "SEND". Numbers come as they are, not-a-number too.
 * @param device  NULL: any
 * @retval SUPINE_ERROR_FORMAT  a wrong CRC, or lengths that contradict each other */
supine_status supine_stream_message_read(const supine_stream_header *header,
                                         const unsigned char *body, const char *device,
                                         supine_stream_message *message, supine_error *error);

/** Number `index` of 4 bytes, big-endian. */
void supine_stream_put32(unsigned char *bytes, uint32_t value);

/** Head of an NDARRAY of `count` 32-bit floats; returns its size, 4. */
size_t supine_stream_ndarray_head(size_t count, unsigned char *bytes);

/** Head of a POLYDATA of points and strips of triangles, of `size` bytes; returns its own size, 40.
 * @param attributes  0, or 1: one number a point follows the triangles */
size_t supine_stream_polydata_head(size_t points, size_t strips, size_t size, size_t attributes,
                                   unsigned char *bytes);

/** Head of that attribute, "expected_error_mm"; returns its size, 24. */
enum { SUPINE_STREAM_ATTRIBUTE = 24 };
size_t supine_stream_attribute_head(size_t points, unsigned char *bytes);

/** The extension of a message of version 2 without metadata. */
void supine_stream_extension(uint32_t message, unsigned char bytes[SUPINE_STREAM_EXTENSION]);

/** Floats in the byte order of the wire, negative where `flip` says so: x and y of LPS as RAS. */
void supine_stream_put_points(size_t count, const float *xyz, int flip, unsigned char *bytes);

#endif
