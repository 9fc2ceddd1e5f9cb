/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Serve the live page, and send each state to its viewers by WebSocket, in another thread, so that
 * no browser delays the peers.
 *
 * To viewers, the newest state:  {"gravity":[x,y,z],"volume":mL,"above":mL,"age":s}
 *   above: mL above rest in the posture, or above the scan if rest is unknown
 *   age: time since the newest pose was received; -1: no pose yet
 * From viewers, the pose of a phone: {"gravity":[x,y,z]} */
#ifndef SUPINE_STREAM_WEB_H
#define SUPINE_STREAM_WEB_H

#include <stdbool.h>

#include "program/stream/frame.h"

typedef struct supine_stream_web supine_stream_web;

/** Address and content of the server. There is no access control. */
typedef struct supine_stream_site {
  const char *address;           /**< numeric */
  int port;                      /**< 0: any free port */
  const char *certificate, *key; /**< PEM files; NULL: without encryption */
  const void *page;              /**< HTML; kept by the caller until the site is destroyed */
  size_t page_size;
  size_t viewers; /**< largest number of viewers */
} supine_stream_site;

/** Start serving.
 * @retval SUPINE_ERROR_UNSUPPORTED  libwebsockets is not installed
 * @retval SUPINE_ERROR_WRITE        the port is taken, or the certificate is invalid
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_web_create(const supine_stream_site *site, supine_stream_web **web,
                                       supine_error *error);
void supine_stream_web_destroy(supine_stream_web *web);

/** Return the port that the page is served on. */
int supine_stream_web_port(const supine_stream_web *web);

/** Return a descriptor that is readable when a viewer has sent a pose. */
int supine_stream_web_descriptor(const supine_stream_web *web);

/** Read the newest pose that a viewer has sent since the last call; return false if there is none.
 * @param gravity   written: any finite numbers
 * @param received  written: when the pose was received, s of supine_clock_seconds */
bool supine_stream_web_take(supine_stream_web *web, double gravity[3], double *received);

/** Send a state to each viewer when the viewer can receive; a newer state replaces one that waits.
 */
void supine_stream_web_send(supine_stream_web *web, const supine_stream_snapshot *snapshot);

/** Return the number of viewers. */
size_t supine_stream_web_viewers(supine_stream_web *web);

#endif
