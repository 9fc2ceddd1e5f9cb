/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Encode a state of the lungs as OpenIGTLink messages, once for any number of peers.
 *
 * A message of weights is an NDARRAY of floats: the weight of each mode (for each lung, if
 * supine_basis_info.order is above 0), then three gains of each lung, the factors that multiply the
 * displacement along x, y and z. A message of points is a
 * POLYDATA. If the lungs were fitted to observed points, it has the expected error of each vertex
 * as an attribute. The triangle strips are computed once. */
#ifndef SUPINE_STREAM_FRAME_H
#define SUPINE_STREAM_FRAME_H

#include <stdbool.h>
#include <sys/uio.h>

#include "program/stream/message.h"
#include <supine/locate.h>

/** Content sent to a peer. */
typedef enum supine_stream_content {
  SUPINE_STREAM_WEIGHTS = 0, /**< NDARRAY of mode weights and displacement factors */
  SUPINE_STREAM_POINTS,      /**< POLYDATA, with triangles only in the first frame for a peer */
  SUPINE_STREAM_SURFACE,     /**< POLYDATA with triangles in every frame, as most viewers require */
  SUPINE_STREAM_SILENCE,
  SUPINE_STREAM_CONTENT_COUNT
} supine_stream_content;

/** Names of the contents by their number: "weights", "points", "surface", "nothing"; then NULL. */
extern const char *const supine_stream_content_names[SUPINE_STREAM_CONTENT_COUNT + 1];

/** State of the lungs at one time. */
typedef struct supine_stream_snapshot {
  double gravity[3]; /**< direction of gravity, a unit vector in body axes */
  double volume;     /**< volume of all lungs together, gas and tissue, mL */
  double above;      /**< volume above rest (above the scan if rest is unknown), mL */
  uint64_t stamp;    /**< time stamp of the newest pose or observed point, 2^-32 s since 1970 */
  double received;   /**< time of receipt of the newest message, s by supine_clock_seconds; negative
                        if none was received since the previous frame */
  double pose_received; /**< time of receipt of the newest pose or observed point, s by
                           supine_clock_seconds; -1 if none */
  supine_pose pose;
  const supine_location *location; /**< fit of the lungs to observed points, or NULL */
} supine_stream_snapshot;

/** A state of the lungs, which is encoded once and sent to several peers. */
typedef struct supine_stream_frame {
  size_t users;    /**< peers that it is being sent to, plus 1 for the newest frame */
  uint64_t number; /**< serial number: 1, 2, ... */
  supine_stream_snapshot snapshot;
  bool has_points;       /**< true if `points` are computed */
  float *points;         /**< [N, 3] positions as sent, big-endian */
  unsigned char *errors; /**< bytes of the POLYDATA attribute with the expected error of each
                            vertex; unused if snapshot.location is NULL */
  struct supine_stream_frame *next; /**< next frame in the list of unused frames */
} supine_stream_frame;

typedef struct supine_stream_frames supine_stream_frames;

/** Create the data shared by the frames of a basis.
 * @param basis   must outlive the frames
 * @param device  device name of the messages, up to 20 characters
 * @param ras     true to send points in RAS, false to send them in LPS */
supine_status supine_stream_frames_create(const supine_basis *basis, const char *device, bool ras,
                                          supine_stream_frames **frames, supine_error *error);
/** Release the shared data and all frames, which must have no users; NULL is legal. */
void supine_stream_frames_destroy(supine_stream_frames *frames);

/** Return a new or reused frame that shows a snapshot and has one user; NULL if out of memory. */
supine_stream_frame *supine_stream_frame_acquire(supine_stream_frames *frames,
                                                 const supine_stream_snapshot *snapshot);
/** Remove one user of a frame. A frame without users may be reused. NULL is legal. */
void supine_stream_frame_release(supine_stream_frames *frames, supine_stream_frame *frame);

enum {
  SUPINE_STREAM_PIECES = 4, /* largest number of pieces (ranges of bytes) of a message */
  /* Size of the buffer for the first piece, bytes, with room for a whole message of weights. */
  SUPINE_STREAM_FRONT = SUPINE_STREAM_HEADER + 40 + 4 * (SUPINE_MODES_MAX + 3 * SUPINE_LUNGS_MAX)
};

/** A message to send, as a list of ranges of bytes (pieces). The first piece is in `front`. */
typedef struct supine_stream_packet {
  unsigned char front[SUPINE_STREAM_FRONT];
  struct iovec piece[SUPINE_STREAM_PIECES];
  int first, count; /**< index of the first piece with unsent bytes; number of pieces */
  size_t size;      /**< size of the whole message, bytes */
} supine_stream_packet;

/** Make the message of a frame, with a header of version 1, which all peers can read. The positions
 * of a frame are computed when a message first contains them.
 * @param content    any but SUPINE_STREAM_SILENCE
 * @param triangles  true if a POLYDATA must also contain the triangles */
void supine_stream_frame_pack(supine_stream_frames *frames, supine_stream_frame *frame,
                              supine_stream_content content, bool triangles,
                              supine_stream_packet *packet);

#endif
