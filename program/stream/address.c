/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Parse addresses and open sockets. */
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/arena.h"
#include "program/stream/peer.h"

supine_status supine_stream_address_read(const char *text, bool numeric,
                                         supine_stream_address *address, supine_error *error) {
  char *host = address->host;
  const char *colon = strrchr(text, ':');
  const char *port = colon == NULL ? text : colon + 1;
  (void)strcpy(host, "127.0.0.1");
  if (colon != NULL) {
    const bool bracketed = text[0] == '[' && colon > text + 1 && colon[-1] == ']';
    const size_t length = (size_t)(colon - text) - (bracketed ? 2 : 0);
    SUPINE_REFUSE_IF(
        length == 0 || length >= sizeof address->host, error, SUPINE_ERROR_ARGUMENT,
        "'%s': the host before the port is missing or longer than 255 characters: give HOST:PORT",
        text);
    memcpy(host, text + (bracketed ? 1 : 0), length);
    host[length] = '\0';
  }
  char *end = NULL;
  const long number = strtol(port, &end, 10);
  SUPINE_REFUSE_IF(end == port || *end != '\0' || number < 0 || number > 65535, error,
                   SUPINE_ERROR_ARGUMENT, "'%s' is not a port: give 0 to 65535", port);
  const struct addrinfo wanted = {.ai_socktype = SOCK_STREAM,
                                  .ai_flags = AI_NUMERICSERV | (numeric ? AI_NUMERICHOST : 0)};
  struct addrinfo *found = NULL;
  const int failure = getaddrinfo(host, port, &wanted, &found);
  SUPINE_REFUSE_IF(
      failure != 0, error, SUPINE_ERROR_ARGUMENT, "'%s': %s: give %s", host, gai_strerror(failure),
      numeric ? "a numeric address, such as 127.0.0.1" : "a host name or a numeric address");
  memcpy(&address->where, found->ai_addr, found->ai_addrlen);
  address->size = found->ai_addrlen;
  address->port = (int)number;
  freeaddrinfo(found);
  return SUPINE_OK;
}

int supine_stream_nonblocking(int descriptor) {
  if (descriptor >= 0) {
    (void)fcntl(descriptor, F_SETFD, FD_CLOEXEC);
    (void)fcntl(descriptor, F_SETFL, O_NONBLOCK);
  }
  return descriptor;
}

int supine_stream_address_listen(const supine_stream_address *address, int *port,
                                 supine_error *error) {
  const int yes = 1;
  const int s = supine_stream_nonblocking(socket(address->where.ss_family, SOCK_STREAM, 0));
  struct sockaddr_storage given;
  socklen_t size = sizeof given;
  if (s < 0 || setsockopt(s, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) != 0 ||
      bind(s, (const struct sockaddr *)&address->where, address->size) != 0 || listen(s, 64) != 0 ||
      getsockname(s, (struct sockaddr *)&given, &size) != 0) {
    (void)supine_error_set(error, SUPINE_ERROR_WRITE,
                           "cannot listen on port %d: %s: give another port or address",
                           address->port, strerror(errno));
    if (s >= 0) {
      (void)close(s);
    }
    return -1;
  }
  /* The port is at the same offset in sockaddr_in and sockaddr_in6. */
  *port = ntohs(((const struct sockaddr_in *)(const void *)&given)->sin_port);
  return s;
}

int supine_stream_address_connect(const supine_stream_address *address) {
  const int s = supine_stream_nonblocking(socket(address->where.ss_family, SOCK_STREAM, 0));
  if (s >= 0 && connect(s, (const struct sockaddr *)&address->where, address->size) != 0 &&
      errno != EINPROGRESS) {
    (void)close(s);
    return -1;
  }
  return s;
}
