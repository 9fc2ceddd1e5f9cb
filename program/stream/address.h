/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Parse the addresses of the command line, and open their sockets. */
#ifndef SUPINE_STREAM_ADDRESS_H
#define SUPINE_STREAM_ADDRESS_H

#include <stdbool.h>
#include <sys/socket.h>

#include <supine/status.h>

typedef struct supine_stream_address {
  struct sockaddr_storage where;
  socklen_t size;
  char host[256]; /**< as written, without brackets */
  int port;
} supine_stream_address;

/** Parse "PORT" (of this machine, 127.0.0.1), "HOST:PORT" or "[HOST]:PORT".
 * @param numeric  refuse host names, which need a look-up
 * @retval SUPINE_ERROR_ARGUMENT  no such address */
supine_status supine_stream_address_read(const char *text, bool numeric,
                                         supine_stream_address *address, supine_error *error);

/** Return a non-blocking socket that listens at the address; -1 after setting the error.
 * @param port  set to the port that it listens on */
int supine_stream_address_listen(const supine_stream_address *address, int *port,
                                 supine_error *error);

/** Return a non-blocking socket that is connecting to the address; -1 where that fails at once. */
int supine_stream_address_connect(const supine_stream_address *address);

#endif
