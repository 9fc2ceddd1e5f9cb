/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Builds without libwebsockets: no page is served. */
#include "program/stream/web.h"

supine_status supine_stream_web_create(const supine_stream_site *site, supine_stream_web **web,
                                       supine_error *error) {
  (void)site;
  (void)web;
  return supine_error_set(error, SUPINE_ERROR_UNSUPPORTED,
                          "this build serves no page: it was configured without libwebsockets");
}

void supine_stream_web_destroy(supine_stream_web *web) {
  (void)web;
}

int supine_stream_web_port(const supine_stream_web *web) {
  (void)web;
  return 0;
}

int supine_stream_web_descriptor(const supine_stream_web *web) {
  (void)web;
  return -1;
}

bool supine_stream_web_take(supine_stream_web *web, double gravity[3], double *received) {
  (void)web;
  (void)gravity;
  (void)received;
  return false;
}

void supine_stream_web_tell(supine_stream_web *web, const supine_stream_moment *moment) {
  (void)web;
  (void)moment;
}

size_t supine_stream_web_viewers(supine_stream_web *web) {
  (void)web;
  return 0;
}
