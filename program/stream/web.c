/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Serve the live page and its WebSocket with libwebsockets, in a thread of its own. */
#include <arpa/inet.h>
#include <fcntl.h>
#include <jansson.h>
#include <libwebsockets.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/clock.h"
#include "base/library.h"
#include "base/locale.h"
#include "base/number.h"
#include "program/options/command.h"
#include "program/stream/peer.h"
#include "program/stream/web.h"

/* clang-format off */
#define FUNCTIONS(EACH)                                                                            \
  EACH(lws_, add_http_common_headers) EACH(lws_, callback_http_dummy)                              \
  EACH(lws_, callback_on_writable) EACH(lws_, callback_on_writable_all_protocol)                   \
  EACH(lws_, cancel_service) EACH(lws_, context_destroy) EACH(lws_, context_user)                  \
  EACH(lws_, create_context) EACH(lws_, finalize_write_http_header) EACH(lws_, get_context)        \
  EACH(lws_, get_protocol) EACH(lws_, get_vhost_by_name) EACH(lws_, get_vhost_listen_port)         \
  EACH(lws_, hdr_copy) EACH(lws_, hdr_total_length) EACH(lws_, http_transaction_completed)         \
  EACH(lws_, is_final_fragment) EACH(lws_, is_first_fragment) EACH(lws_, return_http_status)       \
  EACH(lws_, service) EACH(lws_, set_log_level) EACH(lws_, set_timeout) EACH(lws_, write)
/* clang-format on */

/* Functions of libwebsockets. The library is loaded at run time: linking it would also require
 * OpenSSL and three libraries of event loops. */
static struct { FUNCTIONS(SUPINE_LIBRARY_MEMBER) } lws;

enum {
  CONNECTIONS_MAX = 128, /* viewers, and browsers that load the page */
  TEXT = 256,            /* size of the buffer for a state as JSON, bytes */
  TOLD = 2200,           /* size of the buffer for the reason of a refusal as JSON, bytes */
  RECEIVED = 512,        /* size of the buffer for received bytes */
  HEADERS = 1024,        /* size of the buffer for the headers of an answer, bytes */
  PIECE = 1 << 14,       /* part of the page that is sent at once, bytes */
  PIECE_SECONDS = 60     /* time after which a browser is disconnected that takes no piece, s */
};

struct supine_stream_web {
  supine_stream_site site;
  struct lws_context *context;
  int poses[2]; /* pipe that carries received poses to the server's thread */
  pthread_t thread;
  bool running;
  atomic_bool ending;
  pthread_mutex_t lock; /* protects the following fields of this struct */
  uint64_t number;      /* serial number of the state in `text`: 1, 2, ... */
  char text[TEXT];      /* newest state as JSON; send_state() appends the age of the pose and "}" */
  char told[TOLD];      /* why the last pose of a viewer is refused, as JSON; "" if it is taken */
  double pose_received; /* time of receipt of the newest pose or observed point, s; -1 if none */
};

/* A pose that a viewer has sent, as passed by `supine_stream_web.poses` to the server's thread. */
typedef struct web_pose {
  double gravity[3];
  double received; /* time of receipt, s by supine_clock_seconds */
} web_pose;

static supine_stream_web *web_of(struct lws *wsi) {
  return lws.context_user(lws.get_context(wsi));
}

/* Return whether the Host header of a request may name this server: a numeric address, localhost or
 * one of `names`, with or without a port. Any other name may have been made to point to this
 * machine by a web site, whose page could then read the answers (DNS rebinding).
 * @param names  separated by commas, or NULL */
static bool is_host(const char *host, const char *names) {
  char name[256];
  struct in6_addr address;
  const bool bracketed = host[0] == '[';
  const char *begin = host + (bracketed ? 1 : 0);
  const size_t length = strcspn(begin, bracketed ? "]" : ":");
  if (length == 0 || length >= sizeof name || (bracketed && begin[length] != ']')) {
    return false;
  }
  memcpy(name, begin, length);
  name[length] = '\0';
  if (bracketed) {
    return inet_pton(AF_INET6, name, &address) == 1;
  }
  if (inet_pton(AF_INET, name, &address) == 1 || supine_ascii_same(name, "localhost")) {
    return true;
  }
  for (char given[256]; supine_options_next_item(&names, given, sizeof given);) {
    if (supine_ascii_same(name, given)) {
      return true;
    }
  }
  return false;
}

