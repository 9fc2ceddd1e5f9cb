/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read and write the socket of a peer without blocking. */
#include <errno.h>
#include <linux/sockios.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "program/stream/peer.h"

/* Largest message that is skipped, such as an image; anything larger is taken for an error. */
static const uint64_t body_most = 256u << 20;

supine_status supine_stream_peer_begin(supine_stream_peer *peer, int socket, bool connecting,
                                       supine_stream_what what, double now, supine_error *error) {
  const int yes = 1;
  const unsigned patience = 20000; /* ms */
  unsigned char *body = malloc(SUPINE_STREAM_BODY_MAX);
  if (body == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  (void)setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  (void)setsockopt(socket, SOL_SOCKET, SO_KEEPALIVE, &yes, sizeof yes);
  (void)setsockopt(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, &patience, sizeof patience);
  *peer = (supine_stream_peer){
      .socket = socket, .connecting = connecting, .heard = now, .body = body, .what = what};
  return SUPINE_OK;
}

void supine_stream_peer_end(supine_stream_peer *peer, supine_stream_frames *frames) {
  if (peer->socket >= 0) {
    (void)close(peer->socket);
  }
  supine_stream_frame_leave(frames, peer->frame);
  free(peer->body);
  peer->socket = -1;
  peer->frame = NULL;
  peer->body = NULL;
}

/* Receive up to `size` bytes; return their number, 0 where none have come, -1 where the peer is
 * gone. */
static ssize_t receive_bytes(int socket, void *bytes, size_t size) {
  for (;;) {
    const ssize_t got = recv(socket, bytes, size, MSG_DONTWAIT);
    if (got > 0) {
      return got;
    }
    if (got == 0) {
      return -1;
    }
    if (errno != EINTR) {
      return errno == EAGAIN || errno == EWOULDBLOCK ? 0 : -1;
    }
  }
}

/* Parse a complete header, and choose whether to read or skip its body. */
static bool begin_body(supine_stream_peer *peer, uint64_t *skipped, supine_error *error) {
  if (supine_stream_header_read(peer->raw, &peer->header, error) != SUPINE_OK) {
    return false;
  }
  const uint64_t size = peer->header.size;
  if (size > body_most) {
    (void)supine_error_set(error, SUPINE_ERROR_FORMAT,
                           "it sent a message of %llu bytes: send at most 256 MiB",
                           (unsigned long long)size);
    return false;
  }
  peer->got = 0;
  peer->in_body = supine_stream_message_wanted(&peer->header) && size <= SUPINE_STREAM_BODY_MAX;
  if (!peer->in_body) {
    peer->skip = size;
    ++*skipped;
  }
  return true;
}

supine_stream_outcome supine_stream_peer_read(supine_stream_peer *peer, double now,
                                              supine_stream_receive *receive, void *context,
                                              uint64_t *skipped, supine_error *error) {
  unsigned char waste[4096];
  size_t share = 65536;
  while (share > 0) {
    unsigned char *into = peer->in_body ? peer->body + peer->got : peer->raw + peer->got;
    size_t size = (peer->in_body ? (size_t)peer->header.size : SUPINE_STREAM_HEADER) - peer->got;
    if (peer->skip > 0) {
      into = waste;
      size = peer->skip < sizeof waste ? (size_t)peer->skip : sizeof waste;
    }
    ssize_t got = 0;
    if (size > 0) {
      got = receive_bytes(peer->socket, into, size < share ? size : share);
      if (got < 0) {
        return SUPINE_STREAM_LOST;
      }
      if (got == 0) {
        peer->heard = now;
        return SUPINE_STREAM_DONE;
      }
      share -= (size_t)got;
    }
    if (peer->skip > 0) {
      peer->skip -= (uint64_t)got;
      continue;
    }
    peer->got += (size_t)got;
    if ((size_t)got < size) {
      continue;
    }
    if (!peer->in_body) {
      if (!begin_body(peer, skipped, error)) {
        return SUPINE_STREAM_LOST;
      }
      continue;
    }
    peer->in_body = false;
    peer->got = 0;
    receive(context, peer);
  }
  return SUPINE_STREAM_MORE;
}

bool supine_stream_peer_ready(const supine_stream_peer *peer) {
  int queued = 0;
  return peer->frame == NULL && !peer->connecting && peer->what != SUPINE_STREAM_SILENCE &&
         ioctl(peer->socket, SIOCOUTQNSD, &queued) == 0 && queued == 0;
}

bool supine_stream_peer_give(supine_stream_peer *peer, supine_stream_frames *frames,
                             supine_stream_frame *frame) {
  const bool triangles = peer->what == SUPINE_STREAM_SURFACE ||
                         (peer->what == SUPINE_STREAM_POINTS && !peer->knows_triangles);
  if (!supine_stream_frame_wrap(frames, frame, peer->what, triangles, &peer->parcel)) {
    return false;
  }
  peer->knows_triangles = peer->what == SUPINE_STREAM_POINTS;
  peer->begun = frame->number;
  peer->frame = frame;
  ++frame->users;
  return true;
}

supine_stream_outcome supine_stream_peer_send(supine_stream_peer *peer) {
  supine_stream_parcel *parcel = &peer->parcel;
  const struct msghdr message = {.msg_iov = parcel->piece + parcel->first,
                                 .msg_iovlen = (size_t)(parcel->count - parcel->first)};
  ssize_t sent = sendmsg(peer->socket, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0) {
    return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR ? SUPINE_STREAM_MORE
                                                                     : SUPINE_STREAM_LOST;
  }
  for (; parcel->first < parcel->count; ++parcel->first) {
    struct iovec *piece = &parcel->piece[parcel->first];
    const size_t passed = (size_t)sent < piece->iov_len ? (size_t)sent : piece->iov_len;
    piece->iov_base = (unsigned char *)piece->iov_base + passed;
    piece->iov_len -= passed;
    sent -= (ssize_t)passed;
    if (piece->iov_len > 0) {
      return SUPINE_STREAM_MORE;
    }
  }
  return SUPINE_STREAM_DONE;
}
