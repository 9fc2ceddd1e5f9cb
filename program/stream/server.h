/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * A server that receives poses and sends lungs: one thread, non-blocking sockets.
 *
 * Only the newest pose counts. It becomes one frame, which is sent to every peer that is ready;
 * other peers are sent a later one. Peers that receive weights are served first. */
#ifndef SUPINE_STREAM_SERVER_H
#define SUPINE_STREAM_SERVER_H

#include "program/stream/gravity.h"
#include "program/stream/web.h"

/** Points observed inside the lungs, from which the lungs are located (supine/locate.h). */
typedef struct supine_stream_sensors {
  const supine_basis *inside; /**< basis made by 'supine embed' */
  size_t count;
  const char *name[SUPINE_LOCATE_POINTS_MAX];
  supine_observation last[SUPINE_LOCATE_POINTS_MAX]; /**< last position; not-a-number: not seen */
  bool ras;                                          /**< positions come in RAS */
  double *space;                                     /**< [supine_locate_space(count)] workspace */
  supine_location location;
} supine_stream_sensors;

/** Recorded poses: the direction of gravity in the body over time, as CSV with the columns seconds,
 * gravity_x, gravity_y, gravity_z. Times start at 0 or later and never decrease. */
typedef struct supine_stream_pose {
  double seconds;
  double gravity[3]; /**< unit */
} supine_stream_pose;

typedef struct supine_stream_poses {
  size_t count;
  supine_stream_pose *pose;
} supine_stream_poses;

/** Read a file; release with supine_stream_poses_free.
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT (the message names the line), SUPINE_ERROR_MEMORY
 */
supine_status supine_stream_poses_load(const char *path, supine_stream_poses *poses,
                                       supine_error *error);
void supine_stream_poses_free(supine_stream_poses *poses);

/** Write the header of such a file, and a line with enough digits to read back the same numbers. */
void supine_stream_poses_begin(FILE *file);
void supine_stream_poses_add(FILE *file, const supine_stream_pose *pose);

/** Numbers of events so far. */
typedef struct supine_stream_counts {
  uint64_t poses;       /**< poses accepted, shown or not */
  uint64_t places;      /**< positions of observed points accepted */
  uint64_t repaired;    /**< poses repaired to rotations */
  uint64_t refused;     /**< poses refused */
  uint64_t malformed;   /**< messages with a wrong checksum or contradicting lengths */
  uint64_t skipped;     /**< messages of other types */
  uint64_t unreachable; /**< frames whose volume is out of reach: they keep the last gains */
  uint64_t frames;
  uint64_t sent;        /**< frames sent, to all peers together */
  uint64_t peers;       /**< peers accepted */
  uint64_t lost;        /**< peers dropped: invalid messages */
  uint64_t turned_away; /**< peers turned away: too many */
  size_t present;       /**< peers now */
} supine_stream_counts;

enum { SUPINE_STREAM_LATENCY_BINS = 65536 }; /**< of 1 us each; the last also counts longer ones */

typedef struct supine_stream_latency {
  uint64_t count;
  double worst; /**< s */
  uint32_t bin[SUPINE_STREAM_LATENCY_BINS];
} supine_stream_latency;

/** Return the quantile `share` (0 to 1), s, rounded up to a microsecond; beyond the last bin the
 * worst latency; 0 where there is none. */
double supine_stream_latency_share(const supine_stream_latency *latency, double share);

typedef struct supine_stream_server supine_stream_server;
typedef struct supine_stream_volume supine_stream_volume; /* tracked_patient.h */

typedef struct supine_stream_options {
  const char *listen;  /**< "PORT" (this machine alone) or "ADDRESS:PORT"; port 0: any; NULL: do not
                          listen */
  const char *connect; /**< "HOST:PORT", tried until it accepts; NULL: do not connect */
  const char *device;  /**< device whose poses are followed; NULL: any */
  const char *name;    /**< device name of messages sent */
  supine_stream_setup setup;
  supine_stream_volume *volume;      /**< messages may change it */
  supine_stream_sensors *sensors;    /**< points that messages may set; NULL: none */
  supine_stream_what what;           /**< content sent to peers that have not chosen */
  bool ras;                          /**< points in RAS */
  double rate;                       /**< largest number of frames a second */
  size_t peers;                      /**< largest number of peers, up to 1000 */
  double smooth;                     /**< s of lag; 0: none */
  double seconds;                    /**< duration; 0: until `stop` */
  const supine_stream_poses *replay; /**< recorded poses, from the first peer on; or NULL */
  FILE *record;                      /**< each pose is written to it; NULL: none */
  supine_stream_web *web;            /**< NULL: none */
  void (*warn)(void *context, const char *text);
  bool (*stop)(void *context); /**< called about every 100 ms; true ends the run */
  void *context;
} supine_stream_options;

/** Create a server and open its sockets.
 * @param options  kept by the caller until the server is destroyed
 * @retval SUPINE_ERROR_ARGUMENT  an invalid address or port
 * @retval SUPINE_ERROR_WRITE     the port is taken
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_server_create(const supine_basis *basis,
                                          const supine_stream_options *options,
                                          supine_stream_server **server, supine_error *error);
void supine_stream_server_destroy(supine_stream_server *server);

/** Return the port that it listens on; 0: none. */
int supine_stream_server_port(const supine_stream_server *server);

/** Run until `stop`, the end of the duration or of the replay. Nothing that a peer does ends it.
 * @retval SUPINE_ERROR_WRITE  the system cannot wait for the sockets
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_server_run(supine_stream_server *server, supine_error *error);

const supine_stream_counts *supine_stream_server_counts(const supine_stream_server *server);

/** Return the times from a pose received to its frame passed to the kernel, for weights or for
 * surfaces (and SUPINE_STREAM_POINTS). Frames without a new message do not count. Where a pose may
 * have waited unread, its time starts when its peer's socket was last found empty, so that no time
 * is underestimated. */
const supine_stream_latency *supine_stream_server_latency(const supine_stream_server *server,
                                                          supine_stream_what what);

#endif
