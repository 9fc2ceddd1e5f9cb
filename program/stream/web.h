/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Serve the live page, and send the newest state of the lungs to its viewers (browsers) by
 * WebSocket. A thread of its own does this, so that no browser delays the OpenIGTLink peers.
 *
 * A viewer receives {"gravity":[x,y,z],"volume":mL,"above":mL,"age":s}:
 *   volume: volume of all lungs together
 *   above: volume above rest in the posture, or above the scan if rest is unknown
 *   age: time since the newest pose or observed point was received; -1 if none was received
 * A viewer, such as a phone on the patient, may send its pose: {"gravity":[x,y,z]} */
#ifndef SUPINE_STREAM_WEB_H
#define SUPINE_STREAM_WEB_H

#include <stdbool.h>

#include "program/stream/frame.h"

typedef struct supine_stream_web supine_stream_web;

/** Address and content of the web server. There is no access control: whoever reaches the address
 * sees the lungs and can send a pose. A web site in somebody's browser cannot, because requests
 * must name this server (supine_stream_web_is_host) and come from its own page. */
typedef struct supine_stream_site {
  const char *address;           /**< numeric address to listen on */
  int port;                      /**< 0 to choose a free port; set to the port in use */
  const char *names;             /**< host names of the server, separated by commas, or NULL */
  const char *certificate, *key; /**< paths of PEM files; NULL for no encryption */
  const char *page;              /**< HTML, which must outlive the server */
  size_t page_size;              /**< bytes */
} supine_stream_site;

/** Start a thread that serves a site. */
supine_status supine_stream_web_create(supine_stream_site *site, supine_stream_web **web,
                                       supine_error *error);
void supine_stream_web_destroy(supine_stream_web *web);

/** Return a descriptor that is readable when a viewer has sent a pose. */
int supine_stream_web_descriptor(const supine_stream_web *web);

/** Read the newest pose that a viewer has sent since the last call; return false if there is none.
 * @param gravity   set to the direction of gravity, finite but of any length, even 0
 * @param received  set to the time at which the pose was received, s by supine_clock_seconds */
bool supine_stream_web_take(supine_stream_web *web, double gravity[3], double *received);

/** Tell all viewers, with the next state, that a pose which one of them has sent is refused, and why.
 * @param why  "" after a pose that is taken */
void supine_stream_web_tell(supine_stream_web *web, const char *why);

/** Send a state to each viewer as soon as the viewer is ready, unless a newer state replaces it. */
void supine_stream_web_send(supine_stream_web *web, const supine_stream_snapshot *snapshot);

#endif