/* Read the Host header of a request; return whether it may name this server. */
static bool read_host(struct lws *wsi, char *host, size_t size) {
  return lws.hdr_copy(wsi, host, (int)size, WSI_TOKEN_HOST) > 0 &&
         is_host(host, web_of(wsi)->site.names);
}

/* Return whether to accept a WebSocket. Its Origin header must name the same host as its Host
 * header, so that no other web site connects; programs other than browsers send no Origin. */
static bool is_ours(struct lws *wsi) {
  char origin[256] = "";
  char host[256] = "";
  if (!read_host(wsi, host, sizeof host)) {
    return false;
  }
  if (lws.hdr_total_length(wsi, WSI_TOKEN_ORIGIN) == 0) {
    return true;
  }
  if (lws.hdr_copy(wsi, origin, sizeof origin, WSI_TOKEN_ORIGIN) < 0) {
    return false;
  }
  const char *from = strstr(origin, "://");
  return from != NULL && supine_ascii_same(from + 3, host);
}

/* Parse a viewer's message {"gravity":[x,y,z]} and pass its pose to the server's thread. Ignore all
 * other messages. */
static void receive(supine_stream_web *web, const char *bytes, size_t size) {
  SUPINE_C_LOCALE;
  json_t *pose = json_loadb(bytes, size, 0, NULL);
  const json_t *gravity = json_object_get(pose, "gravity");
  web_pose taken = {.received = supine_clock_seconds()};
  bool good = json_array_size(gravity) == 3;
  for (size_t i = 0; i < 3 && good; ++i) {
    const json_t *value = json_array_get(gravity, i);
    taken.gravity[i] = json_number_value(value);
    good = json_is_number(value) && isfinite(taken.gravity[i]);
  }
  json_decref(pose);
  if (good) {
    (void)!write(web->poses[1], &taken, sizeof taken);
  }
}

/* Send the newest state unless it was sent before; return 0, or -1 to disconnect the viewer.
 * @param sent  serial number of the last state sent to this viewer, updated */
static int send_state(supine_stream_web *web, struct lws *wsi, uint64_t *sent) {
  enum { AGE = 32 };
  unsigned char bytes[LWS_PRE + TEXT + TOLD + AGE];
  (void)pthread_mutex_lock(&web->lock);
  const uint64_t number = web->text[0] != '\0' ? web->number : *sent;
  const double age = web->pose_received >= 0 ? supine_clock_seconds() - web->pose_received : -1;
  const int size = supine_print_text((char *)bytes + LWS_PRE, TEXT + TOLD + AGE,
                                     "%s%s,\"age\":%.3f}", web->text, web->told, age);
  (void)pthread_mutex_unlock(&web->lock);
  if (number == *sent) {
    return 0;
  }
  *sent = number;
  return lws.write(wsi, bytes + LWS_PRE, (size_t)size, LWS_WRITE_TEXT) < 0 ? -1 : 0;
}

static int view(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in,
                size_t size) {
  supine_stream_web *web = web_of(wsi);
  switch (reason) {
  case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
    return is_ours(wsi) ? 0 : -1;
  case LWS_CALLBACK_ESTABLISHED:
    (void)lws.callback_on_writable(wsi);
    return 0;
  case LWS_CALLBACK_EVENT_WAIT_CANCELLED: /* supine_stream_web_send has stored a new state */
    (void)lws.callback_on_writable_all_protocol(web->context, lws.get_protocol(wsi));
    return 0;
  case LWS_CALLBACK_SERVER_WRITEABLE:
    return send_state(web, wsi, user);
  case LWS_CALLBACK_RECEIVE: /* ignore messages that are split into fragments */
    if (lws.is_first_fragment(wsi) != 0 && lws.is_final_fragment(wsi) != 0) {
      receive(web, in, size);
    }
    return 0;
  default:
    return 0;
  }
}

