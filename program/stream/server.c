/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Run the main loop: read messages, compute a frame for the newest pose, send the frame. */
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/arena.h"
#include "base/clock.h"
#include "program/options/command.h"
#include "program/stream/peer.h"
#include "program/stream/server.h"
#include "program/stream/tracked_patient.h"

static const double frame_interval = 15e-3; /* time between frames while no messages arrive, s */
static const double send_interval = 20e-3;  /* time between checks of the peers that wait, s */
static const double connect_interval = 1.0; /* time between attempts to connect to a peer, s */
static const double stop_interval = 0.1;    /* time between calls of options->stop, s */
static const double idle_standard = 60.0;   /* time after which idle peers are disconnected, s */
static const double idle_frames = 60.0;     /* frames that a peer is sent in this time, at least */

/* Indices of sockets that are polled; those of peers come first. */
enum { LISTENER = SUPINE_STREAM_PEERS_MAX, WEB, POLLED };

/* All times are in seconds by supine_clock_seconds. */
struct supine_stream_server {
  const supine_stream_options *options;
  supine_stream_results results;
  supine_stream_patient patient;
  supine_stream_frames *frames;
  supine_stream_frame *latest;
  double frame_time; /* time at which the newest frame, `latest`, was made */
  int listener;      /* listening socket; -1 if none */
  supine_stream_address target;
  double connect_at;             /* time of the next attempt to connect; INFINITY if none */
  double accept_at;              /* time at which to accept peers again after a failure */
  supine_stream_peer *connected; /* peer of --connect, connected or connecting; NULL if none */
  supine_stream_peer peer[SUPINE_STREAM_PEERS_MAX]; /* connected peers and free slots */
  unsigned char message[SUPINE_STREAM_PEERS_MAX]
                       [SUPINE_STREAM_MESSAGE_MAX]; /* received by each peer */
  struct pollfd polled[POLLED]; /* sockets of `peer`, listener, pipe of web's poses; -1 if none */
  double wait_begun;            /* time at which poll() was last called */
  double woke;                  /* time at which poll() last returned */
};

/* Return the time after which an idle peer is disconnected, s. */
static double idle_time(const supine_stream_server *s) {
  return s->options->idle > 0.0 ? s->options->idle : idle_standard;
}

/* Return whether a peer wants frames, is sent none at the moment, and lacks the newest frame or has
 * not been sent any for long. */
static bool needs_frame(const supine_stream_server *s, const supine_stream_peer *peer) {
  return peer->socket >= 0 && !peer->connecting && peer->frame == NULL &&
         peer->content != SUPINE_STREAM_SILENCE && s->latest != NULL &&
         (peer->last_frame != s->latest->number ||
          s->woke - peer->given >= idle_time(s) / idle_frames);
}

static void end_peer(supine_stream_server *s, supine_stream_peer *peer) {
  if (peer == s->connected) {
    s->connected = NULL;
    s->connect_at = s->woke + connect_interval;
  }
  supine_stream_peer_end(peer, s->frames);
}

/* Initialise a peer in a free slot. If no slot is free, close the socket and return NULL. */
static supine_stream_peer *begin_peer(supine_stream_server *s, int socket, bool connecting) {
  for (size_t i = 0; i < SUPINE_STREAM_PEERS_MAX; ++i) {
    supine_stream_peer *peer = &s->peer[i];
    if (peer->socket < 0) {
      supine_stream_peer_begin(peer, socket, connecting, s->options->content, s->woke,
                               s->message[i]);
      s->results.counts.peers += connecting ? 0 : 1;
      return peer;
    }
  }
  (void)close(socket);
  ++s->results.counts.turned_away;
  supine_stream_patient_warn(&s->patient, s->woke,
                             "a peer is refused: at most %d can be connected; close another",
                             (int)SUPINE_STREAM_PEERS_MAX);
  return NULL;
}

static void accept_peers(supine_stream_server *s) {
  for (size_t i = 0; i < SUPINE_STREAM_PEERS_MAX; ++i) {
    const int socket = supine_stream_nonblocking(accept(s->listener, NULL, NULL));
    if (socket < 0) {
      if (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR && errno != ECONNABORTED) {
        s->accept_at = s->woke + connect_interval;
      }
      return;
    }
    (void)begin_peer(s, socket, false);
  }
}

