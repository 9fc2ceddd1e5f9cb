/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Read OpenIGTLink messages from untrusted bytes, and write them. All fields are big-endian; their
 * sizes in bytes are in parentheses:
 *
 *     header     version (2), type (12), device (20), time (8), body size (8), body CRC (8)
 *     body       in version 1: content; in versions 2 and 3: extension, content, metadata
 *     extension  its size (2), metadata index size (2), metadata size (4), message number (4)
 *
 * The extension has this layout in the OpenIGTLink library; the specification differs. Its size is
 * at least 12. Every length in a message is checked against the bytes received. */
#ifndef SUPINE_STREAM_MESSAGE_H
#define SUPINE_STREAM_MESSAGE_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

enum {
  SUPINE_STREAM_HEADER = 58,
  SUPINE_STREAM_EXTENSION = 12,
  SUPINE_STREAM_BODY_MAX = 65536 /* largest body that is read, bytes; larger bodies are skipped */
};

typedef struct supine_stream_header {
  unsigned version;
  char type[13];
  char device[21];
  uint64_t stamp; /**< time since 1970 in units of 2^-32 s; 0 if unknown */
  uint64_t size;  /**< size of the body, bytes */
  uint64_t crc;   /**< checksum of the body */
} supine_stream_header;

/** Read a header.
 * @retval SUPINE_ERROR_FORMAT  the version is not 1 to 3, or the type is not text. The start of
 *                              the next message is then unknown */
supine_status supine_stream_header_read(const unsigned char bytes[SUPINE_STREAM_HEADER],
                                        supine_stream_header *header, supine_error *error);
void supine_stream_header_write(const supine_stream_header *header,
                                unsigned char bytes[SUPINE_STREAM_HEADER]);

/** Kinds of received messages. Each comment says what a supine_stream_message then contains. */
typedef enum supine_stream_kind {
  SUPINE_STREAM_NOTHING = 0, /**< message that is ignored because of its type or device */
  SUPINE_STREAM_ROTATION,    /**< number[0..8]: matrix from tracker to world axes, row by row. If
                                  text is the name of the device, number[9..11]: position, mm */
  SUPINE_STREAM_POSITION,   /**< number[9..11]: position of an observed point, mm; text: its name */
  SUPINE_STREAM_POINT_LIST, /**< points: supine_stream_message_point reads one of them */
  SUPINE_STREAM_DOWN,       /**< number[0..2]: direction of gravity in tracker axes */
  SUPINE_STREAM_VOLUME,     /**< number[0]: volume above rest in the posture, mL */
  SUPINE_STREAM_VOLUME_TEXT, /**< text: a volume such as rest+500 or 2600mL */
  SUPINE_STREAM_REQUEST,     /**< text: name of the content that the peer asks for */
  SUPINE_STREAM_INVALID      /**< pose that the tracker marks as invalid */
} supine_stream_kind;

typedef struct supine_stream_message {
  supine_stream_kind kind;
  double number[12];
  char text[64];
  const unsigned char *points; /**< [point_count] points in the body of the message */
  size_t point_count;
} supine_stream_message;

/** Decode the name and position, mm, of one of message->points. The buffer of the message's body
 * must still exist. */
void supine_stream_message_point(const supine_stream_message *message, size_t point, char name[65],
                                 double position[3]);

/** Decode the body of a message. Its numbers may be infinite or not-a-number. These messages are
 * used, depending on the device name in the header. A QTDATA has the poses of several instruments:
 *
 *     device name  type          meaning
 *     `device`     TRANSFORM     rotation and position of the tracker
 *     `device`     POSITION      rotation of the tracker, as a quaternion
 *     `device`     NDARRAY of 3  direction of gravity
 *     `device`     QTDATA        rotation of the last instrument in the message
 *     another      TRANSFORM     position of the observed point with this name
 *     another      QTDATA        rotation of the instrument that is named `device` in the message
 *     any          POINT         positions of observed points
 *     "VOLUME"     NDARRAY of 1  volume above rest, mL
 *     "VOLUME"     STRING        volume such as rest+500
 *     "SEND"       STRING        name of the content that the peer asks for
 *
 * The metadata of versions 2 and 3 can mark a pose as invalid: PLUS does by the keys TransformValid
 * and TransformStatus, alone or at the end of another key.
 * @param device  device that gives the patient's pose; NULL if every device does */
supine_status supine_stream_message_read(const supine_stream_header *header,
                                         const unsigned char *body, const char *device,
                                         supine_stream_message *message, supine_error *error);

/** Write the first 40 bytes of a POLYDATA, which precede its points; return 40.
 * @param points, strips  numbers of points and of triangle strips
 * @param size            size of the triangle strips, bytes
 * @param attributes      number of attributes after the triangle strips, 0 or 1 */
size_t supine_stream_polydata_head(size_t points, size_t strips, size_t size, size_t attributes,
                                   unsigned char *bytes);

enum {
  SUPINE_STREAM_STATUS_TEXT = 400, /* longest text of a STATUS, bytes with its NUL */
  SUPINE_STREAM_STATUS_MAX = SUPINE_STREAM_HEADER + 30 + SUPINE_STREAM_STATUS_TEXT
};

/** Write a STATUS with the code 8, "can't be reached", and return its size. Its body has the code
 * (2), a subcode of 0 (8), the name "refused" of the error (20), and the text with a NUL.
 * @param device  device name of the message, up to 20 characters
 * @param text    cut off after SUPINE_STREAM_STATUS_TEXT - 1 bytes
 * @param bytes   [SUPINE_STREAM_STATUS_MAX] written */
size_t supine_stream_status_write(const char *device, const char *text, unsigned char *bytes);

enum { SUPINE_STREAM_ATTRIBUTE = 24 /* size of the head of an attribute of a POLYDATA, bytes */ };

/** Write the head of the attribute "expected_error_mm", which precedes one float for each point;
 * return its size, SUPINE_STREAM_ATTRIBUTE. */
size_t supine_stream_attribute_head(size_t points, unsigned char *bytes);

/** Convert floats to big-endian in place. */
void supine_stream_encode_floats(size_t count, float *values);

/* Messages have the checksum CRC-64 of ECMA-182, most significant bit first, initial value 0:
 *
 *     crc(M) = M(x) x^64 mod P,     P = x^64 + 0x42F0E1EBA9EA3693
 *
 * The bits of the message M are the coefficients of M(x). */

/** Extend `crc`, the checksum of the bytes so far, by `size` bytes; begin with 0. Thread-safe. */
uint64_t supine_stream_crc64(uint64_t crc, const void *bytes, size_t size);

#endif
