/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Poses in, lungs out: one thread, sockets that never wait.
 *
 * Of the poses that have come the newest alone counts. It becomes one frame, which every peer that
 * is ready is sent; one that is not gets a later one. Peers that want weights go first. */
#ifndef SUPINE_STREAM_SERVER_H
#define SUPINE_STREAM_SERVER_H

#include "program/stream/gravity.h"
#include "program/stream/latency.h"
#include "program/stream/poses.h"
#include "program/stream/sensors.h"
#include "program/stream/volume.h"
#include "program/stream/web.h"

/** What has happened so far. */
typedef struct supine_stream_counts {
  uint64_t poses;     /**< taken, the overtaken ones too */
  uint64_t places;    /**< of observed points, likewise */
  uint64_t repaired;  /**< poses repaired to rotations */
  uint64_t refused;   /**< poses refused */
  uint64_t malformed; /**< messages with a wrong checksum or contradicting lengths */
  uint64_t skipped;   /**< messages of other types */
  uint64_t
      unreachable; /**< frames whose volume would fold the surface: the last one's gains stayed */
  uint64_t frames;
  uint64_t sent;        /**< frames, over all peers */
  uint64_t peers;       /**< peers accepted */
  uint64_t lost;        /**< that sent no messages, or took nothing for too long */
  uint64_t turned_away; /**< peers turned away: too many */
  size_t present;       /**< peers now */
} supine_stream_counts;

typedef struct supine_stream_server supine_stream_server;

typedef struct supine_stream_options {
  const char *listen;  /**< "PORT" (this machine alone) or "ADDRESS:PORT"; port 0: any; NULL: not */
  const char *connect; /**< "HOST:PORT", again and again until it is there; NULL: not */
  const char *device;  /**< whose poses; NULL: any */
  const char *name;    /**< device name of what is sent */
  supine_stream_setup setup;
  supine_stream_volume *volume;   /**< messages may change it */
  supine_stream_sensors *sensors; /**< points that messages may place; NULL: none */
  supine_stream_what what;        /**< what peers receive that have not chosen */
  bool ras;                       /**< points in RAS */
  double rate;                    /**< most frames a second */
  size_t peers;                   /**< most at a time, up to 1000 */
  double smooth;                  /**< s of lag; 0: none */
  double seconds;                 /**< how long it runs; 0: until told to stop */
  double patience; /**< s that a peer may leave a message or frame unfinished; 0: 20 */
  const supine_stream_poses
      *replay;            /**< poses from a file, from when the first peer is there; NULL */
  FILE *record;           /**< each pose is written to it; NULL: none */
  supine_stream_web *web; /**< NULL: none */
  void (*warn)(void *context, const char *text);
  bool (*stop)(void *context); /**< called at least every 100 ms; true ends the run */
  void (*shown)(void *context, supine_stream_server *server); /**< each second; NULL */
  void *context;
} supine_stream_options;

/** Opens the sockets.
 * @param options  kept by the caller until the server is destroyed
 * @retval SUPINE_ERROR_ARGUMENT  an address or port that is none, or nowhere to hear poses from
 * @retval SUPINE_ERROR_WRITE     the port is taken
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_server_create(const supine_basis *basis,
                                          const supine_stream_options *options,
                                          supine_stream_server **server, supine_error *error);
void supine_stream_server_destroy(supine_stream_server *server);

/** The port that it listens on; 0: none. */
int supine_stream_server_port(const supine_stream_server *server);

/** Runs until it is told to stop, the time is up, or the replay has ended. Nothing that a peer does
 * ends it. */
supine_status supine_stream_server_run(supine_stream_server *server, supine_error *error);

const supine_stream_counts *supine_stream_server_counts(const supine_stream_server *server);

/** From pose received to frame handed to the kernel, of peers that are sent weights or surfaces
 * (SUPINE_STREAM_POINTS among them). Frames that no pose called for do not count. Where a pose may
 * have waited unread, it counts from when its peer's socket was last found empty: the figures are
 * never too good. */
const supine_stream_latency *supine_stream_server_latency(const supine_stream_server *server,
                                                          supine_stream_what what);

#endif
