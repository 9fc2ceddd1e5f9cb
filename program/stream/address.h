/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Sockets from addresses as people write them. */
#ifndef SUPINE_STREAM_ADDRESS_H
#define SUPINE_STREAM_ADDRESS_H

#include <stdbool.h>
#include <sys/socket.h>

#include <supine/status.h>

typedef struct supine_stream_address {
  struct sockaddr_storage where;
  socklen_t size;
} supine_stream_address;

/** Reads "PORT" (of this machine, 127.0.0.1), "HOST:PORT" or "[HOST]:PORT"; a name may be looked
 * up.
 * @param numeric  names are not looked up
 * @retval SUPINE_ERROR_ARGUMENT  no such address */
supine_status supine_stream_address_read(const char *text, bool numeric,
                                         supine_stream_address *address, supine_error *error);

/** A socket that listens there, without waiting; -1 after setting the error.
 * @param port  written: the port it was given */
int supine_stream_address_listen(const supine_stream_address *address, int *port,
                                 supine_error *error);

/** A socket on its way there, without waiting; -1 where that failed at once. */
int supine_stream_address_connect(const supine_stream_address *address);

#endif
