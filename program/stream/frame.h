/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Frames: a moment of the lungs as messages, made once and sent to any number of peers.
 *
 * A weights frame is an NDARRAY of K + 3 G floats: the K weights and the gains x, y, z of each
 * lung. A surface frame is a POLYDATA; where points are observed, located, and each point's
 * expected error is an attribute. Its triangles never change: they are made into strips once, their
 * checksum is known, and every frame's checksum is joined from the points' and theirs. */
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

/** "weights", "points", "surface", "nothing"; NULL past the last. */
const char *supine_stream_what_name(supine_stream_what what);

/** The lungs at one time. */
typedef struct supine_stream_moment {
  double gravity[3]; /**< unit */
  double volume;     /**< mL of all lungs together, gas and tissue */
  double above;      /**< mL above the posture's rest, or the scan where no rest is known */
  uint64_t stamp;    /**< time of the pose, as in headers */
  double received;   /**< when the pose came, s of supine_clock_seconds; < 0: no pose did */
  supine_pose pose;
  const supine_location *location; /**< NULL: no points were observed */
} supine_stream_moment;

/** A frame that peers share. */
typedef struct supine_stream_frame {
  size_t users;
  uint64_t number; /**< 1, 2, ... */
  supine_stream_moment moment;
  bool placed;           /**< `points` hold this moment's, which a peer wanted */
  unsigned char *points; /**< [N] 12 bytes as on the wire */
  uint64_t points_crc;
  unsigned char
      *errors; /**< the attribute of a located frame as on the wire; NULL: never was one */
  struct supine_stream_frame *next; /**< next frame in the list of unused ones */
} supine_stream_frame;

/** What frames of one basis share. */
typedef struct supine_stream_frames supine_stream_frames;

/** @param device  the device name that messages carry, up to 20 characters
 * @param ras      points in RAS instead of LPS
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_frames_create(const supine_basis *basis, const char *device, bool ras,
                                          supine_stream_frames **frames, supine_error *error);
/** Releases it and every frame. */
void supine_stream_frames_destroy(supine_stream_frames *frames);

/** A frame with one user, of its number and moment; NULL where memory is short. Frames that no one
 * uses are used again. */
supine_stream_frame *supine_stream_frame_take(supine_stream_frames *frames,
                                              const supine_stream_moment *moment);
void supine_stream_frame_leave(supine_stream_frames *frames, supine_stream_frame *frame);

/** Most pieces of a message, and most bytes before its points: a weights frame whole. */
enum {
  SUPINE_STREAM_PIECES = 5,
  SUPINE_STREAM_FRONT = SUPINE_STREAM_HEADER + SUPINE_STREAM_EXTENSION + 40 +
                        4 * (SUPINE_MODES_MAX + 3 * SUPINE_LUNGS_MAX) + SUPINE_STREAM_METADATA
};

/** A message on its way: pieces, the first of them in `front`. */
typedef struct supine_stream_parcel {
  unsigned char front[SUPINE_STREAM_FRONT];
  struct iovec piece[SUPINE_STREAM_PIECES];
  int count;
  size_t size; /**< total length of the pieces, bytes */
} supine_stream_parcel;

/** Wraps a frame: `what` but silence, triangles or not, a header of version 1 or 2. The first time
 * that points are wanted of a frame, this computes them.
 * @retval false  memory is short */
bool supine_stream_frame_wrap(supine_stream_frames *frames, supine_stream_frame *frame,
                              supine_stream_what what, bool triangles, unsigned version,
                              supine_stream_parcel *parcel);

#endif
