/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The page that follows: served to browsers, and told each moment by WebSocket. It lives in a
 * thread of its own, so that no browser holds up the trackers' peers.
 *
 * To viewers, each time the newest:  {"gravity":[x,y,z],"volume":mL,"above":mL,"age":s of the pose}
 *   (relative to the basis' reference, and to the posture's rest)
 * From viewers, a pose (of a phone): {"gravity":[x,y,z]} */
#ifndef SUPINE_STREAM_WEB_H
#define SUPINE_STREAM_WEB_H

#include <stdbool.h>

#include "program/stream/frame.h"

typedef struct supine_stream_web supine_stream_web;

/** Where it is served; one that trusts its network only. */
typedef struct supine_stream_site {
  const char *address;           /**< numeric */
  int port;                      /**< 0: any that is free */
  const char *certificate, *key; /**< PEM files; NULL: without encryption */
  const void *page;              /**< HTML; kept by the caller until the site is destroyed */
  size_t page_size;
  size_t viewers; /**< most at a time */
} supine_stream_site;

/** Opens it.
 * @retval SUPINE_ERROR_UNSUPPORTED  libwebsockets is not installed
 * @retval SUPINE_ERROR_WRITE        the port is taken, or the certificate is no good
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_web_create(const supine_stream_site *site, supine_stream_web **web,
                                       supine_error *error);
void supine_stream_web_destroy(supine_stream_web *web);

/** The port that it listens on. */
int supine_stream_web_port(const supine_stream_web *web);

/** Readable when a viewer has sent a pose. */
int supine_stream_web_descriptor(const supine_stream_web *web);

/** The newest pose that a viewer has sent since the last call, if there is one.
 * @param gravity   as sent: any finite numbers
 * @param received  s of supine_clock_seconds */
bool supine_stream_web_take(supine_stream_web *web, double gravity[3], double *received);

/** Send a state to the viewers as soon as each can receive; overtaken states are dropped. */
void supine_stream_web_tell(supine_stream_web *web, const supine_stream_moment *moment);

/** Return the number of viewers. */
size_t supine_stream_web_viewers(supine_stream_web *web);

#endif
