/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read and write the socket of a peer without blocking. */
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>
#ifdef __linux__
#include <linux/sockios.h>
#endif

#include "program/stream/peer.h"

/* Size, bytes, above which a message body is an error. Smaller ones are skipped or read. */
static const uint64_t skipped_max = 256u << 20;

void supine_stream_peer_begin(supine_stream_peer *peer, int socket, bool connecting,
                              supine_stream_content content, double now, unsigned char *message) {
  const int yes = 1;
  (void)setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
  (void)setsockopt(socket, SOL_SOCKET, SO_KEEPALIVE, &yes, sizeof yes);
#ifdef TCP_USER_TIMEOUT /* Linux; elsewhere, the system decides when a silent peer is gone */
  const unsigned timeout_ms = 20000;
  (void)setsockopt(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, &timeout_ms, sizeof timeout_ms);
#endif
  *peer = (supine_stream_peer){.socket = socket,
                               .connecting = connecting,
                               .message = message,
                               .size = SUPINE_STREAM_HEADER,
                               .active = now,
                               .given = now,
                               .emptied = now,
                               .content = content};
}

void supine_stream_peer_end(supine_stream_peer *peer, supine_stream_frames *frames) {
  (void)close(peer->socket);
  supine_stream_frame_release(frames, peer->frame);
  *peer = (supine_stream_peer){.socket = -1};
}

/* Receive up to `size` bytes; return their number: 0 if none are available, -1 if disconnected. */
static ssize_t receive_bytes(int socket, void *bytes, size_t size) {
  const ssize_t got = recv(socket, bytes, size, MSG_DONTWAIT);
  if (got > 0) {
    return got;
  }
  const bool none_yet = got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR);
  return none_yet ? 0 : -1;
}

/* Parse a complete header; return false if it is invalid. */
static bool begin_body(supine_stream_peer *peer, size_t *skipped, supine_error *error) {
  if (supine_stream_header_read(peer->message, &peer->header, error) != SUPINE_OK) {
    return false;
  }
  const uint64_t size = peer->header.size;
  if (size > skipped_max) {
    (void)supine_error_set(error, SUPINE_ERROR_FORMAT,
                           "a message has %llu bytes: send at most 256 MiB",
                           (unsigned long long)size);
    return false;
  }
  peer->in_body = true;
  peer->size += size;
  *skipped += size > SUPINE_STREAM_BODY_MAX;
  return true;
}

supine_stream_outcome supine_stream_peer_read(supine_stream_peer *peer, double now,
                                              supine_stream_receive *receive, void *context,
                                              size_t *skipped, supine_error *error) {
  size_t allowed = SUPINE_STREAM_BODY_MAX;
  while (allowed > 0) {
    const bool skips = peer->size > SUPINE_STREAM_MESSAGE_MAX; /* overwrite the start of the body */
    const uint64_t left = peer->size - peer->received;
    const ssize_t got =
        receive_bytes(peer->socket, peer->message + (skips ? SUPINE_STREAM_HEADER : peer->received),
                      left < allowed ? (size_t)left : allowed);
    if (got < 0) {
      return SUPINE_STREAM_LOST;
    }
    if (got == 0) {
      peer->emptied = now;
      return SUPINE_STREAM_DONE;
    }
    allowed -= (size_t)got;
    peer->received += (uint64_t)got;
    if (peer->received == peer->size && !peer->in_body && !begin_body(peer, skipped, error)) {
      return SUPINE_STREAM_LOST;
    }
    if (peer->received == peer->size) {
      if (!skips) {
        receive(context, peer);
      }
      peer->active = now;
      peer->in_body = false;
      peer->received = 0;
      peer->size = SUPINE_STREAM_HEADER;
    }
  }
  return SUPINE_STREAM_MORE;
}

bool supine_stream_peer_ready(const supine_stream_peer *peer) {
  int queued = 0;
#ifdef SO_NWRITE /* macOS counts what is sent but not yet acknowledged, too */
  return getsockopt(peer->socket, SOL_SOCKET, SO_NWRITE, &queued, &(socklen_t){sizeof queued}) ==
             0 &&
         queued == 0;
#else
  return ioctl(peer->socket, SIOCOUTQNSD, &queued) == 0 && queued == 0;
#endif
}

void supine_stream_peer_tell(supine_stream_peer *peer, const char *device, const char *text) {
  if (!supine_stream_peer_has_status(peer)) {
    peer->status_size = supine_stream_status_write(device, text, peer->status);
    peer->status_sent = 0;
  }
}

bool supine_stream_peer_has_status(const supine_stream_peer *peer) {
  return peer->status_sent < peer->status_size;
}

supine_stream_outcome supine_stream_peer_send_status(supine_stream_peer *peer) {
  if (peer->connecting || peer->frame != NULL || !supine_stream_peer_has_status(peer)) {
    return SUPINE_STREAM_DONE;
  }
  const ssize_t sent = send(peer->socket, peer->status + peer->status_sent,
                            peer->status_size - peer->status_sent, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0) {
    return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR ? SUPINE_STREAM_MORE
                                                                     : SUPINE_STREAM_LOST;
  }
  peer->status_sent += (size_t)sent;
  return supine_stream_peer_has_status(peer) ? SUPINE_STREAM_MORE : SUPINE_STREAM_DONE;
}

void supine_stream_peer_give(supine_stream_peer *peer, supine_stream_frames *frames,
                             supine_stream_frame *frame) {
  const bool triangles = peer->content == SUPINE_STREAM_SURFACE ||
                         (peer->content == SUPINE_STREAM_POINTS && !peer->knows_triangles);
  supine_stream_frame_pack(frames, frame, peer->content, triangles, &peer->packet);
  peer->knows_triangles = peer->content == SUPINE_STREAM_POINTS;
  peer->repeated = peer->last_frame == frame->number;
  peer->last_frame = frame->number;
  peer->frame = frame;
  ++frame->users;
}

supine_stream_outcome supine_stream_peer_send(supine_stream_peer *peer) {
  supine_stream_packet *packet = &peer->packet;
  const struct msghdr message = {.msg_iov = packet->piece + packet->first,
                                 .msg_iovlen = (size_t)(packet->count - packet->first)};
  ssize_t sent = sendmsg(peer->socket, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0) {
    return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR ? SUPINE_STREAM_MORE
                                                                     : SUPINE_STREAM_LOST;
  }
  for (; packet->first < packet->count; ++packet->first) {
    struct iovec *piece = &packet->piece[packet->first];
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
