/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Frames: a state of the lungs as messages, made once and sent to any number of peers.
 *
 * A weights frame is an NDARRAY of K + 3 G floats: the K weights, then the gains x, y, z of each
 * lung. A surface frame is a POLYDATA; lungs located from observed points have their expected
 * errors as an attribute. The triangles are made into strips and their checksum is computed once;
 * each frame's checksum is joined from those of its parts. */
#ifndef SUPINE_STREAM_FRAME_H
#define SUPINE_STREAM_FRAME_H

#include <stdbool.h>
#include <sys/uio.h>

#include "program/stream/message.h"
#include <supine/locate.h>

/** Content sent to a peer. */
typedef enum supine_stream_what {
  SUPINE_STREAM_WEIGHTS = 0,
  SUPINE_STREAM_POINTS,  /**< POLYDATA: triangles in the first frame only */
  SUPINE_STREAM_SURFACE, /**< POLYDATA: triangles in every frame, as most viewers need them */
  SUPINE_STREAM_SILENCE,
  SUPINE_STREAM_WHAT_COUNT
} supine_stream_what;

/** "weights", "points", "surface", "nothing", NULL. */
extern const char *const supine_stream_what_names[SUPINE_STREAM_WHAT_COUNT + 1];

/** State of the lungs at a time. */
typedef struct supine_stream_moment {
  double gravity[3]; /**< unit */
  double volume;     /**< mL of all lungs together, gas and tissue */
  double above;      /**< mL above rest in the posture, or above the scan where rest is unknown */
  uint64_t stamp;    /**< time of the pose, as in headers */
  double received;   /**< s of supine_clock_seconds, when the newest pose or volume was received;
                          < 0: none since the previous frame */
  double posed;      /**< the same of the newest pose; < 0: none */
  supine_pose pose;
  const supine_location *location; /**< NULL: no points were observed */
} supine_stream_moment;

/** A frame that peers share. */
typedef struct supine_stream_frame {
  size_t users;    /**< peers that send it, and the server while it is the newest */
  uint64_t number; /**< 1, 2, ... */
  supine_stream_moment moment;
  bool placed;           /**< `points` are computed */
  unsigned char *points; /**< [N] 12 bytes as on the wire */
  uint64_t points_crc;
  unsigned char *errors; /**< expected errors as on the wire, where lungs were located; or NULL */
  struct supine_stream_frame *next; /**< in the list of unused frames */
} supine_stream_frame;

/** Data shared by the frames of a basis. */
typedef struct supine_stream_frames supine_stream_frames;

/** Create the data shared by the frames of a basis.
 * @param basis   must outlive it
 * @param device  device name of the messages, up to 20 characters
 * @param ras     points in RAS instead of LPS
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_frames_create(const supine_basis *basis, const char *device, bool ras,
                                          supine_stream_frames **frames, supine_error *error);
/** Release the data and every frame; NULL is legal. */
void supine_stream_frames_destroy(supine_stream_frames *frames);

/** Return a frame of a moment, with one user; NULL where memory is short. Reuse one without users
 * if there is one. */
supine_stream_frame *supine_stream_frame_take(supine_stream_frames *frames,
                                              const supine_stream_moment *moment);
/** Remove one user of a frame; NULL is legal. */
void supine_stream_frame_leave(supine_stream_frames *frames, supine_stream_frame *frame);

/** Largest number of pieces of a message, and largest size of the first: of a weights frame, the
 * whole message. */
enum {
  SUPINE_STREAM_PIECES = 4,
  SUPINE_STREAM_FRONT = SUPINE_STREAM_HEADER + 40 + 4 * (SUPINE_MODES_MAX + 3 * SUPINE_LUNGS_MAX)
};

/** A message in pieces, the first of which is `front`. */
typedef struct supine_stream_parcel {
  unsigned char front[SUPINE_STREAM_FRONT];
  struct iovec piece[SUPINE_STREAM_PIECES];
  int first, count; /**< first piece that is not sent yet; number of pieces */
  size_t size;      /**< total length of the pieces, bytes */
} supine_stream_parcel;

/** Make the message of a frame, with a header of version 1, which all peers read. The first message
 * with points computes them.
 * @param what       not SILENCE
 * @param triangles  whether a message with points also holds the triangles
 * @return false where memory is short */
bool supine_stream_frame_wrap(supine_stream_frames *frames, supine_stream_frame *frame,
                              supine_stream_what what, bool triangles,
                              supine_stream_parcel *parcel);

#endif
