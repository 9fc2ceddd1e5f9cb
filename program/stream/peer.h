/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Receive messages from one peer, and send frames to it, without blocking.
 *
 * A slow peer misses frames: after each complete frame it is sent the newest one. */
#ifndef SUPINE_STREAM_PEER_H
#define SUPINE_STREAM_PEER_H

#include <sys/socket.h>

#include "program/stream/frame.h"
#include "program/stream/message.h"

typedef struct supine_stream_address {
  struct sockaddr_storage where;
  socklen_t size;
  char host[256]; /**< as the user wrote it, without brackets */
  int port;
} supine_stream_address;

/** Parse "PORT" (on 127.0.0.1), "HOST:PORT" or "[HOST]:PORT".
 * @param numeric  true to refuse host names */
supine_status supine_stream_address_read(const char *text, bool numeric,
                                         supine_stream_address *address, supine_error *error);

/** Make a socket or pipe non-blocking, and close it in programs that this one starts. Return it. */
int supine_stream_nonblocking(int descriptor);

/** Open a non-blocking socket that listens at the address; on failure return -1 and set the error.
 * @param port  set to the port on which the socket listens */
int supine_stream_address_listen(const supine_stream_address *address, int *port,
                                 supine_error *error);

/** Open a non-blocking socket and begin to connect it to the address; return -1 on failure. */
int supine_stream_address_connect(const supine_stream_address *address);

enum { SUPINE_STREAM_MESSAGE_MAX = SUPINE_STREAM_HEADER + SUPINE_STREAM_BODY_MAX };

typedef struct supine_stream_peer {
  int socket; /**< -1 if there is no peer */
  bool connecting;
  unsigned char *message; /**< [SUPINE_STREAM_MESSAGE_MAX] header and body being received */
  uint64_t received;      /**< bytes received of the message */
  uint64_t size;          /**< size of the message, bytes; until it is known, of its header */
  bool in_body;           /**< true if `header` is known */
  supine_stream_header header;
  double active;  /**< time of the last message received or frame sent, s by supine_clock_seconds */
  double given;   /**< time when the last frame was given to the peer, s by supine_clock_seconds */
  bool repeated;  /**< true if the frame being sent was sent before */
  double emptied; /**< time when no received data was left to read, s by supine_clock_seconds */
  supine_stream_content content; /**< kind of content that the peer is sent */
  bool knows_triangles; /**< true if the peer has received the triangles with a frame of points */
  uint64_t last_frame;  /**< serial number of the last frame given to the peer */
  supine_stream_frame *frame;  /**< frame being sent; NULL if none */
  supine_stream_packet packet; /**< unsent part of the message of `frame` */
  /** Message that says why one from the peer is refused, and how much of it is sent, bytes. */
  unsigned char status[SUPINE_STREAM_STATUS_MAX];
  size_t status_size, status_sent;
} supine_stream_peer;

typedef enum supine_stream_outcome {
  SUPINE_STREAM_DONE = 0, /**< all bytes are read, or the whole message is sent */
  SUPINE_STREAM_MORE,     /**< bytes are left to read or to send: call again */
  SUPINE_STREAM_LOST      /**< the peer closed the connection, or sent invalid data */
} supine_stream_outcome;

/** Initialise a peer, which then owns the socket. The kernel closes the connection if sent data
 * stays unacknowledged for 20 s.
 * @param now      current time, s by supine_clock_seconds
 * @param message  [SUPINE_STREAM_MESSAGE_MAX] buffer for received messages */
void supine_stream_peer_begin(supine_stream_peer *peer, int socket, bool connecting,
                              supine_stream_content content, double now, unsigned char *message);
/** Close the socket, and release the frame that was being sent. */
void supine_stream_peer_end(supine_stream_peer *peer, supine_stream_frames *frames);

/** Function that is called for each message; it is in `peer->message`. */
typedef void supine_stream_receive(void *context, supine_stream_peer *peer);

/** Read up to 64 KiB of received bytes, and call `receive` for each complete message. Messages
 * with larger bodies than SUPINE_STREAM_BODY_MAX are skipped.
 * @param skipped  incremented for each skipped message
 * @param error    set if the peer sent an invalid header or a body above 256 MiB, else unchanged */
supine_stream_outcome supine_stream_peer_read(supine_stream_peer *peer, double now,
                                              supine_stream_receive *receive, void *context,
                                              size_t *skipped, supine_error *error);

/** Return whether the kernel has sent all bytes of earlier frames. */
bool supine_stream_peer_ready(const supine_stream_peer *peer);

/** Prepare a STATUS that tells the peer why its message is refused, unless an earlier one is
 * unsent.
 * @param device  device name of the message */
void supine_stream_peer_tell(supine_stream_peer *peer, const char *device, const char *text);

/** Return whether a part of a STATUS is unsent. */
bool supine_stream_peer_has_status(const supine_stream_peer *peer);

/** Send what the socket's buffer accepts of a STATUS, if there is one and no frame is being sent.
 */
supine_stream_outcome supine_stream_peer_send_status(supine_stream_peer *peer);

/** Prepare the message of a frame for supine_stream_peer_send. */
void supine_stream_peer_give(supine_stream_peer *peer, supine_stream_frames *frames,
                             supine_stream_frame *frame);

/** Send what the socket's buffer accepts. The caller releases `peer->frame` when all is sent. */
supine_stream_outcome supine_stream_peer_send(supine_stream_peer *peer);

#endif