/* Send the headers of the page; return 0, or -1 to disconnect. */
static int begin_page(struct lws *wsi, size_t *sent) {
  unsigned char bytes[LWS_PRE + HEADERS];
  unsigned char *start = bytes + LWS_PRE;
  unsigned char *end = start;
  *sent = 0;
  if (lws.add_http_common_headers(wsi, HTTP_STATUS_OK, "text/html; charset=utf-8",
                                  web_of(wsi)->site.page_size, &end, bytes + sizeof bytes) != 0 ||
      lws.finalize_write_http_header(wsi, start, &end, bytes + sizeof bytes) != 0) {
    return -1;
  }
  lws.set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, PIECE_SECONDS);
  (void)lws.callback_on_writable(wsi);
  return 0;
}

/* Send the next piece of the page; return 0, or -1 to disconnect.
 * @param sent  number of bytes sent before, updated */
static int send_page(struct lws *wsi, size_t *sent) {
  const supine_stream_site *site = &web_of(wsi)->site;
  unsigned char bytes[LWS_PRE + PIECE];
  const size_t left = site->page_size - *sent;
  const size_t size = left < PIECE ? left : PIECE;
  memcpy(bytes + LWS_PRE, site->page + *sent, size);
  if (lws.write(wsi, bytes + LWS_PRE, size, size == left ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP) !=
      (int)size) {
    return -1;
  }
  *sent += size;
  if (size == left) {
    return lws.http_transaction_completed(wsi) != 0 ? -1 : 0;
  }
  lws.set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, PIECE_SECONDS);
  (void)lws.callback_on_writable(wsi);
  return 0;
}

/* Refuse a request whose Host header does not name this server. */
static int refuse_host(struct lws *wsi) {
  static const char words[] = "This host name is not known here: open the page by its address, or "
                              "start supine stream with --web-host NAME.";
  return lws.return_http_status(wsi, HTTP_STATUS_FORBIDDEN, words) != 0 ||
                 lws.http_transaction_completed(wsi) != 0
             ? -1
             : 0;
}

static int serve(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in,
                 size_t size) {
  char host[256];
  switch (reason) {
  case LWS_CALLBACK_HTTP:
    if (!read_host(wsi, host, sizeof host)) {
      return refuse_host(wsi);
    }
    if (strcmp(in, "/") == 0) {
      return begin_page(wsi, user);
    }
    break;
  case LWS_CALLBACK_HTTP_WRITEABLE:
    return send_page(wsi, user);
  default:
    break;
  }
  return lws.callback_http_dummy(wsi, reason, user, in, size); /* refuses other pages */
}

static const struct lws_protocols protocols[] = {
    {"http", serve, sizeof(size_t), 0, 0, NULL, 0},
    {"supine", view, sizeof(uint64_t), RECEIVED, 0, NULL, 0},
    {NULL, NULL, 0, 0, 0, NULL, 0}};

static void *run(void *context) {
  supine_stream_web *web = context;
  while (!atomic_load(&web->ending) && lws.service(web->context, 0) >= 0) {
  }
  return NULL;
}