static void connect_peer(supine_stream_server *s) {
  const int socket = supine_stream_address_connect(&s->target);
  s->connected = socket < 0 ? NULL : begin_peer(s, socket, true);
  s->connect_at = s->connected == NULL ? s->woke + connect_interval : (double)INFINITY;
}

/* Complete a connection to a peer, or abandon the connection if it failed. */
static void connection_made(supine_stream_server *s, supine_stream_peer *peer) {
  int failure = 0;
  socklen_t size = sizeof failure;
  if (getsockopt(peer->socket, SOL_SOCKET, SO_ERROR, &failure, &size) != 0 || failure != 0) {
    end_peer(s, peer);
    return;
  }
  peer->connecting = false;
  peer->active = s->woke;
  ++s->results.counts.peers;
}

static void take_request(supine_stream_server *s, supine_stream_peer *peer, const char *text) {
  for (int what = 0; what < SUPINE_STREAM_CONTENT_COUNT; ++what) {
    if (strcmp(text, supine_stream_content_names[what]) == 0) {
      peer->content = (supine_stream_content)what;
      peer->knows_triangles = false;
      peer->last_frame = 0;
      return;
    }
  }
  supine_stream_patient_warn(&s->patient, s->woke,
                             "request '%s' is unknown: give weights, points, surface or nothing",
                             text);
}

static void receive(void *context, supine_stream_peer *peer) {
  supine_stream_server *s = context;
  supine_stream_message message;
  supine_error error;
  if (supine_stream_message_read(&peer->header, peer->message + SUPINE_STREAM_HEADER,
                                 s->options->device, &message, &error) != SUPINE_OK) {
    ++s->results.counts.malformed;
    supine_stream_patient_warn(&s->patient, s->woke, "a message is dropped: %s",
                               supine_options_explain(&error).text);
    return;
  }
  if (message.kind == SUPINE_STREAM_REQUEST) {
    take_request(s, peer, message.text);
    return;
  }
  if (message.kind == SUPINE_STREAM_INVALID) {
    ++s->results.counts.invalid;
    supine_stream_patient_warn(&s->patient, s->woke,
                               "the tracker marks the pose of '%s' as invalid: bring the tool back "
                               "into view",
                               peer->header.device);
    return;
  }
  /* If poll() waited, the message has just arrived. Otherwise it may have arrived at any time
   * since the socket was last empty. */
  const bool poll_waited = s->woke - s->wait_begun > 50e-6;
  if (supine_stream_patient_receive(&s->patient, &message, poll_waited ? s->woke : peer->emptied,
                                    peer->header.stamp, &error) != SUPINE_OK) {
    const supine_explained why = supine_options_explain(&error);
    supine_stream_patient_warn(&s->patient, s->woke, "%s", why.text);
    supine_stream_peer_tell(peer, s->options->name, why.text);
  }
}

static void read_peer(supine_stream_server *s, supine_stream_peer *peer) {
  supine_error error = {.status = SUPINE_OK};
  if (supine_stream_peer_read(peer, s->woke, receive, s, &s->results.counts.skipped, &error) ==
      SUPINE_STREAM_LOST) {
    if (error.status != SUPINE_OK) {
      ++s->results.counts.lost;
      supine_stream_patient_warn(&s->patient, s->woke, "a peer is disconnected: %s",
                                 supine_options_explain(&error).text);
    }
    end_peer(s, peer);
  }
}

/* Return the time at which to make the next frame; INFINITY if no frame is needed. */
static double frame_due(const supine_stream_server *s) {
  const double soonest = s->latest == NULL ? 0.0 : s->frame_time + 1.0 / s->options->rate;
  if (s->patient.pending || s->latest == NULL) {
    return soonest;
  }
  if (!s->options->volume->breathes) {
    return (double)INFINITY;
  }
  /* Each message triggers a frame. After a recent message, wait two frame intervals for the next
   * message before making a frame without one. */
  const bool driven = s->woke - s->patient.received < 2.0 * frame_interval;
  return fmax(soonest, s->frame_time + (driven ? 2.0 : 1.0) * frame_interval);
}

static bool make_frame(supine_stream_server *s) {
  supine_stream_snapshot snapshot;
  supine_stream_patient_snapshot(&s->patient, s->woke, &snapshot);
  supine_stream_frame_release(s->frames, s->latest);
  s->latest = supine_stream_frame_acquire(s->frames, &snapshot);
  if (s->latest == NULL) {
    return false;
  }
  s->frame_time = s->woke;
  ++s->results.counts.frames;
  if (s->options->web != NULL) {
    supine_stream_web_send(s->options->web, &snapshot);
  }
  return true;
}

