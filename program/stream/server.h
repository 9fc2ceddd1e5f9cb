/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Run a server that receives poses and sends deformed lungs, in one thread, without blocking.
 *
 * Each frame shows the newest pose and is sent to every peer that is ready; the other peers receive
 * a later frame. Peers that receive only weights of modes are served before those that receive
 * points. */
#ifndef SUPINE_STREAM_SERVER_H
#define SUPINE_STREAM_SERVER_H

#include <stdio.h>

#include "program/stream/gravity.h"
#include "program/stream/web.h"

/** Points observed inside the lungs, to which the lungs are fitted (supine/locate.h). */
typedef struct supine_stream_observed {
  const supine_basis *inside; /**< basis with the points as vertices, made by 'supine embed' */
  size_t count;
  const char *name[SUPINE_LOCATE_POINTS_MAX];
  /** Newest observation of each point; its position is not-a-number if the point is not seen. */
  supine_observation last[SUPINE_LOCATE_POINTS_MAX];
  bool ras;      /**< true if positions in messages are in RAS, false if in LPS */
  double *space; /**< [supine_locate_space(count)] workspace */
} supine_stream_observed;

/** Numbers of events since the server was created. */
typedef struct supine_stream_counts {
  size_t poses;       /**< poses accepted, whether a frame showed them or not */
  size_t positions;   /**< accepted positions of observed points */
  size_t repaired;    /**< poses used although they were not exact rotations */
  size_t refused;     /**< poses that were not used, such as matrices with a reflection */
  size_t invalid;     /**< poses that the tracker marked as invalid */
  size_t malformed;   /**< messages with a wrong checksum or inconsistent lengths */
  size_t skipped;     /**< messages without use, and too large ones */
  size_t unreachable; /**< volumes that were not used, as the lungs cannot hold them */
  size_t frames;
  size_t sent;        /**< frames sent, summed over peers */
  size_t peers;       /**< peers accepted */
  size_t lost;        /**< peers disconnected because of invalid messages */
  size_t idle;        /**< peers disconnected because they were idle */
  size_t turned_away; /**< connections refused, as there were SUPINE_STREAM_PEERS_MAX peers */
} supine_stream_counts;

enum { SUPINE_STREAM_PEERS_MAX = 64 };

/** Time allowed from receiving a message to sending its frame, s. */
#define SUPINE_STREAM_BUDGET 15e-3

typedef struct supine_stream_latency {
  size_t count;
  size_t late;  /**< number of latencies above SUPINE_STREAM_BUDGET */
  double worst; /**< largest latency, s */
} supine_stream_latency;

typedef struct supine_stream_server supine_stream_server;
typedef struct supine_stream_volume supine_stream_volume; /* defined in tracked_patient.h */

typedef struct supine_stream_options {
  const char *listen;  /**< "PORT" (for this machine alone) or "ADDRESS:PORT"; port 0 chooses a free
                          port; NULL if the server does not listen */
  const char *connect; /**< "HOST:PORT" of a peer, tried until it accepts; NULL if none */
  const char *device;  /**< device that sends the pose of the patient; NULL for any device */
  const char *name;    /**< device name in sent messages */
  supine_stream_setup setup;
  supine_stream_volume *volume; /**< fixed volume or breath at the start; messages may change it */
  supine_stream_observed *observed; /**< points whose positions come in messages; NULL if none */
  supine_stream_content content;    /**< content sent to peers that have not asked for any */
  bool ras;                         /**< send points in RAS */
  double rate;                      /**< maximum number of frames a second */
  double seconds;                   /**< duration, s; 0 to run until `stop` returns true */
  /** Time after which a peer is disconnected that neither sends a message nor takes a frame, s;
   * 0 selects 60 s. If there is no new frame for 1/60 of this time, the newest is sent again, so
   * that a peer that only shows frames is not idle. */
  double idle;
  supine_stream_web *web; /**< live page; NULL if none */
  void (*warn)(void *context, const char *text);
  bool (*stop)(void *context); /**< called every 100 ms or so; true ends the run */
  void *context;
} supine_stream_options;

/** Create a server and open its sockets.
 * @param options  must outlive the server */
supine_status supine_stream_server_create(const supine_basis *basis,
                                          const supine_stream_options *options,
                                          supine_stream_server **server, supine_error *error);
void supine_stream_server_destroy(supine_stream_server *server);

/** Run the server until options->stop returns true or the time options->seconds is over. */
supine_status supine_stream_server_run(supine_stream_server *server, supine_error *error);

/** What the server has done so far. A latency is the time from receiving the newest message to
 * passing the frame to the kernel. Frames without a new message do not count. If a message may have
 * waited in the peer's socket, its latency is an upper bound: the time since the socket was last
 * empty. */
typedef struct supine_stream_results {
  int port; /**< port on which the server listens; 0 if it does not listen */
  supine_stream_counts counts;
  supine_stream_latency latency[2]; /**< of frames of weights, and of frames of points */
} supine_stream_results;
const supine_stream_results *supine_stream_server_results(const supine_stream_server *server);

#endif
