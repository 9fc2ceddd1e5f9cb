/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Receive messages from one peer, and send frames to it, without blocking.
 *
 * A slow peer misses frames: when it has received a frame, it is sent the newest one. */
#ifndef SUPINE_STREAM_PEER_H
#define SUPINE_STREAM_PEER_H

#include <sys/socket.h>

#include "program/stream/frame.h"
#include "program/stream/message.h"

typedef struct supine_stream_address {
  struct sockaddr_storage where;
  socklen_t size;
  char host[256]; /**< as written, without brackets */
  int port;
} supine_stream_address;

/** Parse "PORT" (on 127.0.0.1), "HOST:PORT" or "[HOST]:PORT".
 * @param numeric  true: refuse host names
 * @retval SUPINE_ERROR_ARGUMENT  no such address */
supine_status supine_stream_address_read(const char *text, bool numeric,
                                         supine_stream_address *address, supine_error *error);

/** Return a non-blocking socket that listens at the address; -1, with the error set, on failure.
 * @param port  set to the port that it listens on */
int supine_stream_address_listen(const supine_stream_address *address, int *port,
                                 supine_error *error);

/** Return a non-blocking socket that is connecting to the address; -1 if that fails at once. */
int supine_stream_address_connect(const supine_stream_address *address);

typedef struct supine_stream_peer {
  int socket;      /**< -1: no peer */
  bool connecting; /**< not yet connected */
  /* received data */
  unsigned char header_bytes[SUPINE_STREAM_HEADER];
  size_t received; /**< bytes received of the body if in_body, else of the header */
  bool in_body;
  supine_stream_header header;
  uint64_t to_skip;    /**< bytes still to come of a body that is not read */
  unsigned char *body; /**< [SUPINE_STREAM_BODY_MAX] */
  double emptied;      /**< when the socket was last found empty, s of the clock */
  /* data to send */
  supine_stream_content content;
  bool knows_triangles;        /**< triangles were sent: the next POINTS message omits them */
  uint64_t last_frame;         /**< number of the last frame given to the peer */
  supine_stream_frame *frame;  /**< frame being sent; NULL: none */
  supine_stream_packet packet; /**< part of its message that is not yet sent */
} supine_stream_peer;

/** Result of reading or sending. */
typedef enum supine_stream_outcome {
  SUPINE_STREAM_DONE = 0, /**< all received bytes are read, or the message is sent */
  SUPINE_STREAM_MORE,     /**< more to read or to send: call again */
  SUPINE_STREAM_LOST      /**< the peer is gone, or sent something that is not a message */
} supine_stream_outcome;

/** Begin a peer, which owns the socket from then on. The kernel closes the connection if data that
 * was sent is not acknowledged for 20 s.
 * @param now  s of the clock
 * @retval SUPINE_ERROR_MEMORY  the caller still owns the socket */
supine_status supine_stream_peer_begin(supine_stream_peer *peer, int socket, bool connecting,
                                       supine_stream_content content, double now,
                                       supine_error *error);
/** Close the socket and release the frame and the body. */
void supine_stream_peer_end(supine_stream_peer *peer, supine_stream_frames *frames);

/** Called for each message of a known type; its body is in `peer->body`. */
typedef void supine_stream_receive(void *context, supine_stream_peer *peer);

/** Read received bytes, up to 64 KiB. Messages of other types are skipped; the peer is lost where
 * it sends something that is not a message, or one above 256 MiB.
 * @param skipped  incremented for each skipped message
 * @param error    set if the peer is lost because of what it sent, else unchanged */
supine_stream_outcome supine_stream_peer_read(supine_stream_peer *peer, double now,
                                              supine_stream_receive *receive, void *context,
                                              uint64_t *skipped, supine_error *error);

/** Return whether a frame can be sent: the peer wants frames, and all earlier ones have left the
 * kernel's queue. */
bool supine_stream_peer_ready(const supine_stream_peer *peer);

/** Make the message of a frame for the peer, to be sent. */
void supine_stream_peer_give(supine_stream_peer *peer, supine_stream_frames *frames,
                             supine_stream_frame *frame);

/** Send as much as the socket's buffer accepts. When all is sent, the caller releases
 * `peer->frame`. */
supine_stream_outcome supine_stream_peer_send(supine_stream_peer *peer);

#endif