static void add_latency(supine_stream_latency *latency, double seconds) {
  ++latency->count;
  latency->late += seconds > SUPINE_STREAM_BUDGET;
  latency->worst = fmax(latency->worst, seconds);
}

/* Send the unsent rest of a frame to a peer. If there is none, send the newest frame. */
static void send_peer(supine_stream_server *s, supine_stream_peer *peer) {
  const supine_stream_outcome told = supine_stream_peer_send_status(peer);
  if (told == SUPINE_STREAM_LOST) {
    end_peer(s, peer);
  }
  if (told != SUPINE_STREAM_DONE) {
    return;
  }
  if (needs_frame(s, peer) && supine_stream_peer_ready(peer)) {
    supine_stream_peer_give(peer, s->frames, s->latest);
    peer->given = s->woke;
  }
  if (peer->frame == NULL) {
    return;
  }
  const supine_stream_outcome outcome = supine_stream_peer_send(peer);
  if (outcome == SUPINE_STREAM_LOST) {
    end_peer(s, peer);
  } else if (outcome == SUPINE_STREAM_DONE) {
    const double received = peer->frame->snapshot.received;
    peer->active = s->woke;
    if (received >= 0.0 && !peer->repeated) {
      add_latency(&s->results.latency[peer->content != SUPINE_STREAM_WEIGHTS],
                  supine_clock_seconds() - received);
    }
    ++s->results.counts.sent;
    supine_stream_frame_release(s->frames, peer->frame);
    peer->frame = NULL;
  }
}

static void send_peers(supine_stream_server *s) {
  for (int surfaces = 0; surfaces < 2; ++surfaces) {
    for (size_t i = 0; i < SUPINE_STREAM_PEERS_MAX; ++i) {
      supine_stream_peer *peer = &s->peer[i];
      const bool surface = peer->content != SUPINE_STREAM_WEIGHTS;
      if (peer->socket >= 0 && surface == (surfaces == 1)) {
        send_peer(s, peer);
      }
    }
  }
}

/* Disconnect peers that have neither sent a message nor taken a frame for long. Call this after
 * send_peers, so that a peer is not idle because the server itself was late. */
static void end_idle_peers(supine_stream_server *s) {
  for (size_t i = 0; i < SUPINE_STREAM_PEERS_MAX; ++i) {
    supine_stream_peer *peer = &s->peer[i];
    if (peer->socket >= 0 && !peer->connecting && s->woke - peer->active >= idle_time(s)) {
      ++s->results.counts.idle;
      supine_stream_patient_warn(&s->patient, s->woke,
                                 "a peer is disconnected: for %.3g s it sent no message and took "
                                 "no frame",
                                 idle_time(s));
      end_peer(s, peer);
    }
  }
}

/* Compute how many milliseconds to wait for sockets in a run that ends at the time `end`. */
static int find_timeout(const supine_stream_server *s, double end) {
  double next = fmin(fmin(s->woke + stop_interval, end), fmin(s->connect_at, frame_due(s)));
  for (size_t i = 0; i < SUPINE_STREAM_PEERS_MAX; ++i) {
    if (needs_frame(s, &s->peer[i])) {
      next = fmin(next, s->woke + send_interval);
    }
  }
  return (int)ceil(1e3 * fmax(0.0, next - supine_clock_seconds()));
}

/* Choose the sockets for poll() to watch. */
static void gather(supine_stream_server *s) {
  for (size_t i = 0; i < SUPINE_STREAM_PEERS_MAX; ++i) {
    const supine_stream_peer *peer = &s->peer[i];
    const bool writes =
        peer->connecting || peer->frame != NULL || supine_stream_peer_has_status(peer);
    s->polled[i] = (struct pollfd){peer->socket, (short)(POLLIN | (writes ? POLLOUT : 0)), 0};
  }
  s->polled[LISTENER] = (struct pollfd){s->woke >= s->accept_at ? s->listener : -1, POLLIN, 0};
  s->polled[WEB] = (struct pollfd){
      s->options->web != NULL ? supine_stream_web_descriptor(s->options->web) : -1, POLLIN, 0};
}