supine_status supine_stream_web_create(supine_stream_site *site, supine_stream_web **web,
                                       supine_error *error) {
  SUPINE_TRY(SUPINE_LIBRARY_LOAD(SUPINE_WEBSOCKETS, FUNCTIONS, &lws, error));
  supine_stream_web *w = calloc(1, sizeof *w);
  if (w == NULL) {
    return supine_error_memory(error, "the page");
  }
  w->site = *site;
  (void)pthread_mutex_init(&w->lock, NULL);
  const bool piped = pipe(w->poses) == 0 && supine_stream_nonblocking(w->poses[0]) > 0 &&
                     supine_stream_nonblocking(w->poses[1]) > 0;
  lws.set_log_level(0, NULL);
  struct lws_context_creation_info info = {0};
  info.port = site->port;
  info.iface = site->address;
  info.protocols = protocols;
  info.user = w;
  info.gid = -1;
  info.uid = -1;
  info.options = LWS_SERVER_OPTION_FAIL_UPON_UNABLE_TO_BIND;
  /* With IPv6 enabled, libwebsockets would listen on every address, not only at the given one. */
  if (strchr(info.iface, ':') == NULL) {
    info.options |= LWS_SERVER_OPTION_DISABLE_IPV6;
  }
  info.fd_limit_per_thread = CONNECTIONS_MAX;
  if (site->certificate != NULL) {
    info.options |= LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT;
    info.ssl_cert_filepath = site->certificate;
    info.ssl_private_key_filepath = site->key;
    info.alpn = "http/1.1";
  }
  w->context = piped ? lws.create_context(&info) : NULL;
  struct lws_vhost *host = w->context == NULL ? NULL : lws.get_vhost_by_name(w->context, "default");
  const int port = host == NULL ? 0 : lws.get_vhost_listen_port(host);
  w->running = port > 0 && pthread_create(&w->thread, NULL, run, w) == 0;
  if (!w->running) {
    supine_stream_web_destroy(w);
    return supine_error_set(error, SUPINE_ERROR_WRITE,
                            "cannot serve a page at address %s, port %d: give a free port with "
                            "--web, and check --certificate and --key",
                            info.iface, site->port);
  }
  site->port = port;
  *web = w;
  return SUPINE_OK;
}

void supine_stream_web_destroy(supine_stream_web *web) {
  if (web == NULL) {
    return;
  }
  atomic_store(&web->ending, true);
  if (web->running) {
    lws.cancel_service(web->context);
    (void)pthread_join(web->thread, NULL);
  }
  if (web->context != NULL) {
    lws.context_destroy(web->context);
  }
  if (web->poses[1] > 0) {
    for (size_t i = 0; i < 2; ++i) {
      (void)close(web->poses[i]);
    }
  }
  (void)pthread_mutex_destroy(&web->lock);
  free(web);
}

int supine_stream_web_descriptor(const supine_stream_web *web) {
  return web->poses[0];
}

bool supine_stream_web_take(supine_stream_web *web, double gravity[3], double *received) {
  web_pose pose;
  bool posed = false;
  while (read(web->poses[0], &pose, sizeof pose) == sizeof pose) {
    memcpy(gravity, pose.gravity, sizeof pose.gravity);
    *received = pose.received;
    posed = true;
  }
  return posed;
}

void supine_stream_web_tell(supine_stream_web *web, const char *why) {
  SUPINE_C_LOCALE;
  json_auto_t *reason = json_pack("{s:s}", "refused", why);
  char *text = reason == NULL ? NULL : json_dumps(reason, JSON_COMPACT); /* {"refused":"..."} */
  (void)pthread_mutex_lock(&web->lock);
  web->told[0] = '\0';
  if (why[0] != '\0' && text != NULL && strlen(text) < sizeof web->told) {
    (void)snprintf(web->told, sizeof web->told, ",%.*s", (int)strlen(text) - 2, text + 1);
  }
  ++web->number;
  (void)pthread_mutex_unlock(&web->lock);
  free(text);
  lws.cancel_service(web->context);
}

void supine_stream_web_send(supine_stream_web *web, const supine_stream_snapshot *snapshot) {
  (void)pthread_mutex_lock(&web->lock);
  (void)supine_print_text(web->text, sizeof web->text,
                          "{\"gravity\":[%.9g,%.9g,%.9g],\"volume\":%.9g,\"above\":%.9g",
                          snapshot->gravity[0], snapshot->gravity[1], snapshot->gravity[2],
                          snapshot->volume, snapshot->above);
  web->pose_received = snapshot->pose_received;
  ++web->number;
  (void)pthread_mutex_unlock(&web->lock);
  lws.cancel_service(web->context);
}
