/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Encode a state of the lungs as OpenIGTLink messages, once for any number of peers.
 *
 * A weights message is an NDARRAY of K + 3 G floats: the K weights, then the gains x, y, z of each
 * of the G lungs. A surface message is a POLYDATA; if the lungs were located from observed points,
 * it has the expected error of each vertex as an attribute. The triangle strips and their checksum
 * are computed once; the checksum of a message is joined from the checksums of its parts. */
#ifndef SUPINE_STREAM_FRAME_H
#define SUPINE_STREAM_FRAME_H

#include <stdbool.h>
#include <sys/uio.h>

#include "program/stream/message.h"
#include <supine/locate.h>

/** Content sent to a peer. */
typedef enum supine_stream_content {
  SUPINE_STREAM_WEIGHTS = 0,
  SUPINE_STREAM_POINTS,  /**< POLYDATA: triangles in the first frame only */
  SUPINE_STREAM_SURFACE, /**< POLYDATA: triangles in every frame, as most viewers need them */
  SUPINE_STREAM_SILENCE,
  SUPINE_STREAM_CONTENT_COUNT
} supine_stream_content;

/** "weights", "points", "surface", "nothing", NULL. */
extern const char *const supine_stream_content_names[SUPINE_STREAM_CONTENT_COUNT + 1];

/** State of the lungs at one time. */
typedef struct supine_stream_snapshot {
  double gravity[3]; /**< unit */
  double volume;     /**< mL of all lungs together, gas and tissue */
  double above;      /**< mL above rest in the posture, or above the scan where rest is unknown */
  uint64_t stamp;    /**< time of the pose, as in supine_stream_header */
  double received;   /**< when the newest pose or volume was received, s of supine_clock_seconds;
                          < 0: none since the previous frame */
  double pose_received; /**< when the newest pose was received, s; < 0: no pose yet */
  supine_pose pose;
  const supine_location *location; /**< NULL: no points were observed */
} supine_stream_snapshot;

/** A frame that peers share. */
typedef struct supine_stream_frame {
  size_t users;    /**< peers that send it, and the server while it is the newest */
  uint64_t number; /**< 1, 2, ... */
  supine_stream_snapshot snapshot;
  bool has_points; /**< `points` and `points_crc` are computed */
  float *points;   /**< [N, 3] positions as sent: big-endian */
  uint64_t points_crc;
  unsigned char *errors;            /**< expected errors as sent, valid if the lungs were located */
  struct supine_stream_frame *next; /**< in the list of unused frames */
} supine_stream_frame;

/** Data shared by the frames of a basis. */
typedef struct supine_stream_frames supine_stream_frames;

/** Create the data shared by the frames of a basis.
 * @param basis   must outlive the frames
 * @param device  device name of the messages, up to 20 characters
 * @param ras     points in RAS instead of LPS
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_frames_create(const supine_basis *basis, const char *device, bool ras,
                                          supine_stream_frames **frames, supine_error *error);
/** Release the data and every frame; NULL is legal. */
void supine_stream_frames_destroy(supine_stream_frames *frames);

/** Return a frame of a snapshot, with one user; NULL if out of memory. Frames without users are
 * reused. */
supine_stream_frame *supine_stream_frame_acquire(supine_stream_frames *frames,
                                                 const supine_stream_snapshot *snapshot);
/** Remove one user of a frame; NULL is legal. */
void supine_stream_frame_release(supine_stream_frames *frames, supine_stream_frame *frame);

/** Largest number of pieces of a message, and largest size of the first piece, which holds a
 * weights message whole. */
enum {
  SUPINE_STREAM_PIECES = 4,
  SUPINE_STREAM_FRONT = SUPINE_STREAM_HEADER + 40 + 4 * (SUPINE_MODES_MAX + 3 * SUPINE_LUNGS_MAX)
};

/** A message to send, in pieces; `front` is the first piece. */
typedef struct supine_stream_packet {
  unsigned char front[SUPINE_STREAM_FRONT];
  struct iovec piece[SUPINE_STREAM_PIECES];
  int first, count; /**< index of the first piece not sent completely; number of pieces */
  size_t size;      /**< length of the whole message, bytes */
} supine_stream_packet;

/** Make the message of a frame, with a header of version 1, which all peers read. The first message
 * of a frame that needs positions computes them.
 * @param content    not SUPINE_STREAM_SILENCE
 * @param triangles  true: a POLYDATA also holds the triangles */
void supine_stream_frame_pack(supine_stream_frames *frames, supine_stream_frame *frame,
                              supine_stream_content content, bool triangles,
                              supine_stream_packet *packet);

#endif