/* Read from all sockets that poll() reported. */
static void receive_all(supine_stream_server *s) {
  for (size_t i = 0; i < SUPINE_STREAM_PEERS_MAX; ++i) {
    if (s->polled[i].revents != 0) {
      if (s->peer[i].connecting) {
        connection_made(s, &s->peer[i]);
      } else if ((s->polled[i].revents & (POLLIN | POLLHUP | POLLERR)) != 0) {
        read_peer(s, &s->peer[i]);
      }
    } else {
      s->peer[i].emptied = s->woke; /* nothing has arrived so far */
    }
  }
  if (s->polled[LISTENER].revents != 0) {
    accept_peers(s);
  }
  if (s->polled[WEB].revents != 0) {
    double gravity[3];
    double received = 0.0;
    if (supine_stream_web_take(s->options->web, gravity, &received)) {
      supine_error error;
      if (supine_stream_patient_pose(&s->patient, gravity, received, &error) != SUPINE_OK) {
        const supine_explained why = supine_options_explain(&error);
        supine_stream_patient_warn(&s->patient, s->woke, "%s", why.text);
        supine_stream_web_tell(s->options->web, why.text);
      } else {
        supine_stream_web_tell(s->options->web, "");
      }
    }
  }
}

supine_status supine_stream_server_run(supine_stream_server *server, supine_error *error) {
  supine_stream_server *s = server;
  const supine_stream_options *options = s->options;
  s->woke = supine_clock_seconds();
  const double end = options->seconds > 0.0 ? s->woke + options->seconds : (double)INFINITY;
  double asked = s->woke;
  while (s->woke < end) {
    gather(s);
    const int timeout = find_timeout(s, end);
    s->wait_begun = supine_clock_seconds();
    const int ready = poll(s->polled, POLLED, timeout);
    SUPINE_REFUSE_IF(ready < 0 && errno != EINTR, error, SUPINE_ERROR_WRITE,
                     "cannot wait for the sockets: %s", strerror(errno));
    s->woke = supine_clock_seconds();
    if (s->woke - asked >= stop_interval) {
      asked = s->woke;
      if (options->stop(options->context)) {
        break;
      }
    }
    if (s->woke >= s->connect_at) {
      connect_peer(s);
    }
    receive_all(s);
    if (s->woke >= frame_due(s) && !make_frame(s)) {
      return supine_error_memory(error, "a frame");
    }
    send_peers(s);
    end_idle_peers(s);
  }
  return SUPINE_OK;
}

static void destroy(supine_stream_server **server) {
  supine_stream_server_destroy(*server);
}

supine_status supine_stream_server_create(const supine_basis *basis,
                                          const supine_stream_options *options,
                                          supine_stream_server **server, supine_error *error) {
  SUPINE_FREED_BY(destroy) supine_stream_server *s = calloc(1, sizeof *s);
  if (s == NULL) {
    return supine_error_memory(error, "the server");
  }
  s->options = options;
  s->listener = -1;
  s->woke = supine_clock_seconds();
  for (size_t i = 0; i < SUPINE_STREAM_PEERS_MAX; ++i) {
    s->peer[i].socket = -1;
  }
  s->patient = supine_stream_patient_begin(basis, options, &s->results.counts, s->woke);
  s->connect_at = options->connect != NULL ? s->woke : (double)INFINITY;
  SUPINE_TRY(supine_stream_frames_create(basis, options->name, options->ras, &s->frames, error));
  if (options->listen != NULL) {
    supine_stream_address here;
    SUPINE_TRY(supine_stream_address_read(options->listen, true, &here, error));
    s->listener = supine_stream_address_listen(&here, &s->results.port, error);
    if (s->listener < 0) {
      return SUPINE_ERROR_WRITE;
    }
  }
  if (options->connect != NULL) {
    SUPINE_TRY(supine_stream_address_read(options->connect, false, &s->target, error));
  }
  *server = s;
  s = NULL;
  return SUPINE_OK;
}

void supine_stream_server_destroy(supine_stream_server *server) {
  if (server == NULL) {
    return;
  }
  if (server->frames != NULL) {
    for (size_t i = 0; i < SUPINE_STREAM_PEERS_MAX; ++i) {
      if (server->peer[i].socket >= 0) {
        supine_stream_peer_end(&server->peer[i], server->frames);
      }
    }
  }
  if (server->listener >= 0) {
    (void)close(server->listener);
  }
  supine_stream_frame_release(server->frames, server->latest);
  supine_stream_frames_destroy(server->frames);
  free(server);
}

const supine_stream_results *supine_stream_server_results(const supine_stream_server *server) {
  return &server->results;
}
