/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * One peer: what it says, and the frame that is on its way to it. Nothing here waits.
 *
 * A peer that is slow misses frames: the next one it gets is the newest there is when the last has
 * left, never one of a queue. */
#ifndef SUPINE_STREAM_PEER_H
#define SUPINE_STREAM_PEER_H

#include "program/stream/frame.h"
#include "program/stream/message.h"

typedef struct supine_stream_peer {
  int socket;        /**< socket; -1: no peer */
  bool connecting;   /**< not yet there */
  double took, said; /**< when the peer last took data, and last sent some, s */
  /* received data */
  unsigned char raw[SUPINE_STREAM_HEADER];
  size_t got; /**< of the header, then of the body */
  bool in_body;
  supine_stream_header header;
  uint64_t skip;       /**< bytes of a body that is not read */
  unsigned char *body; /**< [SUPINE_STREAM_BODY_MAX] */
  double heard;        /**< s, when everything it had sent had been read */
  /* data to send */
  supine_stream_what what;
  unsigned version; /**< version of headers: that of the peer's own; 1 until it sends one */
  bool knows_triangles;
  uint64_t begun;             /**< number of the frame that was begun last */
  supine_stream_frame *frame; /**< on its way; NULL: none */
  supine_stream_parcel parcel;
  size_t sent; /**< of the parcel */
} supine_stream_peer;

/** Result of reading or sending. */
typedef enum supine_stream_outcome {
  SUPINE_STREAM_DONE = 0, /**< all there was */
  SUPINE_STREAM_MORE,     /**< there may be more: read: this pass's share is used up; sent: the rest
                               must wait until the socket takes it */
  SUPINE_STREAM_LOST      /**< the peer is gone, or sent what is no message */
} supine_stream_outcome;

/** @retval SUPINE_ERROR_MEMORY; the socket stays the caller's then */
supine_status supine_stream_peer_begin(supine_stream_peer *peer, int socket, bool connecting,
                                       supine_stream_what what, double now, supine_error *error);
/** Closes the socket and leaves the frame. */
void supine_stream_peer_end(supine_stream_peer *peer, supine_stream_frames *frames);

/** Called for each message whose body is worth reading; the body lies in `peer->body`. */
typedef void supine_stream_hear(void *context, supine_stream_peer *peer);

/** Reads what has come, up to a share of 64 KiB. Bodies of other types are passed over by their
 * length; a message that claims more than 256 MiB, or is no message, loses the peer.
 * @param skipped  counts messages that were passed over
 * @param error    says why the peer is lost, where it is its own fault; else untouched */
supine_stream_outcome supine_stream_peer_read(supine_stream_peer *peer, double now,
                                              supine_stream_hear *hear, void *context,
                                              uint64_t *skipped, supine_error *error);

/** Return whether no frame is in transit, here or in the kernel's queue. */
bool supine_stream_peer_ready(const supine_stream_peer *peer);

/** Begins a frame.
 * @retval false  memory is short */
bool supine_stream_peer_give(supine_stream_peer *peer, supine_stream_frames *frames,
                             supine_stream_frame *frame, double now);

/** Sends what the socket takes, up to a share of 1 MiB, so that no peer holds up the others. When
 * the frame has left, `peer->frame` is still it; the caller leaves it. */
supine_stream_outcome supine_stream_peer_send(supine_stream_peer *peer, double now);

#endif
