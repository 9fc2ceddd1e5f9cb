/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Run a server that receives poses and sends lungs, in one thread with non-blocking sockets.
 *
 * Only the newest pose counts. It becomes one frame, which is sent to every peer that is ready;
 * other peers are sent a later frame. Peers that receive weights are served first. */
#ifndef SUPINE_STREAM_SERVER_H
#define SUPINE_STREAM_SERVER_H

#include "program/stream/gravity.h"
#include "program/stream/web.h"

/** Points observed inside the lungs, from which the lungs are located (supine/locate.h). */
typedef struct supine_stream_observed {
  const supine_basis *inside; /**< basis made by 'supine embed' */
  size_t count;
  const char *name[SUPINE_LOCATE_POINTS_MAX];
  supine_observation last[SUPINE_LOCATE_POINTS_MAX]; /**< last position; not-a-number: not seen */
  bool ras;                                          /**< messages have positions in RAS */
  double *space;                                     /**< [supine_locate_space(count)] workspace */
  supine_location location;
} supine_stream_observed;

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

/** Write the header of a file of recorded poses. */
void supine_stream_poses_begin(FILE *file);
/** Write the line of a pose, with enough digits to read back the same numbers. */
void supine_stream_poses_add(FILE *file, const supine_stream_pose *pose);

/** Numbers of events so far. */
typedef struct supine_stream_counts {
  uint64_t poses;       /**< poses accepted, shown or not */
  uint64_t positions;   /**< positions of observed points accepted */
  uint64_t repaired;    /**< poses repaired to rotations */
  uint64_t refused;     /**< poses refused */
  uint64_t malformed;   /**< messages with a wrong checksum or inconsistent lengths */
  uint64_t skipped;     /**< messages of other types */
  uint64_t unreachable; /**< frames that keep the last gains, as their volume is out of reach */
  uint64_t frames;
  uint64_t sent;        /**< frames sent, summed over peers */
  uint64_t peers;       /**< peers accepted */
  uint64_t lost;        /**< peers disconnected because of invalid messages */
  uint64_t turned_away; /**< peers refused, as there were too many */
} supine_stream_counts;

/** Number of bins of 1 us; the last bin also counts longer latencies. */
enum { SUPINE_STREAM_LATENCY_BINS = 65536 };

/** Histogram of latencies. */
typedef struct supine_stream_latency {
  uint64_t count;
  double worst; /**< s */
  uint32_t bin[SUPINE_STREAM_LATENCY_BINS];
} supine_stream_latency;

/** Return a quantile of the latencies, s, rounded up to a microsecond; the worst latency if the
 * quantile is in the last bin; 0 if there are no latencies.
 * @param share  0 to 1: 0.5 for the median */
double supine_stream_latency_quantile(const supine_stream_latency *latency, double share);

typedef struct supine_stream_server supine_stream_server;
typedef struct supine_stream_volume supine_stream_volume; /* tracked_patient.h */

typedef struct supine_stream_options {
  const char *listen;  /**< "PORT" (this machine alone) or "ADDRESS:PORT"; port 0: any; NULL: do not
                          listen */
  const char *connect; /**< "HOST:PORT", tried until it accepts; NULL: do not connect */
  const char *device;  /**< device whose poses are followed; NULL: any */
  const char *name;    /**< device name of the messages sent */
  supine_stream_setup setup;
  supine_stream_volume *volume;      /**< messages may change it */
  supine_stream_observed *observed;  /**< points whose positions messages set; NULL: none */
  supine_stream_content content;     /**< content sent to peers that have not chosen */
  bool ras;                          /**< send points in RAS */
  double rate;                       /**< largest number of frames a second */
  size_t peers;                      /**< largest number of peers, up to 1000 */
  double smooth;                     /**< time constant of smoothing, s; 0: none */
  double seconds;                    /**< duration; 0: until `stop` */
  const supine_stream_poses *replay; /**< recorded poses, followed from the first peer or viewer
                                        on; or NULL */
  FILE *record;                      /**< each pose is written to it; NULL: none */
  supine_stream_web *web;            /**< live page; NULL: none */
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

/** Return the port that the server listens on; 0: none. */
int supine_stream_server_port(const supine_stream_server *server);

/** Run until `stop` returns true, the duration is over or the replay ends. No peer can end it.
 * @retval SUPINE_ERROR_WRITE  the system cannot wait for the sockets
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_server_run(supine_stream_server *server, supine_error *error);

const supine_stream_counts *supine_stream_server_counts(const supine_stream_server *server);

/** Return the latencies from receiving a pose to passing its frame to the kernel, for
 * SUPINE_STREAM_WEIGHTS, or for POLYDATA: SUPINE_STREAM_POINTS and SUPINE_STREAM_SURFACE together.
 * Frames without a new message do not count. If a pose may have waited unread, its latency counts
 * from when the peer's socket was last found empty, so that it is never underestimated. */
const supine_stream_latency *supine_stream_server_latency(const supine_stream_server *server,
                                                          supine_stream_content content);

#endif
